"""Translate errors of the file system, obstore and icechunk to `StoreError` with a remedy."""

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
        "there is a file in place of a folder: move it or name another store",
    ),
    (
        ("statuscode(403)", "access denied", "accessdenied", "forbidden", "credential", "signature"),
        "check the credentials in the environment or profile",
    ),
)
"""Parts of an error's text, in lower case, and the remedy."""

UNREACHABLE_HINTS = (
    "connect",
    "timed out",
    "timeout",
    "dns error",
    "failed to lookup address",
    "error sending request",
    "500 internal",
    "502 bad",
    "503 s",
    "504 gateway",
)
"""Parts of an error's text, in lower case, if the store does not answer; longer than a part of a random name may be."""

UNKNOWN_CAUSE_REMEDY = "check that the store is reachable and undamaged"
"""The remedy for an error whose text says neither what is in the way nor that the store does not answer."""


@contextmanager
def store_errors(uri: str, action: str) -> Iterator[None]:
    """Raise errors of the file system, obstore and icechunk as StoreError that names the action that failed.

    Conflicts between writers pass unchanged, for the caller to try again.
    """
    try:
        yield
    except icechunk.ConflictError:
        raise
    except (OSError, icechunk.IcechunkError, obstore.exceptions.BaseError) as error:
        raise translate(uri, action, error) from error


def translate(uri: str, action: str, error: BaseException) -> StoreError:
    """Return the StoreError for an error of `action` (such as "reading an input") at `uri`."""
    text = " ".join(str(error).partition("Debug source:")[0].split())
    message = f"{action} failed at {uri} ({text[:300]})"
    remedy = next((remedy for hints, remedy in REMEDIES if any(hint in text.lower() for hint in hints)), None)
    if remedy is None and any(hint in text.lower() for hint in UNREACHABLE_HINTS):
        return StoreUnreachable(message, "check the address and that the server is up, then run again")
    return StoreError(message, remedy or UNKNOWN_CAUSE_REMEDY)
