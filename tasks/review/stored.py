"""Read what the store holds of a capture or version; nothing is stored for one that never ran."""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from glint.storage.catalogue.models import Region
from glint.storage.edits.edits import Edits
from glint.storage.edits.models import CaptureEdits
from glint.storage.errors import StoreError
from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository, object_ids
from glint.storage.versions.snapshots import index_errors
from glint.storage.versions.stages.names import check_name
from glint.storage.versions.transaction import repository_folder
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.model.model_key import with_rollbacks
from glint.tasks.review.summary import Records


@dataclass(frozen=True, slots=True)
class VersionReference:
    """A version of an object in a store, by its name and its snapshot: a store that is filled again has another v1.

    repository: the object's results, open.
    """

    store: str
    object_id: str
    name: str
    snapshot: str
    repository: ObjectRepository = field(compare=False, repr=False)


def has_object(location: Location, object_id: str) -> bool:
    """Return whether a store has an object of this id.

    Raises:
        StoreError: the id cannot name one.
    """
    folder = repository_folder(location, check_name(object_id, "object"))
    return object_id in object_ids(location) if folder.local is None else folder.local.is_dir()


def saved_records(context: CaptureContext) -> Records:
    """Return key and record of the stages that a capture's results are loaded from (`ref`), by name.

    Raises:
        StoreError: the store cannot be read.
    """
    if not has_object(context.location, context.object_id):
        return {}
    repository = context.repository
    with index_errors(context.location.uri, "reading its results", context.object_id):
        is_work = context.ref == "work"
        snapshot = repository.index.lookup_branch("work") if is_work else repository.version(context.ref).snapshot
    return _records_at(repository, context.capture.id, snapshot)


def with_rollback(context: CaptureContext) -> CaptureContext:
    """Return the context with the results that the newest version has, where a rollback has put them in place of newer
    ones; else the newest ones."""
    if not has_object(context.location, context.object_id):
        return context
    try:
        return with_rollbacks([context])[0]
    except StoreError:
        # Versions that cannot be read do not keep a person from the inputs.
        return context


def mask_region(saved: Records) -> Region:
    """Return the region of the stored mask and of what follows from it, in the full frame.

    saved: records with that of the mask. The survey may have another region already, where a run ended before the mask.
    """
    return Region(**saved["mask"][1]["region"])


@lru_cache(maxsize=64)
def _records_at(repository: ObjectRepository, capture: str, snapshot: str) -> Records:
    """Return the records of a snapshot, which never change; every request asks for them."""
    return repository.records(capture, snapshot)


def current_edits(context: CaptureContext) -> CaptureEdits | None:
    """Return what people edited of a capture, None where the store does not have its object.

    Raises:
        StoreError: the store cannot be read.
    """
    if not has_object(context.location, context.object_id):
        return None
    return Edits.open(context.location, context.object_id, create=False).current(context.capture.id)


def edited_mask(context: CaptureContext) -> np.ndarray | None:
    """Return the mask (H, W) bool of the full frame that a person painted, None where nobody has.

    Raises:
        StoreError: the store cannot be read.
    """
    edits = current_edits(context)
    return None if edits is None else edits.mask
