"""The interface of the versions view: the list, two of them compared, rollback."""

from typing import Annotated, Any

from fastapi import APIRouter, Response
from pydantic import BaseModel, ConfigDict, StringConstraints

from glint.flows.review.dependencies import CaptureId, ObjectId, ReviewState
from glint.flows.review.surface_api import BYTES, PartName, VersionName
from glint.storage.errors import NotFoundError
from glint.tasks.review.version_pair import version_pair

router = APIRouter(prefix="/objects/{object_id}")


class Rollback(BaseModel):
    """The version whose content becomes the newest."""

    model_config = ConfigDict(extra="forbid")
    version: Annotated[str, StringConstraints(pattern=r"^v[1-9][0-9]{0,8}$")]


@router.get("/versions")
def versions(review: ReviewState, object_id: ObjectId) -> list[dict[str, Any]]:
    """Return the versions, newest first: name, time, message, captures, and the run that made it.

    edits: of each capture, by field, the author of what a person has edited and the version was made with.
    """
    if review.repository(object_id) is None:
        # Nothing has run yet; this refuses an object that the catalogue does not list either.
        review.captures(object_id)
        return []
    item = review.stored(object_id)
    return [
        {
            "name": name,
            "time": item[name].time.isoformat(timespec="seconds"),
            "message": item[name].message,
            "captures": list(item[name]),
            "run": item[name].metadata.get("run"),
            "edits": {
                capture: {
                    field: change["author"] for field, change in recorded.get("edits", {}).get("changes", {}).items()
                }
                for capture, recorded in item[name].metadata.get("captures", {}).items()
            },
        }
        for name in reversed(item.versions)
    ]


@router.get("/differences/{before}/{after}/{capture_id}")
def difference(
    review: ReviewState, object_id: ObjectId, before: VersionName, after: VersionName, capture_id: CaptureId
) -> dict[str, Any]:
    """Return what differs between two versions of a capture, in figures and words."""
    return version_pair(capture_id, review.version(object_id, before), review.version(object_id, after)).facts


@router.get("/differences/{before}/{after}/{capture_id}/{part}", response_class=Response, responses=BYTES)
def difference_part(
    review: ReviewState,
    object_id: ObjectId,
    before: VersionName,
    after: VersionName,
    capture_id: CaptureId,
    part: PartName,
) -> Response:
    """Return a part of the comparison, packed: normals of both on a common region, the angles between."""
    data = version_pair(capture_id, review.version(object_id, before), review.version(object_id, after))
    if part not in data.parts:
        raise NotFoundError(
            f"the comparison of {before} and {after} has no {part!r}", "see its facts for the names of parts"
        )
    return Response(data.parts[part].data, media_type="application/octet-stream")


@router.post("/rollback")
def rollback(review: ReviewState, object_id: ObjectId, request: Rollback) -> dict[str, Any]:
    """Publish the content of an old version as the newest one; all versions are kept."""
    newest = review.version(object_id, request.version).repository.rollback(request.version)
    return {"version": newest.name, "created": newest.created}
