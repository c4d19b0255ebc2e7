"""Loopback ports for servers that take long to start."""

import socket
import sys

from glint.flows.errors import ServerError

FIRST_PORT = 4200


def free_port() -> tuple[int, socket.socket]:
    """The first free loopback port from 4200, any free one if the next hundred are taken; and a claim to it.

    A server takes many seconds until it listens: the claim, which it inherits, keeps others that start meanwhile off.
    """
    for port in [*range(FIRST_PORT, FIRST_PORT + 100), 0]:
        with socket.socket() as candidate:
            candidate.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                candidate.bind(("127.0.0.1", port))
            except OSError:
                continue
            found = int(candidate.getsockname()[1])
        claim = claim_port(found)
        if claim is not None:
            return found, claim
    raise ServerError("no loopback port is free", "set PREFECT_API_URL to a server of yours")


def claim_port(port: int) -> socket.socket | None:
    """What keeps other servers of Glint off this port as long as it is open; None if one of them has it."""
    claim = socket.socket(socket.AF_UNIX)
    try:
        if sys.platform == "linux":
            claim.bind(f"\0glint-port-{port}")
    except OSError:
        claim.close()
        return None
    return claim
