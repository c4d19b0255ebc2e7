"""Dependencies that the page's routers share: the server's state, and ids that can be a part of a path in the store."""

from typing import Annotated

from fastapi import Depends, Path, Request

from glint.flows.review.review import Review
from glint.storage.catalogue.models import ID


def review_of(request: Request) -> Review:
    """Return the state of the server that answers a request."""
    review: Review = request.app.state.review
    return review


ReviewState = Annotated[Review, Depends(review_of)]
ObjectId = Annotated[str, Path(pattern=rf"^{ID.pattern}$")]
CaptureId = Annotated[str, Path(pattern=rf"^{ID.pattern}$")]
