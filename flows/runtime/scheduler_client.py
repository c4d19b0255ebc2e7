"""Connecting to a Dask scheduler that somebody else has started, by TLS or without.

Dask's own client waits for ever at a port that accepts connections and says nothing, and names no remedy for missing
certificates. So the scheduler is asked for its identity first, with a time limit.
"""

import asyncio
import socket

from distributed import Client, Security
from distributed.comm.addressing import get_address_host_port
from distributed.core import rpc

from glint.flows.errors import ClusterError

CONNECT_SECONDS = 20.0
"""Patience with a scheduler that does not answer."""

RETRY_SHARE = 0.8
"""Part of the patience in which refused connections are tried again, so that their reason can be named."""

_START = "start it with `dask scheduler`, check the address and its tls:// or tcp://, or leave out --scheduler"
_CERTIFICATES = (
    "name the certificates in DASK_DISTRIBUTED__COMM__TLS__CA_FILE, .._TLS__CLIENT__CERT and .._TLS__CLIENT__KEY"
    " (docs/security.md)"
)


def connected_client(address: str) -> Client:
    """Return a client of the scheduler at an address: tls://host:8786, tcp://host:8786 or host:8786.

    Raises:
        ClusterError: it does not answer within 20 seconds, or not with these certificates.
    """
    try:
        security = Security()  # of Dask's configuration
        connection = security.get_connection_args("client")
    except (OSError, ValueError) as error:  # ssl.SSLError is an OSError
        raise ClusterError(f"the certificates of Dask cannot be read ({error})", _CERTIFICATES) from None
    if address.startswith("tls://") and connection.get("ssl_context") is None:
        raise ClusterError(f"the Dask scheduler at {address} wants certificates, and none are named", _CERTIFICATES)
    try:
        asyncio.run(_ask(address, connection))
        return Client(address, set_as_default=False, timeout=CONNECT_SECONDS, security=security)
    except (OSError, ValueError, TypeError, RuntimeError, MemoryError) as error:  # what is no Dask sends any lengths
        reason = _unreachable(address) or _reason(error)
        remedy = _CERTIFICATES if "SSL" in reason or "certificate" in reason.lower() else _START
        raise ClusterError(f"the Dask scheduler at {address} does not answer ({reason})", remedy) from None


async def _ask(address: str, connection: dict[str, object]) -> None:
    """Ask a scheduler who it is; `connection`: Dask's arguments of a connection.

    Raises:
        OSError, ValueError, TypeError: it does not answer, or is no scheduler.
    """
    async with asyncio.timeout(CONNECT_SECONDS):
        async with rpc(address, connection_args=connection, timeout=RETRY_SHARE * CONNECT_SECONDS) as scheduler:
            identity = await scheduler.identity()
    if identity.get("type") != "Scheduler":
        raise ValueError(f"it is a {identity.get('type')} of Dask")


def _unreachable(address: str) -> str:
    """Return why nothing listens at an address, or an empty text: Dask tries again and forgets why it has to."""
    try:
        with socket.create_connection(get_address_host_port(address), timeout=1):
            return ""
    except TimeoutError:
        return ""
    except (OSError, ValueError) as error:
        return str(error)


def _reason(error: BaseException) -> str:
    """Return the first cause of an error in one line: Dask wraps what happened in a message about its time limit."""
    while error.__cause__ is not None:
        error = error.__cause__
    if isinstance(error, TimeoutError | asyncio.CancelledError):
        return f"no answer within {CONNECT_SECONDS:g} s"
    text = str(error).strip() or type(error).__name__
    return text.splitlines()[0].rpartition("object at ")[2].partition(">: ")[2] or text.splitlines()[0]
