"""Results of captures, objects and runs."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from glint.storage.catalogue.models import MODEL
from glint.storage.versions.repository import Version
from glint.tasks.engine.stage import StageRecord
from glint.tasks.engine.stage_warning import by_cost
from glint.tasks.version_diff import Drift

if TYPE_CHECKING:
    from prefect.client.schemas.objects import State


@dataclass(frozen=True, slots=True)
class CaptureResult:
    """Result of a capture: its stage records, or the `error`, its `remedy`, and whether it is one of the spheres."""

    object_id: str
    capture_id: str
    seconds: float
    records: tuple[StageRecord, ...] = ()
    error: str = ""
    remedy: str = ""
    failed_for_sphere: bool = False

    @property
    def name(self) -> str:
        """OBJECT/CAPTURE."""
        return f"{self.object_id}/{self.capture_id}"

    @property
    def cached(self) -> bool:
        """True if nothing had to be computed."""
        return bool(self.records) and all(record.cached for record in self.records)

    @property
    def outcome(self) -> str:
        """`failed`, `up to date` or `done`, as tables name it."""
        return "failed" if self.error else "up to date" if self.cached else "done"

    def count(self, stage: str, name: str) -> float | None:
        """Return a count that a stage recorded, None if it has none of that name."""
        return next((record.counts.get(name) for record in self.records if record.stage == stage), None)

    @property
    def warnings(self) -> list[str]:
        """Messages of the warnings of all stages, the most costly first."""
        return [
            warning.message for warning in by_cost(warning for record in self.records for warning in record.warnings)
        ]


def without_models(results: Iterable[CaptureResult]) -> list[CaptureResult]:
    """Return the results of captures: an object's model is none."""
    return [result for result in results if result.capture_id != MODEL]


@dataclass(frozen=True, slots=True)
class ObjectResult:
    """Result of an object: its captures, the version that holds those that succeeded (None: none did), and the changes
    against the version before that exceed what the run allows."""

    object_id: str
    captures: tuple[CaptureResult, ...]
    version: Version | None = None
    drifts: tuple[Drift, ...] = ()


@dataclass(frozen=True, slots=True)
class RunResult:
    """Result of a run."""

    run: str
    objects: tuple[ObjectResult, ...]
    seconds: float

    @property
    def captures(self) -> list[CaptureResult]:
        """Captures of all objects."""
        return [capture for result in self.objects for capture in result.captures]

    @property
    def failed(self) -> list[CaptureResult]:
        """Captures that gave no result."""
        return [capture for capture in self.captures if capture.error]

    @property
    def drifts(self) -> list[Drift]:
        """Changes of all objects that exceed the allowed angle."""
        return [drift for result in self.objects for drift in result.drifts]


def final_state(captures: list[CaptureResult], done: str, result: Any) -> "State[Any]":
    """Return the state of a flow run that has processed all these captures, with its result.

    Completed, PartiallyCompleted or Failed; the message says how many captures failed, and why the first of them did.
    """
    from prefect.states import Completed, Failed

    failed = [capture for capture in captures if capture.error]
    if not failed:
        return Completed(message=done, data=result)
    reason = f"{failed[0].name}: {failed[0].error} -> {failed[0].remedy}"
    message = f"{len(failed)} of {len(captures)} captures failed; {reason}"
    name = "Failed" if len(failed) == len(captures) else "PartiallyCompleted"
    return Failed(message=message, name=name, data=result)


def result_of(state: "State[Any]") -> Any:
    """Return the result that a flow run left in its final state, whatever that state is.

    Raises:
        BaseException: what ended the flow run instead of a result.
    """
    result = state.result(raise_on_failure=False)
    if isinstance(result, BaseException):
        raise result
    return result
