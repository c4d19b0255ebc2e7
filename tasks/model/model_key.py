"""The key of an object's model, the results that it is made of, and whether there is one; without slow imports."""

from collections.abc import Sequence
from dataclasses import replace

from glint.storage.seals import digest_of
from glint.tasks.engine.capture_context import CaptureContext

STAGE, VERSION = "model", 15


def wants_model(works: Sequence[CaptureContext]) -> bool:
    """Return whether an object's captures are to be merged: there are several, and at least one has a pose."""
    return len(works) > 1 and any(work.capture.pose is not None for work in works)


def with_rollbacks(works: Sequence[CaptureContext]) -> list[CaptureContext]:
    """Return the captures of an object with the results that its next version has of them.

    Where the newest results are those of a rolled-back version, publishing leaves what the rollback put in their place.
    """
    repository = works[0].repository
    names = repository.version_names()
    rolled_back = repository.version(names[-1]).rolled_back if names else {}
    newest = repository.contents() if rolled_back else {}
    return [
        replace(work, ref=names[-1]) if newest.get(work.capture.id) in rolled_back.get(work.capture.id, ()) else work
        for work in works
    ]


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
                    work.repository.stage_key(work.capture.id, "labels", work.ref),
                    work.entry_digest(("pose", "camera", "pixel_size")),
                ]
                for work in works
            },
        }
    )
