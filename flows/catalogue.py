"""The flow of a catalogue: its captures side by side, each object published when its last capture is done."""

import contextvars
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from threading import Semaphore

from prefect import flow, runtime

from flows.artifacts import catalogue_artifact
from flows.capture import capture
from flows.errors import REFUSALS
from flows.progress import Event
from flows.surroundings import surroundings
from storage.fingerprints import digest_of
from storage.location import Location
from storage.locks import run_lock
from storage.versions import Version
from tasks.references import CaptureReference, chosen_captures, load_catalogue
from tasks.stage import Record
from tasks.workspace import INPUTS


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
    """How an object ended: its captures, and the version that now holds what succeeded (None: nothing did)."""

    object_id: str
    captures: tuple[CaptureResult, ...]
    version: Version | None = None


@dataclass(frozen=True, slots=True)
class RunResult:
    """How a run ended."""

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


@flow(name="catalogue", flow_run_name="{name}", validate_parameters=False, persist_result=False)
def run_catalogue(
    catalogue: str,
    name: str,
    store: str,
    scheduler: str,
    only: Sequence[str] = (),
    side_by_side: int = 2,
    rehash: bool = False,
) -> RunResult:
    """Work through a catalogue, or those of its captures that `only` names (OBJECT or OBJECT/CAPTURE).

    side_by_side: captures that are worked on at the same time.
    """
    started, run = time.monotonic(), str(runtime.flow_run.id)
    chosen = chosen_captures(load_catalogue(catalogue).objects, only)
    free = Semaphore(side_by_side)
    with ThreadPoolExecutor(side_by_side) as pool:
        futures = []
        for each, captures in chosen.items():
            references = [CaptureReference(catalogue, each, one, store, run, rehash) for one in captures]
            futures.append(_submit(pool, work_on_object, references, scheduler, free))
        try:
            objects = [future.result() for future in futures]
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            surroundings(scheduler).abandon()
            raise
    result = RunResult(run, tuple(objects), time.monotonic() - started)
    catalogue_artifact(name, result)
    return result


def work_on_object(references: Sequence[CaptureReference], scheduler: str, free: Semaphore) -> ObjectResult:
    """Work on captures of one object, and publish those that succeeded as a version."""
    object_id, store, run = references[0].object_id, references[0].store, references[0].run
    try:
        with run_lock(Location.parse(store), object_id, run), ThreadPoolExecutor(len(references)) as pool:
            futures = [_submit(pool, work_on_capture, each, scheduler, free) for each in references]
            captures = tuple(future.result() for future in futures)
            done = [each for each in captures if not each.error]
            version = publish(references, done) if done else None
    except REFUSALS as error:
        refused = tuple(
            CaptureResult(object_id, each.capture_id, 0.0, error=error.message, remedy=error.remedy)
            for each in references
        )
        for each in refused:
            surroundings(scheduler).show(Event("failed", each.name, text=str(error)))
        return ObjectResult(object_id, refused)
    return ObjectResult(object_id, captures, version)


def work_on_capture(reference: CaptureReference, scheduler: str, free: Semaphore) -> CaptureResult:
    """Run the flow of one capture when it is its turn; what goes wrong stays with this capture."""
    show = surroundings(scheduler).show
    with free:
        surroundings(scheduler).check()
        started = time.monotonic()
        records: list[Record] = []
        error = remedy = ""
        try:
            records = capture(reference, scheduler)
        except REFUSALS as refusal:
            error, remedy = refusal.message, refusal.remedy
        except Exception as defect:
            surroundings(scheduler).check()
            error, remedy = (
                f"{type(defect).__name__}: {defect}",
                "this is a defect of Glint; its trace is in the run's log",
            )
        result = CaptureResult(
            reference.object_id, reference.capture_id, time.monotonic() - started, tuple(records), error, remedy
        )
        if error:
            show(Event("failed", result.name, text=f"{error}: {remedy}"))
        else:
            show(Event("capture", result.name, seconds=result.seconds, cached=result.cached))
        return result


def publish(references: Sequence[CaptureReference], done: Sequence[CaptureResult]) -> Version:
    """Make what was computed a version of the object, if it differs from the newest one."""
    first = references[0]
    works = {each.capture_id: each.workspace() for each in references}
    inputs = {
        each.capture_id: {key: digest for key in INPUTS if (digest := works[each.capture_id].digest(key))}
        for each in done
    }
    metadata = {
        "run": first.run,
        "glint": version("glint"),
        "catalogue": first.catalogue,
        "parameters": {
            each.capture_id: digest_of(works[each.capture_id].parameters.model_dump(mode="json")) for each in done
        },
        "inputs": inputs,
    }
    repository = works[first.capture_id].repository
    return repository.publish([each.capture_id for each in done], metadata, message=f"run {first.run}")


def _submit[**P, R](pool: ThreadPoolExecutor, function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> Future[R]:
    """Run in a thread that knows the flow run around it."""
    return pool.submit(contextvars.copy_context().run, partial(function, *args, **kwargs))
