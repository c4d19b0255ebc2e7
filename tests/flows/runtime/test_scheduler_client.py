"""A scheduler that cannot be used is reported within 30 seconds, with its address and a remedy."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import dask
import pytest
from distributed import Security

from glint.flows.errors import ClusterError
from glint.flows.runtime import scheduler_client
from glint.flows.runtime.dask_cluster import Cluster
from glint.flows.runtime.scheduler_client import connected_client
from tests.flows.runtime.dask_certificates import certificates, settings
from tests.polling import PATIENCE

pytestmark = pytest.mark.server


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scheduler_client, "CONNECT_SECONDS", 2.0)


@contextmanager
def listener(answer: Callable[[socket.socket], object]) -> Iterator[str]:
    """A port that answers every connection in this way."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            while True:
                try:
                    connection, _ = server.accept()
                except OSError:
                    return
                open_connections.append(connection)
                answer(connection)

        open_connections: list[socket.socket] = []
        threading.Thread(target=serve, daemon=True).start()
        yield f"127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)


def test_the_limits_together_are_30_seconds() -> None:
    assert scheduler_client.CONNECT_SECONDS <= 30


@pytest.mark.parametrize(
    ("address", "reason"),
    [
        ("tcp://127.0.0.1:9", "refused"),
        ("127.0.0.1:9", "refused"),
        ("nonsense://x", "unknown address scheme"),
        ("tcp://127.0.0.1:port", "port"),
        ("tcp://no-such-host.invalid:8786", ""),
    ],
)
@pytest.mark.usefixtures("impatient")
def test_a_wrong_address_is_refused(address: str, reason: str) -> None:
    with pytest.raises(ClusterError, match=rf"{address} does not answer \(.*{reason}.*--scheduler"):
        connected_client(address)


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("scheme", ["tcp", "tls"])
def test_a_silent_port_is_given_up(scheme: str) -> None:
    begin = time.monotonic()
    with (
        listener(lambda connection: None) as address,
        dask.config.set(settings(Security.temporary())),
        pytest.raises(ClusterError, match=r"no answer within 2 s"),
    ):
        connected_client(f"{scheme}://{address}")
    assert time.monotonic() - begin < 60


@pytest.mark.usefixtures("impatient")
def test_what_is_no_scheduler_is_refused() -> None:
    with (
        listener(lambda connection: connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")) as address,
        pytest.raises(ClusterError, match=r"does not answer"),
    ):
        connected_client(f"tcp://{address}")


def test_a_scheduler_with_tls_wants_its_own_certificates(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scheduler_client, "CONNECT_SECONDS", 4.0)
    with pytest.raises(ClusterError, match=r"wants certificates.*TLS__CLIENT__CERT"):
        connected_client(cluster.address)
    with dask.config.set(settings(Security.temporary())), pytest.raises(ClusterError, match=r"SSL.*TLS__CA_FILE"):
        connected_client(cluster.address)
    missing = settings(cluster.client.security) | {"distributed.comm.tls.ca-file": "/absent/ca.pem"}
    with dask.config.set(missing), pytest.raises(ClusterError, match=r"cannot be read.*TLS__CA_FILE"):
        connected_client(cluster.address)
    with pytest.raises(ClusterError, match=r"does not answer.*tls://"):
        connected_client(cluster.address.replace("tls://", "tcp://"))
    monkeypatch.undo()
    with certificates(cluster):
        client = connected_client(cluster.address)
        assert client.submit(abs, -3).result(timeout=PATIENCE) == 3
        client.close()
