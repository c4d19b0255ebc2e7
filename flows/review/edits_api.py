"""The interface of edits: what people have set of a capture's inputs, saved as revisions; a conflict is an answer."""

from typing import Annotated, Any

from fastapi import APIRouter, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from glint.flows.review.dependencies import CaptureId, ObjectId, ReviewState
from glint.storage.edits.edits import Edits
from glint.storage.edits.merging import ConflictError
from glint.storage.edits.models import CaptureEdits, Changes, EncodedMask, Line, Number, Revision
from glint.storage.errors import NotFoundError
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.review.capture_inputs import check_changes, check_mask_head, mask_picture
from glint.tasks.review.stored import edited_mask

router = APIRouter(prefix="/captures/{object_id}/{capture_id}")


class SentChanges(Changes):
    """Changes as they are sent, with a mask that is not decoded yet."""

    mask: EncodedMask | None = None  # type: ignore[assignment]

    def decoded(self, context: CaptureContext) -> Changes:
        """Return the changes with the mask decoded, once its head states the size of the capture's frames.

        Raises:
            InputError: as `check_mask_head`; RequestValidationError: the mask is no mask.
        """
        if isinstance(self.mask, str):
            check_mask_head(self.mask, context)
        try:
            return Changes(**{name: getattr(self, name) for name in self.model_fields_set})
        except ValidationError as error:
            raise RequestValidationError(error.errors()) from error


class Save(BaseModel):
    """Changes of an author who has seen the edits of `base_revision`."""

    model_config = ConfigDict(extra="forbid")
    changes: SentChanges
    author: Line
    base_revision: Number


class Undo(BaseModel):
    """The revision that an author takes back."""

    model_config = ConfigDict(extra="forbid")
    revision: Annotated[int, Field(ge=1)]
    author: Line


@router.get("/edits")
def current(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> dict[str, Any]:
    """Return the newest edits of a capture (of the mask only whether there is one), and all revisions, newest first."""
    review.context(object_id, capture_id)
    edits = review.edits(object_id)
    if edits is None:
        # The store does not have the object yet.
        newest, history, undoable = CaptureEdits(capture=capture_id, revision=0), list[dict[str, Any]](), None
    else:
        newest, undoable = edits.current(capture_id), edits.next_undo(capture_id)
        history = [_revision(item) for item in reversed(edits.history(capture_id))]
    content = newest.model_dump(mode="json", exclude={"mask"})
    return content | {"has_mask": newest.mask is not None, "history": history, "undoable": undoable}


@router.get("/mask", response_class=Response, responses={200: {"content": {"image/png": {}}, "description": "a mask"}})
def mask(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> Response:
    """Return the mask, white on black, of the full frame's size: as edited, else as the last run used it."""
    context = review.context(object_id, capture_id)
    return Response(mask_picture(context, edited_mask(context)), media_type="image/png")


@router.post("/edits", responses={409: {"description": "somebody else has changed the same since"}})
def save(review: ReviewState, object_id: ObjectId, capture_id: CaptureId, request: Save) -> Any:
    """Save changes as a revision; null: nothing would change."""
    context = review.context(object_id, capture_id)
    changes = request.changes.decoded(context)
    if changes.changed:
        check_changes(changes, context)
    edits = Edits.open(review.location, object_id)
    try:
        return _saved(edits.save(capture_id, changes, request.author, request.base_revision))
    except ConflictError as conflict:
        return _conflict(conflict)


@router.post("/edits/undo", responses={409: {"description": "somebody else has changed the same since"}})
def undo(review: ReviewState, object_id: ObjectId, capture_id: CaptureId, request: Undo) -> Any:
    """Take a revision of this capture back, by a new one."""
    review.context(object_id, capture_id)
    edits = Edits.open(review.location, object_id, create=False)
    if request.revision not in {item.number for item in edits.history(capture_id)}:
        raise NotFoundError(f"{object_id}/{capture_id} has no edit {request.revision}", "see the list of changes")
    try:
        return _saved(edits.undo(request.revision, request.author))
    except ConflictError as conflict:
        return _conflict(conflict)


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
