"""The interface of the surface view: what a version holds of a capture, of the object's model; verified bytes."""

from typing import Annotated, Any

from fastapi import APIRouter, Path, Response

from glint.flows.review.dependencies import CaptureId, ObjectId, ReviewState
from glint.storage.errors import NotFoundError
from glint.tasks.review.surface_data import model_data, surface_data, surface_part

router = APIRouter(prefix="/objects/{object_id}/versions/{version}")

VersionName = Annotated[str, Path(pattern=r"^v[1-9][0-9]{0,8}$")]
PartName = Annotated[str, Path(pattern=r"^[a-z][a-z0-9_]{0,40}$")]
BYTES: dict[int | str, dict[str, Any]] = {
    200: {"content": {"application/octet-stream": {}}, "description": "packed as the facts say"}
}


@router.get("/captures/{capture_id}/surface")
def surface(review: ReviewState, object_id: ObjectId, version: VersionName, capture_id: CaptureId) -> dict[str, Any]:
    """Return what there is to show of a capture, and how its parts are packed."""
    return surface_data(review.version(object_id, version), capture_id).facts


@router.get("/captures/{capture_id}/surface/{part}", response_class=Response, responses=BYTES)
def part(
    review: ReviewState, object_id: ObjectId, version: VersionName, capture_id: CaptureId, part: PartName
) -> Response:
    """Return a part: an array, packed, or a photograph."""
    content = surface_part(review.version(object_id, version), capture_id, part)
    media_type = content.kind if "/" in content.kind else "application/octet-stream"
    return Response(content.data, media_type=media_type)


@router.get("/model")
def model(review: ReviewState, object_id: ObjectId, version: VersionName) -> dict[str, Any] | None:
    """Return what there is to show of the object's model; null without one."""
    data = model_data(review.version(object_id, version))
    return None if data is None else data.facts


@router.get("/model/{part}", response_class=Response, responses=BYTES)
def model_part(review: ReviewState, object_id: ObjectId, version: VersionName, part: PartName) -> Response:
    """Return a part of the model's mesh, packed."""
    data = model_data(review.version(object_id, version))
    if data is None or part not in data.parts:
        raise NotFoundError(f"{object_id} {version} has no model with {part!r}", "see its facts for the names of parts")
    return Response(data.parts[part].data, media_type="application/octet-stream")
