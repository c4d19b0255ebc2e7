"""The interface of the questions view: the next questions, loops of their frames, and what the answers change.

Answers are edits of the capture's marks, saved and taken back like any other.
"""

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Response

from glint.flows.review.dependencies import CaptureId, ObjectId, ReviewState
from glint.flows.review.inputs_api import PNG, Coordinate, FrameNumber
from glint.tasks.review.questions import labelling, loop_strip, normals_picture, questions

router = APIRouter(prefix="/captures/{object_id}/{capture_id}/questions")

Part = Annotated[Literal["object", "sphere"], Query()]


@router.get("")
def proposed(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> dict[str, Any]:
    """Return the next questions, the most valuable first, and the marks that the capture has."""
    return questions(review.context(object_id, capture_id))


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


@router.get("/labelling")
def labelled(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> dict[str, Any]:
    """Return what the saved marks change of the labels of the last run."""
    return labelling(review.context(object_id, capture_id))


@router.get("/normals", response_class=Response, responses=PNG)
def normals(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> Response:
    """Return the normals with the saved marks, of the region's size."""
    return Response(normals_picture(review.context(object_id, capture_id)), media_type="image/png")
