"""The run context: found by whatever a run calls, cancelled as a whole."""

import contextvars
import threading
import time
from collections.abc import Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from pathlib import Path

import pytest
from distributed import Client

from glint.flows.pipeline.context import RunContext, activate, run_context
from glint.flows.pipeline.object import submit
from glint.flows.pipeline.prefect_sink import PrefectSink
from glint.flows.reporting.events import Message
from glint.flows.runtime.dask_cluster import Cluster
from tests.flows.pipeline.sent_to_workers import exists_at_last
from tests.flows.recording_sink import RecordingSink
from tests.polling import PATIENCE

pytestmark = pytest.mark.server


@pytest.fixture
def context(cluster: Cluster) -> Iterator[RunContext]:
    """A context with a client of its own, which may be cancelled."""
    client = Client(cluster.address, security=cluster.client.security, set_as_default=False)
    yield RunContext(client, PrefectSink())
    client.close()


def test_a_run_and_its_threads_find_the_context_and_others_do_not(cluster: Cluster) -> None:
    sink = RecordingSink()
    with activate(cluster.client, sink) as context, ThreadPoolExecutor(1) as pool:
        assert run_context() is context and context.client is cluster.client
        assert submit(pool, run_context).result() is context
        with pytest.raises(LookupError):
            pool.submit(run_context).result()
        assert context.max_captures == 3
        context.emit(Message("dashboard here"))
    with pytest.raises(LookupError):
        run_context()
    assert sink.events == [Message("dashboard here")]


def test_contexts_nest(cluster: Cluster) -> None:
    with activate(cluster.client) as outer:
        with activate(cluster.client) as inner:
            assert run_context() is inner
            assert contextvars.copy_context().run(run_context) is inner
        assert run_context() is outer


def test_a_capture_with_a_slot_is_active(context: RunContext) -> None:
    with context.slot("a/front"), context.slot("b/front"):
        assert context.active == {"a/front", "b/front"}
        assert not context.slots.acquire(blocking=False)
    assert not context.active


def test_what_waits_for_a_worker_fails_when_the_run_is_cancelled(context: RunContext, tmp_path: Path) -> None:
    context.raise_if_cancelled()
    raised: list[BaseException] = []
    future = context.client.submit(exists_at_last, str(tmp_path / "released"), pure=False)

    def wait() -> None:
        try:
            future.result()
        except BaseException as error:
            raised.append(error)

    waiting = threading.Thread(target=wait)
    waiting.start()
    time.sleep(0.5)
    context.cancel()
    waiting.join(PATIENCE)
    # What runs on a worker already runs on; the next tests need the worker.
    (tmp_path / "released").touch()
    assert not waiting.is_alive()
    assert isinstance(raised[0], CancelledError)
    with pytest.raises(CancelledError):
        context.raise_if_cancelled()


def test_errors_of_a_cancelled_run_are_reported_as_interrupted(context: RunContext) -> None:
    with pytest.raises(OSError, match="a reason of its own"), context.cancellable():
        raise OSError("a reason of its own")
    context.cancel()
    with pytest.raises(CancelledError, match="interrupted"), context.cancellable():
        raise OSError("Client is closed")
