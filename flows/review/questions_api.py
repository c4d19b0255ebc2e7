"""The interface of the questions view: the next questions, loops of their frames, and what the answers change.

Answers are edits of the capture's marks, saved and taken back like any other.
"""

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Response
from pydantic import BaseModel, ConfigDict, Field

from glint.flows.review.dependencies import CaptureId, ObjectId, ReviewState
from glint.flows.review.inputs_api import PNG, Coordinate, FrameNumber
from glint.storage.catalogue.models import MAX_PIXELS_PER_SIDE
from glint.tasks.review.free_marks import mark_tracks, meant_highlights
from glint.tasks.review.questions import labelling, loop_strip, normals_picture, questions

router = APIRouter(prefix="/captures/{object_id}/{capture_id}/questions")

MAX_POINTS = 200
"""Points of a drawn line."""

Position = Annotated[int, Field(ge=0, lt=MAX_PIXELS_PER_SIDE)]


class Drawn(BaseModel):
    """A click, or a line that was drawn: pixels (x, y) of the full frame; of a frame, or (null) of all frames."""

    model_config = ConfigDict(extra="forbid")
    frame: Annotated[int, Field(ge=0, lt=100_000_000)] | None = None
    points: Annotated[list[tuple[Position, Position]], Field(min_length=1, max_length=MAX_POINTS)]


Part = Annotated[Literal["object", "sphere"], Query()]


@router.get("")
def proposed(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> dict[str, Any]:
    """Return the next questions, the most valuable first, and the marks that the capture has."""
    context = review.context(object_id, capture_id)
    proposals = questions(context)
    review.preparation.show(context)  # while the first loop is watched, all is made ready for its answer
    return proposals


@router.get("/loop", response_class=Response, responses=PNG)
def loop(
    review: ReviewState,
    object_id: ObjectId,
    capture_id: CaptureId,
    frame: FrameNumber,
    x: Coordinate,
    y: Coordinate,
    part: Part = "object",
) -> Response:
    """Return the frames around a highlight, or of the chrome sphere in them, one below the other."""
    return Response(loop_strip(review.context(object_id, capture_id), frame, x, y, part), media_type="image/png")


@router.post("/highlights")
def highlights(review: ReviewState, object_id: ObjectId, capture_id: CaptureId, drawn: Drawn) -> dict[str, Any]:
    """Return the highlights that a click or a line means, and why they cannot be marked; nothing is saved."""
    return meant_highlights(review.context(object_id, capture_id), drawn.frame, drawn.points)


@router.get("/tracks")
def tracks(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> dict[str, Any]:
    """Return the saved marks with the paths that their highlights take through the frames."""
    return mark_tracks(review.context(object_id, capture_id))


@router.get("/labelling")
def labelled(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> dict[str, Any]:
    """Return what the saved marks change of the labels of the last run."""
    return labelling(review.context(object_id, capture_id))


@router.get("/normals", response_class=Response, responses=PNG)
def normals(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> Response:
    """Return the normals with the saved marks, of the region's size."""
    return Response(normals_picture(review.context(object_id, capture_id)), media_type="image/png")
