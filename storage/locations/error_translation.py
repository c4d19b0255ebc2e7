"""Failures of the store's libraries, told as `StoreError` with the remedy."""

from collections.abc import Iterator
from contextlib import contextmanager

import icechunk
import obstore.exceptions

from glint.storage.errors import StoreError, StoreUnreachable

REMEDIES = (
    (
        ("no space left", "file too large", "quota", "os error 28", "os error 27"),
        "free space there or name another store with --store",
    ),
    (
        ("permission denied", "read-only", "operation not permitted", "os error 13", "os error 30"),
        "give this user the right to write there or name another store with --store",
    ),
    (
        ("not a directory", "file exists", "os error 20"),
        "a file stands where a folder must be: move it or name another store",
    ),
    (
        ("403", "access denied", "forbidden", "credential", "signature"),
        "check the credentials in the environment or profile",
    ),
)
"""What a failure's text says, in lower case, and what to do about it."""

AWAY = (
    "connect",
    "timed out",
    "timeout",
    "dns",
    "error sending request",
    "500 internal",
    "502 bad",
    "503 s",
    "504 gateway",
)
"""What a failure's text says when the store does not answer."""


@contextmanager
def store_faults(uri: str, doing: str) -> Iterator[None]:
    """Turn whatever the file system, obstore or icechunk raise inside into a StoreError that says what was being done.

    Conflicts between writers pass through, for the caller to try again.
    """
    try:
        yield
    except icechunk.ConflictError:
        raise
    except (OSError, icechunk.IcechunkError, obstore.exceptions.BaseError) as error:
        raise fault(uri, doing, error) from error


def fault(uri: str, doing: str, error: BaseException) -> StoreError:
    """The StoreError for what went wrong while `doing` something at `uri`."""
    text = " ".join(str(error).split())
    message = f"{doing} failed at {uri} ({text[:300]})"
    remedy = next((remedy for signs, remedy in REMEDIES if any(sign in text.lower() for sign in signs)), None)
    if remedy is None and any(sign in text.lower() for sign in AWAY):
        return StoreUnreachable(message, "check the address and that the server is up, then run again")
    return StoreError(message, remedy or "check that the store is reachable and whole")
