"""The interface of edits: what people have set of a capture's inputs, saved as revisions; a conflict is an answer."""

from typing import Annotated, Any

from fastapi import APIRouter, Query, Response
from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict

from glint.flows.review.dependencies import CaptureId, ObjectId, ReviewState
from glint.storage.edits.edits import Edits
from glint.storage.edits.merging import ConflictError
from glint.storage.edits.models import Changes, Line, Number, Revision
from glint.tasks.review.capture_inputs import check_mask, mask_picture

router = APIRouter(prefix="/captures/{object_id}/{capture_id}")


class Save(BaseModel):
    """Changes of an author who has seen the edits of `base_revision`."""

    model_config = ConfigDict(extra="forbid")
    changes: Changes
    author: Line
    base_revision: Number


class Undo(BaseModel):
    """The revision that an author takes back."""

    model_config = ConfigDict(extra="forbid")
    revision: Annotated[int, Query(ge=1)]
    author: Line


@router.get("/edits")
def current(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> dict[str, Any]:
    """Return the newest edits of a capture (of the mask only whether there is one), and all revisions, newest first."""
    review.context(object_id, capture_id)
    edits = _edits(review, object_id)
    if edits is None:
        return {"capture": capture_id, "revision": 0, "has_mask": False, "history": [], "notes": []}
    newest = edits.current(capture_id)
    history = [_revision(item) for item in reversed(edits.history(capture_id))]
    undoable = edits.next_undo(capture_id)
    content = newest.model_dump(mode="json", exclude={"mask"})
    return content | {"has_mask": newest.mask is not None, "history": history, "undoable": undoable}


@router.get("/mask", response_class=Response, responses={200: {"content": {"image/png": {}}, "description": "a mask"}})
def mask(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> Response:
    """Return the mask, white on black, of the full frame's size: as edited, else as the last run used it."""
    edits = _edits(review, object_id)
    edited = None if edits is None else edits.current(capture_id).mask
    return Response(mask_picture(review.context(object_id, capture_id), edited), media_type="image/png")


@router.post("/edits", responses={409: {"description": "somebody else has changed the same since"}})
def save(review: ReviewState, object_id: ObjectId, capture_id: CaptureId, request: Save) -> Any:
    """Save changes as a revision; null: nothing would change."""
    if request.changes.mask is not None:
        check_mask(request.changes.mask, review.context(object_id, capture_id))
    else:
        review.context(object_id, capture_id)
    edits = Edits.open(review.location, object_id)
    try:
        return _saved(edits.save(capture_id, request.changes, request.author, request.base_revision))
    except ConflictError as conflict:
        return _conflict(conflict)


@router.post("/edits/undo", responses={409: {"description": "somebody else has changed the same since"}})
def undo(review: ReviewState, object_id: ObjectId, capture_id: CaptureId, request: Undo) -> Any:
    """Take a revision of this capture back, by a new one."""
    review.context(object_id, capture_id)
    edits = Edits.open(review.location, object_id, create=False)
    if request.revision not in {item.number for item in edits.history(capture_id)}:
        raise LookupError(f"{object_id}/{capture_id} has no edit {request.revision}")
    try:
        return _saved(edits.undo(request.revision, request.author))
    except ConflictError as conflict:
        return _conflict(conflict)


def _edits(review: ReviewState, object_id: str) -> Edits | None:
    """Open the edits of an object, None where the store does not have it yet."""
    return None if review.repository(object_id) is None else Edits.open(review.location, object_id, create=False)


def _revision(revision: Revision) -> dict[str, Any]:
    return revision.model_dump(mode="json", exclude={"seals"})


def _saved(revision: Revision | None) -> dict[str, Any]:
    return {"revision": None if revision is None else _revision(revision)}


def _conflict(conflict: ConflictError) -> JSONResponse:
    fields = [
        {"field": item.field, "author": item.author, "time": item.time.isoformat(), "revision": item.revision}
        for item in conflict.conflicts
    ]
    content = {"error": conflict.message, "remedy": conflict.remedy, "conflicts": fields}
    return JSONResponse(content, status_code=409)
