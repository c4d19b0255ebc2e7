"""The interface of runs: start the ordinary run of one capture, see how far it is, and stop it."""

from typing import Any

from fastapi import APIRouter

from glint.flows.review.dependencies import CaptureId, ObjectId, ReviewState
from glint.flows.review.runs import run_json

router = APIRouter()


@router.post("/captures/{object_id}/{capture_id}/run", status_code=202)
def start(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> dict[str, Any]:
    """Start the run of a capture, or return the one that is going on."""
    review.context(object_id, capture_id)
    return review.runs.start(review.catalogue_of(object_id), f"{object_id}/{capture_id}").to_json()


@router.get("/captures/{object_id}/{capture_id}/run")
def state(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> dict[str, Any] | None:
    """Return the newest run of a capture that the page has started; null: none."""
    return run_json(review.runs.of(f"{object_id}/{capture_id}"))


@router.delete("/captures/{object_id}/{capture_id}/run", status_code=202)
def stop(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> dict[str, Any] | None:
    """Stop the run of a capture that the page has started, which takes seconds; null: none."""
    return run_json(review.runs.stop(f"{object_id}/{capture_id}"))
