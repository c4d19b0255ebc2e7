"""The captures of one object, and what is to be done about them: known without Prefect, Dask, workers or videos."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from glint.flows.errors import USER_ERRORS
from glint.flows.results import CaptureResult, ObjectResult
from glint.storage.catalogue.loading import Catalogue
from glint.tasks.engine.capture_context import CaptureContext, with_edits
from glint.tasks.engine.references import chosen_captures
from glint.tasks.pipeline import STAGES
from glint.tasks.up_to_date import pending_stages, up_to_date_records


@dataclass(frozen=True, slots=True)
class ObjectCaptures:
    """Captures of one object: those chosen, and all of them.

    catalogue: the address of the catalogue; n_captures: captures of its objects together; adopt: whether the object may
    have been published from another catalogue.
    """

    chosen: tuple[CaptureContext, ...]
    all: tuple[CaptureContext, ...]
    catalogue: str
    n_captures: int
    adopt: bool = False

    @classmethod
    def of(
        cls,
        catalogue: Catalogue,
        address: str,
        object_id: str,
        chosen: Sequence[str],
        store: str,
        *,
        run: str,
        rehash: bool = False,
        adopt: bool = False,
    ) -> "ObjectCaptures":
        """Make the contexts of an object's captures; `chosen`: ids, none for all.

        Raises:
            InputError: the catalogue has no object or capture of that name.
        """
        only = [f"{object_id}/{capture_id}" for capture_id in chosen] or [object_id]
        item = catalogue.find(object_id)
        # A run asks for each of its objects: the others are looked through only to say which name was meant.
        chosen = chosen_captures(catalogue.objects if item is None else [item], only)[object_id]
        contexts = tuple(
            CaptureContext.of(catalogue, object_id, capture.id, store, run, rehash)
            for capture in catalogue.object(object_id).captures
        )
        return cls(
            tuple(context for context in contexts if context.capture.id in chosen),
            contexts,
            address,
            catalogue.n_captures,
            adopt,
        )

    def with_edits(self) -> "ObjectCaptures":
        """Return them with the edits of the store over their entries in the catalogue.

        Raises:
            StoreError: the edits cannot be read.
        """
        edited, names = with_edits(self.all), {context.capture.id for context in self.chosen}
        return replace(self, chosen=tuple(item for item in edited if item.capture.id in names), all=edited)

    @property
    def object_id(self) -> str:
        """The object's id."""
        return self.all[0].object_id

    @property
    def ids(self) -> list[tuple[str, str]]:
        """Object's and capture's id of each chosen capture."""
        return [(context.object_id, context.capture.id) for context in self.chosen]


def up_to_date(captures: ObjectCaptures) -> ObjectResult | None:
    """Return the result of an object that needs no processing; None if it does, or if its state cannot be read."""
    try:
        return _stored_result(captures.with_edits())
    except USER_ERRORS:
        return None


def _stored_result(captures: ObjectCaptures) -> ObjectResult | None:
    """Return the same of captures with their edits."""
    try:
        stored = up_to_date_records(captures.chosen)
    except USER_ERRORS:
        return None
    if stored is None:
        return None
    version, records = stored
    results = (CaptureResult(object_id, name, 0.0, records[name]) for object_id, name in captures.ids)
    return ObjectResult(captures.object_id, tuple(results), version)


def unchanged_objects(
    objects: Iterable[ObjectCaptures],
    workers: int,
    report: Callable[[ObjectResult], None],
    prepare: Callable[[], object],
) -> tuple[dict[str, ObjectResult], int]:
    """Find the objects that need no processing, until the others have work for all workers.

    workers: as many as there may be. report: called with each result as soon as it is known. prepare: called as soon as
    it is known that a worker will be needed, and again for each object that needs one.
    Returns the results by object, and the number of workers that have work with the other objects; 0: there are none.
    """
    unchanged, busy = dict[str, ObjectResult](), 0
    for captures in objects:
        try:
            edited = captures.with_edits()
            result = _stored_result(edited)
            wanted = 0 if result is not None else _workers_for(edited, workers)
        except Exception:  # the object's flow meets it again, and reports it as this object's alone
            result, wanted = None, 1
        if result is not None:
            unchanged[captures.object_id] = result
            report(result)
        else:
            prepare()
        busy = min(workers, busy + wanted)
        if busy == workers:
            break
    return unchanged, busy


def _workers_for(captures: ObjectCaptures, workers: int) -> int:
    """Return how many workers captures can keep busy: all where a stage shares its tiles, else one a capture.

    captures: with their edits.
    """
    try:
        pending = [pending_stages(context) for context in captures.chosen]
    except USER_ERRORS:
        return 1
    if any(stage.parallel_tiles and stage.name in names for names in pending for stage in STAGES):
        return workers
    return max(1, sum(bool(names) for names in pending))
