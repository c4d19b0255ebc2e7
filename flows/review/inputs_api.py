"""The interface of the inputs view: pictures, geometry, the fit of a sphere, the history of a pixel."""

from dataclasses import asdict
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Response
from pydantic import BaseModel, ConfigDict

from glint.flows.review.dependencies import CaptureId, ObjectId, ReviewState
from glint.flows.review.remedies import on_page
from glint.storage.catalogue.models import MAX_PIXELS_PER_SIDE, Pixel, Positive
from glint.tasks.review.capture_inputs import capture_inputs, mask_to_replace
from glint.tasks.review.growing import grow
from glint.tasks.review.pictures import frame_picture, level_picture, thumbnail
from glint.tasks.review.pixel_history import pixel_history
from glint.tasks.review.sphere_fit import fit_sphere
from glint.tasks.review.stored import edited_mask

router = APIRouter(prefix="/captures/{object_id}/{capture_id}")

PNG: dict[int | str, dict[str, Any]] = {200: {"content": {"image/png": {}}, "description": "a picture"}}

FrameNumber = Annotated[int, Query(ge=0, lt=100_000_000)]
Coordinate = Annotated[int, Query(ge=0, lt=MAX_PIXELS_PER_SIDE)]


class DrawnSphere(BaseModel):
    """A circle that a person drew, in pixels of the full frame."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    x: Pixel
    y: Pixel
    radius: Positive


@router.get("/inputs")
def inputs(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> dict[str, Any]:
    """Return the capture's inputs, given and used, and its lights; its questions are prepared in the background."""
    context = review.context(object_id, capture_id)
    review.preparation.show(context)
    shown = capture_inputs(context)
    warnings = [warning | {"message": on_page(warning["message"])} for warning in shown["warnings"]]
    return shown | {"warnings": warnings}


@router.get("/thumbnail", response_class=Response, responses=PNG)
def small_picture(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> Response:
    """Return a small picture of the object."""
    return _picture(thumbnail(review.context(object_id, capture_id)))


@router.get("/frame", response_class=Response, responses=PNG)
def frame(review: ReviewState, object_id: ObjectId, capture_id: CaptureId, number: FrameNumber) -> Response:
    """Return a frame, counted from 0, of the full frame's size."""
    return _picture(frame_picture(review.context(object_id, capture_id), number))


@router.get("/level/{level}", response_class=Response, responses=PNG)
def level(
    review: ReviewState, object_id: ObjectId, capture_id: CaptureId, level: Literal["background", "peak", "mean"]
) -> Response:
    """Return the temporal median, maximum or mean, of the full frame's size."""
    return _picture(level_picture(review.context(object_id, capture_id), level))


@router.post("/sphere-fit")
def sphere_fit(review: ReviewState, object_id: ObjectId, capture_id: CaptureId, sphere: DrawnSphere) -> dict[str, Any]:
    """Return the contour that the frames show near a drawn circle, and by how much the circle misses it."""
    context = review.context(object_id, capture_id)
    return asdict(fit_sphere(context, sphere.x, sphere.y, sphere.radius))


@router.get("/pixel")
def pixel(
    review: ReviewState, object_id: ObjectId, capture_id: CaptureId, x: Coordinate, y: Coordinate
) -> dict[str, Any]:
    """Return the frames in which a pixel was lit, and its candidates."""
    return pixel_history(review.context(object_id, capture_id), x, y)


@router.get("/growth", response_class=Response, responses=PNG)
def growth(
    review: ReviewState,
    object_id: ObjectId,
    capture_id: CaptureId,
    x: Coordinate,
    y: Coordinate,
    tolerance: Annotated[int, Query(ge=0, le=255)],
    picture: Annotated[str, Query(pattern=r"^(background|peak|mean|[0-9]{1,8})$")] = "mean",
) -> Response:
    """Return what is connected with a pixel and looks alike on a frame (its number) or level, white on black."""
    context = review.context(object_id, capture_id)
    return _picture(grow(context, picture, x, y, tolerance, mask_to_replace(context, edited_mask(context))))


def _picture(data: bytes) -> Response:
    return Response(data, media_type="image/png")
