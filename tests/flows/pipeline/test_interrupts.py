"""An interrupt in the main thread cancels the run, wherever its flow is."""

import signal
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from distributed import Client

from glint.flows.pipeline import catalogue as catalogue_flow
from glint.flows.pipeline.catalogue import run_whole_catalogue
from glint.flows.pipeline.context import RunContext, activate
from glint.flows.pipeline.object import run_object
from glint.flows.runtime.dask_cluster import Cluster
from glint.storage.catalogue.loading import load, write
from tests.polling import until

pytestmark = [pytest.mark.server, pytest.mark.usefixtures("server")]


@pytest.fixture(autouse=True)
def interruptible() -> Iterator[None]:
    """SIGINT as a terminal's program has it; a shell's background program ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def context(cluster: Cluster) -> Iterator[RunContext]:
    """An active context with a client of its own, which may be cancelled."""
    client = Client(cluster.address, security=cluster.client.security, set_as_default=False)
    with activate(client) as active:
        yield active
    client.close()


def interrupt_once_busy(context: RunContext) -> None:
    """Interrupt the main thread as soon as a capture is in progress."""
    main = threading.main_thread().ident
    assert main is not None

    def wait() -> None:
        until(lambda: context.active)
        signal.pthread_kill(main, signal.SIGINT)

    threading.Thread(target=wait, daemon=True).start()


def test_a_run_that_still_submits_its_objects_is_cancelled(
    context: RunContext, tiny: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(catalogue_flow, "STAGGER_SECONDS", 60.0)
    loaded = load(tiny)
    objects = tuple(loaded.objects[0].model_copy(update={"id": name}) for name in ("a", "b"))
    write(loaded.model_copy(update={"objects": objects}), tmp_path / "two.yaml")
    interrupt_once_busy(context)
    with pytest.raises(KeyboardInterrupt):
        run_whole_catalogue(str(tmp_path / "two.yaml"), str(tmp_path / "store"))
    assert context.cancelled.is_set() and context.client.status == "closed"


def test_an_object_in_the_main_thread_is_cancelled(context: RunContext, tiny: Path, tmp_path: Path) -> None:
    interrupt_once_busy(context)
    with pytest.raises(KeyboardInterrupt):
        run_object(str(tiny), "hemisphere", str(tmp_path / "store"), return_state=True)
    assert context.cancelled.is_set() and context.client.status == "closed"
