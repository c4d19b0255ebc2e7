"""A stage is tried again where that can help, and only there."""

from typing import Any

import pytest
from prefect import task

from glint.flows.pipeline.capture import is_store_unreachable, process_capture
from glint.flows.runtime.prefect_server import Server
from glint.storage.errors import InputError, StoreError, StoreUnreachable
from glint.storage.locations.error_translation import translate

pytestmark = pytest.mark.server


@pytest.mark.parametrize(("error", "calls"), [(StoreUnreachable, 2), (StoreError, 1), (InputError, 1)])
def test_only_a_store_that_is_away_is_asked_again(server: Server, error: Any, calls: int) -> None:
    made = []

    @task(retries=1, retry_delay_seconds=0, retry_condition_fn=is_store_unreachable)
    def stage() -> None:
        made.append(1)
        raise error("broken", "mend it")

    with pytest.raises(error):
        stage()
    assert len(made) == calls
    assert process_capture.retry_condition_fn is is_store_unreachable and process_capture.retries


@pytest.mark.parametrize(
    ("text", "away"),
    [
        ("error sending request for url (http://127.0.0.1:1/store)", True),
        ("Server returned non-2xx status code: 503 Service Unavailable", True),
        ("operation timed out", True),
        ("No space left on device (os error 28)", False),
        ("Client error with status 403 Forbidden", False),
        ("404 Not Found: NoSuchBucket", False),
    ],
)
def test_an_unreachable_store_is_distinguished_from_a_broken_one(text: str, away: bool) -> None:
    assert isinstance(translate("s3://store", "reading", OSError(text)), StoreUnreachable) is away
