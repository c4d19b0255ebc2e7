"""The interface of the poses view: the poses of all views of an object together, and the run of the whole object."""

from typing import Any

from fastapi import APIRouter

from glint.flows.review.dependencies import ObjectId, ReviewState
from glint.flows.review.review import Review
from glint.flows.review.runs import run_json
from glint.storage.catalogue.models import Pose
from glint.storage.edits.edits import Edits
from glint.storage.errors import DamagedError, NotFoundError

router = APIRouter(prefix="/objects/{object_id}")


@router.get("/poses")
def poses(review: ReviewState, object_id: ObjectId) -> dict[str, Any]:
    """Return the pose of each view as set on the page, else as in the catalogue, and what the last model found.

    `found`: the model's pose and the pixels by which its contour misses the mask; null: the model does not have the
    view; `left_out`: why. `damage`: why a view's edits cannot be read, and what to do; then its pose is not known.
    """
    captures = review.captures(object_id)
    edits = review.edits(object_id)
    registered, left_out = _model(review, object_id)
    views = []
    for name in captures:
        edited, damage = _edited_pose(edits, name)
        given = review.context(object_id, name).capture.pose
        pose = None if damage else edited or given
        views.append(
            {
                "capture": name,
                "pose": None if pose is None else pose.model_dump(mode="json", exclude_none=True),
                "is_edited": edited is not None,
                "found": registered.get(name),
                "left_out": left_out.get(name),
                "damage": damage,
            }
        )
    return {"revision": 0 if edits is None else edits.revision, "views": views}


@router.post("/run", status_code=202)
def start(review: ReviewState, object_id: ObjectId) -> dict[str, Any]:
    """Start the run of all captures of an object, or return the one that is going on."""
    review.captures(object_id)
    return review.runs.start(review.catalogue_of(object_id), object_id).to_json()


@router.get("/run")
def state(review: ReviewState, object_id: ObjectId) -> dict[str, Any] | None:
    """Return the newest run of an object that the page has started; null: none."""
    return run_json(review.runs.of(object_id))


@router.delete("/run", status_code=202)
def stop(review: ReviewState, object_id: ObjectId) -> dict[str, Any] | None:
    """Stop the run of an object that the page has started, which takes seconds; null: none."""
    return run_json(review.runs.stop(object_id))


def _edited_pose(edits: Edits | None, capture_id: str) -> tuple[Pose | None, str]:
    """Return the pose that a person has set of a view, and why what people have set cannot be read."""
    try:
        return None if edits is None else edits.current(capture_id).pose, ""
    except DamagedError as error:
        return None, f"{error.message} → {error.remedy}"


def _model(review: Review, object_id: str) -> tuple[dict[str, Any], dict[str, str]]:
    """Return what the newest model says of its views by name, and why others are not in it."""
    try:
        record = review.stored(object_id).latest.model_record
    except NotFoundError:
        record = None
    if record is None:
        return {}, {}
    names = ("pose", "camera_to_world", "outline_misses_pixels")
    registered = {view["capture"]: {name: view[name] for name in names} for view in record["views"]}
    return registered, {view["name"]: f"{view['reason']}; {view['remedy']}" for view in record["left_out"]}
