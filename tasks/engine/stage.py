"""Stages of a capture: what each needs, the key of its result, and performing it once.

A stage's key is the digest of everything its result follows from: its version, its parameters, what the catalogue says,
the content of the inputs it reads and the keys of the stages before it. A result that is stored under that very key is
not computed again.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from time import perf_counter
from typing import Any, Protocol

import numpy as np

from glint.storage.inputs.digests import digest_of
from glint.storage.versions.stage_results import StoredFile
from glint.tasks.engine.capture_context import Workspace, facts_of

Progress = Callable[[int, int | None], None]
"""Told how much is done, and of how much (None: not known)."""


@dataclass(frozen=True)
class Outcome:
    """What a step computed: arrays and files to store; `record` of JSON values; `counts` and `warnings` go into it."""

    arrays: Mapping[str, Any] = field(default_factory=dict)
    record: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, StoredFile] = field(default_factory=dict)
    counts: Mapping[str, float] = field(default_factory=dict)
    warnings: Sequence[str] = ()


class Step(Protocol):
    """A stage's function: loads what it needs, computes, and returns what is to be saved."""

    def __call__(self, work: Workspace, progress: Progress) -> Outcome:
        """Compute the stage's result."""


@dataclass(frozen=True)
class Stage:
    """A stage: its step, the stages it needs, the capture's keys and inputs it reads; a new `version` redoes it."""

    name: str
    step: Step
    needs: tuple[str, ...] = ()
    facts: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    version: int = 1


@dataclass(frozen=True, slots=True)
class Record:
    """What performing a stage says: whether it was there already (`cached`), its seconds, counts and warnings."""

    stage: str
    key: str
    cached: bool
    seconds: float
    counts: dict[str, float]
    warnings: tuple[str, ...]


def stage_keys(work: Workspace, stages: Sequence[Stage]) -> dict[str, str]:
    """Key of every stage, in the order in which they run."""
    keys: dict[str, str] = {}
    for stage in stages:
        keys[stage.name] = digest_of(
            {
                "stage": stage.name,
                "version": stage.version,
                "parameters": _parameters(work, stage.name),
                "facts": facts_of(work.capture, stage.facts),
                "inputs": [work.digest(name) for name in stage.inputs],
                "needs": [keys[name] for name in stage.needs],
            }
        )
    return keys


def stored(saved: Mapping[str, tuple[str, Mapping[str, Any]]], keys: Mapping[str, str]) -> tuple[Record, ...]:
    """What performing stages would say if all of them were `saved` (key and record) under these keys, else nothing."""
    if any(stage not in saved or saved[stage][0] != key for stage, key in keys.items()):
        return ()
    return tuple(_record_of(stage, key, saved[stage][1], 0.0) for stage, key in keys.items())


def perform(work: Workspace, stage: Stage, key: str, progress: Progress | None = None) -> Record:
    """Compute and save a stage's result, unless it is stored under its key already.

    Raises:
        InputError, StoreError, UnusableCapture: as the step does.
    """
    facts = {
        "parameters": _parameters(work, stage.name),
        "inputs": {name: work.digest(name) for name in stage.inputs if work.digest(name) is not None},
        "versions": {stage.name: stage.version},
    }
    return recall_or_save(work, work.capture.id, stage.name, key, facts, lambda: stage.step(work, progress or silent))


def recall_or_save(
    work: Workspace, capture: str, stage: str, key: str, facts: Mapping[str, Any], compute: Callable[[], Outcome]
) -> Record:
    """The record of what is stored whole under this key of a capture, or of the whole object; else compute and save it.

    facts: of the stage itself, for its record; its `versions` are joined by those of the code.
    """
    started, repository = perf_counter(), work.repository
    if repository.stage_key(capture, stage) == key:
        found = repository.load(capture, stage)
        return _record_of(stage, key, found.record, perf_counter() - started)
    outcome = compute()
    record = {
        **facts,
        "seconds": round(perf_counter() - started, 3),
        "counts": dict(outcome.counts),
        "warnings": list(outcome.warnings),
        "versions": {"glint": version("glint"), "numpy": np.__version__, **facts["versions"]},
        **outcome.record,
    }
    repository.save(capture, stage, key, outcome.arrays, record, outcome.files)
    return Record(stage, key, False, perf_counter() - started, dict(outcome.counts), tuple(outcome.warnings))


def _record_of(stage: str, key: str, saved: Mapping[str, Any], seconds: float) -> Record:
    return Record(stage, key, True, seconds, saved["counts"], tuple(saved["warnings"]))


def _parameters(work: Workspace, stage: str) -> dict[str, Any]:
    said: dict[str, Any] = getattr(work.parameters, stage).model_dump(mode="json")
    return said


def silent(done: int, total: int | None) -> None:
    """Nobody listens."""
