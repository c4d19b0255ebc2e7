"""The review page's server: the routers of its views, behind the guard.

Views are modules with a router each. State is `request.app.state.review` (`Review`); `review_of` is the dependency.
"""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse
from fastapi.staticfiles import StaticFiles
from pydantic import BaseModel
from starlette.exceptions import HTTPException
from starlette.responses import Response

from glint.flows.errors import message_and_remedy
from glint.flows.review import (
    edits_api,
    inputs_api,
    listing_api,
    poses_api,
    questions_api,
    runs_api,
    surface_api,
    versions_api,
)
from glint.flows.review.access import ENTRY_PATH, Access, Guard, refusal
from glint.flows.review.remedies import on_page
from glint.flows.review.review import Review
from glint.storage.catalogue.messages import fault_of, own_words
from glint.storage.errors import GlintError, NotFoundError, StoreUnreachable
from glint.storage.export.page.bundle import VIEWER
from glint.tasks.engine.errors import UnusableCapture

STATIC = Path(__file__).parent / "static"

APIS = (
    listing_api,
    inputs_api,
    questions_api,
    edits_api,
    poses_api,
    runs_api,
    surface_api,
    versions_api,
)
"""The interfaces of the views, all below /api/."""


class Refusal(BaseModel):
    """The answer to a request that cannot be met: the error and its remedy."""

    error: str
    remedy: str


REFUSALS: dict[int | str, dict[str, Any]] = {
    400: {"model": Refusal, "description": "another host, or no request that can be read"},
    404: {"model": Refusal, "description": "no such object, capture, version or part"},
    413: {"model": Refusal, "description": "the request is too long"},
    422: {"model": Refusal, "description": "not what this description allows, or unusable input"},
    503: {"model": Refusal, "description": "the store does not answer"},
}
"""Answers that every operation can give besides its own."""


def create_app(
    store: str, catalogue: str | None = None, access: Access | None = None, scheduler: str | None = None
) -> FastAPI:
    """Return the server of a store's page.

    store: its address, which need not exist yet; catalogue: the YAML file whose captures are shown and run, None: what
    the store has. access: who may use it; None: nobody, since the token is unknown.
    scheduler: address of the Dask scheduler that runs use; None: a local cluster for each.
    """
    review = Review(store, catalogue, scheduler)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        review.start()
        try:
            yield
        finally:
            review.stop()

    app = FastAPI(
        title="Glint review", openapi_url="/api/openapi.json", docs_url=None, redoc_url=None, lifespan=lifespan
    )
    app.state.review = review
    for api in APIS:
        app.include_router(api.router, prefix="/api", responses=REFUSALS)
    app.mount("/static/viewer", StaticFiles(directory=VIEWER), name="viewer")
    app.mount("/static", StaticFiles(directory=STATIC), name="static")

    @app.get("/", include_in_schema=False)
    def page() -> FileResponse:
        return FileResponse(STATIC / "index.html")

    @app.get(ENTRY_PATH, include_in_schema=False)
    def opening_page() -> FileResponse:
        return FileResponse(STATIC / "open.html")

    _answer_errors(app)
    app.add_middleware(Guard, access=access or Access(("http://127.0.0.1:0",)))
    return app


def _answer_errors(app: FastAPI) -> None:
    """Answer errors with what is wrong and what to do about it."""

    @app.exception_handler(NotFoundError)
    def absent(_: Request, error: Exception) -> Response:
        return refusal(404, *message_and_remedy(error))

    @app.exception_handler(StoreUnreachable)
    def unreachable(_: Request, error: Exception) -> Response:
        return refusal(503, *message_and_remedy(error))

    @app.exception_handler(GlintError)
    @app.exception_handler(UnusableCapture)
    def unusable(_: Request, error: Exception) -> Response:
        message, remedy = message_and_remedy(error)
        return refusal(422, message, on_page(remedy))

    @app.exception_handler(HTTPException)
    def refused(_: Request, error: HTTPException) -> Response:
        answer = refusal(error.status_code, error.detail, "send what /api/openapi.json describes")
        answer.headers.update(error.headers or {})
        return answer

    @app.exception_handler(RequestValidationError)
    def malformed(_: Request, error: RequestValidationError) -> Response:
        first = error.errors()[0]
        if words := own_words(first):
            return refusal(422, *words)
        place = ".".join(str(part) for part in first["loc"])
        fault = first["msg"] if first["type"] in ("missing", "json_invalid") else fault_of(first)
        return refusal(422, f"{place}: {fault}", "send what /api/openapi.json describes")
