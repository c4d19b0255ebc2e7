"""The interface of the catalogue view."""

from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Response

from glint.flows.review.dependencies import CaptureId, ObjectId, ReviewState
from glint.flows.review.listing import MAX_PAGE
from glint.storage.errors import NotFoundError

router = APIRouter()

State = Literal["failed", "doubtful", "running", "waiting", "warnings", "done", "new", "reading"]


@router.get("/captures")
def captures(
    review: ReviewState,
    search: Annotated[str, Query(max_length=200)] = "",
    state: Annotated[list[State], Query()] = [],  # noqa: B006
    sort: Literal["attention", "name", "date", "confident"] = "attention",
    offset: Annotated[int, Query(ge=0, le=10_000_000)] = 0,
    limit: Annotated[int, Query(ge=1, le=MAX_PAGE)] = 100,
    revision: int | None = None,
) -> Any:
    """Return a part of the rows; 204 where nothing has changed since `revision`."""
    if revision is not None and revision == review.listing.revision:
        return Response(status_code=204)
    view = review.listing.view(search, state, sort, offset, limit)
    return {
        "store": review.store,
        "catalogue": review.catalogue,
        "rows": [row.to_json() for row in view.rows],
        "total": view.total,
        "counts": view.counts,
        "revision": view.revision,
        "complete": view.complete,
        "problem": view.problem,
    }


@router.get("/captures/{object_id}/{capture_id}")
def capture(review: ReviewState, object_id: ObjectId, capture_id: CaptureId) -> dict[str, Any]:
    """Return the row of one capture."""
    row = review.listing.row(object_id, capture_id)
    if row is None:
        raise NotFoundError(f"no capture {object_id}/{capture_id}", "see the catalogue view")
    return row.to_json()
