"""The key of an object's model, and whether it has one; apart from the model, whose libraries are slow to import."""

from collections.abc import Sequence

from glint.storage.seals import digest_of
from glint.tasks.engine.capture_context import CaptureContext

STAGE, VERSION = "model", 9


def wants_model(works: Sequence[CaptureContext]) -> bool:
    """Return whether an object's captures are to be merged: there are several, and at least one has a pose."""
    return len(works) > 1 and any(work.capture.pose is not None for work in works)


def model_key(works: Sequence[CaptureContext]) -> str:
    """Return the digest of all that determines the model: the captures' labels, poses and cameras, its parameters."""
    first = works[0]
    return digest_of(
        {
            "stage": STAGE,
            "version": VERSION,
            "parameters": first.parameters.model.model_dump(mode="json"),
            "views": {
                work.capture.id: [
                    work.repository.stage_key(work.capture.id, "labels"),
                    work.entry_digest(("pose", "camera", "pixel_size")),
                ]
                for work in works
            },
        }
    )
