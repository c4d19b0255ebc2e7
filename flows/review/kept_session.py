"""Keep the secret behind the page's cookies in Glint's home, so that bookmarks survive a restart of the server."""

import hmac
import secrets
import time
from contextlib import suppress
from pathlib import Path

from glint.flows.errors import ServerError
from glint.flows.review.access import COOKIE_SECONDS
from glint.flows.runtime.environment import glint_home
from glint.flows.runtime.server_access import private_folder, write_private

SESSION_FOLDER = "review"
SECRET_BYTES = 32
"""Length of the secret: 256 bits cannot be guessed."""


def kept_session(origin: str, password: str | None = None, home: Path | None = None) -> str:
    """Return the value of the cookie for a page at an address; a new one where nothing can be kept.

    It changes with the password, with the address, and when the kept secret is removed or older than COOKIE_SECONDS.

    home: Glint's home, None: that of this user.
    """
    secret = _kept_secret(home or glint_home())
    return hmac.new(secret, f"{origin}\n{password or ''}".encode(), "sha256").hexdigest()


def _kept_secret(home: Path) -> bytes:
    path = home / SESSION_FOLDER / "session"
    try:
        private_folder(path.parent, home)
        if path.is_file() and time.time() - path.stat().st_mtime < COOKIE_SECONDS:
            with suppress(ValueError):
                kept = bytes.fromhex(path.read_text())
                if len(kept) == SECRET_BYTES:
                    return kept
        write_private(path, secrets.token_hex(SECRET_BYTES))
        return bytes.fromhex(path.read_text())
    except (OSError, ServerError):
        return secrets.token_bytes(SECRET_BYTES)
