"""What the store holds of a capture; looking at one that never ran stores nothing."""

from glint.storage.locations.location import Location
from glint.storage.versions.repository import object_ids
from glint.storage.versions.stage_results import check_name
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.review.summary import Records


def has_object(location: Location, object_id: str) -> bool:
    """Return whether a store has an object of this id.

    Raises:
        StoreError: the id cannot name one.
    """
    folder = location.child("objects", check_name(object_id, "object"), "repo")
    return object_id in object_ids(location) if folder.local is None else folder.local.is_dir()


def saved_records(context: CaptureContext) -> Records:
    """Return key and record of the capture's newest stages, by name.

    Raises:
        StoreError: the store cannot be read.
    """
    if not has_object(context.location, context.object_id):
        return {}
    return context.repository.records(context.capture.id)
