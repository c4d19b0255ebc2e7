"""How captures, objects and runs ended."""

from dataclasses import dataclass
from typing import Any

from prefect.client.schemas.objects import State
from prefect.states import Completed, Failed

from glint.storage.versions.repository import Version
from glint.tasks.engine.stage import Record
from glint.tasks.version_diff import Drift


@dataclass(frozen=True, slots=True)
class CaptureResult:
    """How a capture ended: its records, or what is wrong (`error`) and what to do (`remedy`)."""

    object_id: str
    capture_id: str
    seconds: float
    records: tuple[Record, ...] = ()
    error: str = ""
    remedy: str = ""

    @property
    def name(self) -> str:
        """OBJECT/CAPTURE."""
        return f"{self.object_id}/{self.capture_id}"

    @property
    def cached(self) -> bool:
        """Whether nothing had to be computed."""
        return bool(self.records) and all(record.cached for record in self.records)

    def count(self, stage: str, name: str) -> float | None:
        """A count that a stage recorded."""
        return next((record.counts.get(name) for record in self.records if record.stage == stage), None)

    @property
    def warnings(self) -> list[str]:
        """Warnings of all stages."""
        return [warning for record in self.records for warning in record.warnings]


@dataclass(frozen=True, slots=True)
class ObjectResult:
    """How an object ended: its captures, the version that holds what succeeded (None: nothing did), and what moved
    further against the version before than the run allows."""

    object_id: str
    captures: tuple[CaptureResult, ...]
    version: Version | None = None
    drifts: tuple[Drift, ...] = ()


@dataclass(frozen=True, slots=True)
class RunResult:
    """How a run ended; `drift`: the angle in degrees beyond which objects count as moved, None: not looked at."""

    run: str
    objects: tuple[ObjectResult, ...]
    seconds: float

    @property
    def captures(self) -> list[CaptureResult]:
        """Captures of all objects."""
        return [capture for each in self.objects for capture in each.captures]

    @property
    def failed(self) -> list[CaptureResult]:
        """Captures that gave no result."""
        return [each for each in self.captures if each.error]

    @property
    def drifts(self) -> list[Drift]:
        """What moved of all objects."""
        return [drift for each in self.objects for drift in each.drifts]


def final_state(captures: list[CaptureResult], done: str, result: Any) -> State[Any]:
    """The state of a flow run that has tried all these captures, with its result.

    Done, partially done or failed; the message says how many captures failed, and why the first of them did.
    """
    failed = [each for each in captures if each.error]
    if not failed:
        return Completed(message=done, data=result)
    why = f"{failed[0].name}: {failed[0].error} -> {failed[0].remedy}"
    message = f"{len(failed)} of {len(captures)} captures failed; {why}"
    name = "Failed" if len(failed) == len(captures) else "PartiallyDone"
    return Failed(message=message, name=name, data=result)
