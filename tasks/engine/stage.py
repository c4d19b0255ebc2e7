"""Stages of a capture: what a stage declares, the key of its result, and computing it once.

A stage's key is the digest of everything that its result follows from: its version, its parameters, the catalogue keys
and the content of the files that it declares, and the keys of the stages whose results it reads. A result that is
stored under that very key is not computed again.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from time import perf_counter
from typing import Any, Protocol

import numpy as np
from pydantic import BaseModel

from glint.storage.errors import InputError
from glint.storage.frames.errors import DamagedFrames
from glint.storage.frames.eviction import discard_frames
from glint.storage.seals import digest_of
from glint.storage.versions.array_schema import ArraySchema
from glint.storage.versions.stage_results import StageResult, StoredFile
from glint.storage.versions.verification import earlier_result, whole_result
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.declared_arrays import check_arrays
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.engine.stage_warning import StageWarning

Progress = Callable[[int, int | None], None]
"""Called with the parts that are done and their total (None: unknown)."""

ATTEMPTS = 2
"""Times that a stage is computed while its files change: a copy that has ended does not disturb the second one."""


@dataclass(frozen=True)
class StageOutput:
    """What a stage computed.

    arrays and files: to be stored; record: JSON values; counts: figures for people; warnings: what contradicts the
    data, or is not known.
    """

    arrays: Mapping[str, Any] = field(default_factory=dict)
    record: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, StoredFile] = field(default_factory=dict)
    counts: Mapping[str, float] = field(default_factory=dict)
    warnings: Sequence[StageWarning] = ()


class StageFunction(Protocol):
    """A stage's function: loads what the stage declares, computes, and returns what is to be saved."""

    def __call__(self, inputs: StageInputs, progress: Progress) -> StageOutput:
        """Compute the stage's result."""


@dataclass(frozen=True, slots=True)
class CaptureSize:
    """What decides the memory of a stage: pixels of the region and of the whole frame, bytes of a pixel, and the
    candidates that a pixel may have."""

    region_pixels: int
    frame_pixels: int
    pixel_bytes: int
    candidates: int


@dataclass(frozen=True)
class Stage:
    """The declaration of a stage; everything else that is known of a stage is derived from it.

    name: of the stage, of its group in the store and of its parameters in the catalogue
    run: its function, given only what is declared
    parameters: the model of its parameters
    reads: stages whose results it loads
    catalogue_keys: keys of the capture in the catalogue that it reads
    files: keys of the capture that name files whose content it reads
    arrays: the arrays that its result must have
    peak_bytes: memory at its peak beyond the loaded libraries, by the size of the capture; measured by
        `python -m tests.benchmarks.stage_memory`, rounded up
    progress_unit: what its progress counts
    parallel_tiles: whether several workers can share its work
    version: a new one computes the stage again everywhere
    """

    name: str
    run: StageFunction
    parameters: type[BaseModel]
    reads: tuple[str, ...] = ()
    catalogue_keys: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    arrays: Mapping[str, ArraySchema] = field(default_factory=dict)
    peak_bytes: Callable[[CaptureSize], int] = lambda size: 0
    progress_unit: str = "parts"
    parallel_tiles: bool = False
    version: int = 1


@dataclass(frozen=True, slots=True)
class StageRecord:
    """How a stage ended: `cached` if its result was stored already, its seconds, counts and warnings."""

    stage: str
    key: str
    cached: bool
    seconds: float
    counts: dict[str, float]
    warnings: tuple[StageWarning, ...]


def stage_keys(context: CaptureContext, stages: Sequence[Stage]) -> dict[str, str]:
    """Return the key of every stage, in the order in which they run."""
    keys: dict[str, str] = {}
    for stage in stages:
        keys[stage.name] = digest_of(
            {
                "stage": stage.name,
                "version": stage.version,
                "parameters": _parameters(context, stage.name),
                "catalogue": context.entry_digest(stage.catalogue_keys),
                "files": [context.digest(name) for name in stage.files],
                "reads": [keys[name] for name in stage.reads],
            }
        )
    return keys


def cached_records(
    saved: Mapping[str, tuple[str, Mapping[str, Any]]], keys: Mapping[str, str]
) -> tuple[StageRecord, ...]:
    """Return the records of all stages if each is saved (key and record) under its key, else an empty tuple."""
    if any(stage not in saved or saved[stage][0] != key for stage, key in keys.items()):
        return ()
    return tuple(_cached_record(stage, key, saved[stage][1], 0.0) for stage, key in keys.items())


def perform(context: CaptureContext, stage: Stage, key: str, progress: Progress | None = None) -> StageRecord:
    """Compute and save a stage's result, unless it is stored under its key already.

    Raises:
        InputError, StoreError, UnusableCapture: as the stage does.
        StoreError: an array is not what the stage declares; nothing is stored.
    """
    about = {
        "parameters": _parameters(context, stage.name),
        "inputs": {name: context.digest(name) for name in stage.files if context.digest(name) is not None},
        "versions": {stage.name: stage.version},
    }

    def compute() -> StageOutput:
        output = _on_unchanged_inputs(context, stage, progress or no_progress)
        check_arrays(context, stage.name, stage.reads, stage.arrays, output.arrays)
        return output

    return load_or_compute(context, context.capture.id, stage.name, key, about, compute)


def _on_unchanged_inputs(context: CaptureContext, stage: Stage, progress: Progress) -> StageOutput:
    """Compute a stage's result of the very files that its key covers.

    Raises:
        InputError: a file was replaced, or is being written; else what the stage raises.
    """
    for _ in range(ATTEMPTS):
        stamps = context.stamps(stage.files)
        output = _on_whole_frames(context, stage, progress)
        # A file that was replaced for a while, and is as it was again, may have been read in between.
        if context.stamps(stage.files) == stamps:
            context.check_unchanged(stage.files)
            return output
    raise InputError(
        f"files of {context.name} change while {stage.name} reads them", "run again once they are written completely"
    )


def _on_whole_frames(context: CaptureContext, stage: Stage, progress: Progress) -> StageOutput:
    """Compute a stage's result; cached frames that turn out to be damaged are taken from the video anew."""
    try:
        return stage.run(StageInputs(context, stage), progress)
    except DamagedFrames as damage:
        discard_frames(context.location, damage.digest)
        return stage.run(StageInputs(context, stage), progress)


def load_or_compute(
    context: CaptureContext,
    capture: str,
    stage: str,
    key: str,
    about: Mapping[str, Any],
    compute: Callable[[], StageOutput],
) -> StageRecord:
    """Return the record stored under this key of a capture (or of the whole object); else compute and save it.

    A damaged result is computed again. A result that an earlier version holds under the key, since edits and catalogue
    are as they were then, becomes the newest one without being computed.

    about: the stage's own part of the record; its `versions` are joined by those of the code.
    """
    started, repository = perf_counter(), context.repository
    stored = whole_result(repository, capture, stage, key)
    if stored is None:
        stored = earlier_result(repository, capture, stage, key)
        if stored is not None:
            _save_again(context, stored)
    if stored is not None:
        return _cached_record(stage, key, stored.record, perf_counter() - started)
    output = compute()
    record = {
        **about,
        "seconds": round(perf_counter() - started, 3),
        "counts": dict(output.counts),
        "warnings": [warning.to_json() for warning in output.warnings],
        "versions": {"glint": version("glint"), "numpy": np.__version__, **about["versions"]},
        **output.record,
    }
    repository.save(capture, stage, key, output.arrays, record, output.files)
    seconds, counts, warnings = perf_counter() - started, dict(output.counts), tuple(output.warnings)
    return StageRecord(stage, key, cached=False, seconds=seconds, counts=counts, warnings=warnings)


def _save_again(context: CaptureContext, earlier: StageResult) -> None:
    """Save a result of an earlier version as the newest one."""
    files = {name: StoredFile(earlier.read_file(name), info.media_type) for name, info in earlier.files.items()}
    context.repository.save(earlier.capture, earlier.stage, earlier.key, dict(earlier.arrays), earlier.record, files)


def no_progress(done: int, total: int | None) -> None:
    """Ignore progress."""


def _cached_record(stage: str, key: str, saved: Mapping[str, Any], seconds: float) -> StageRecord:
    warnings = tuple(StageWarning.from_json(warning) for warning in saved["warnings"])
    return StageRecord(stage, key, cached=True, seconds=seconds, counts=saved["counts"], warnings=warnings)


def _parameters(context: CaptureContext, stage: str) -> dict[str, Any]:
    values: dict[str, Any] = getattr(context.parameters, stage).model_dump(mode="json")
    return values
