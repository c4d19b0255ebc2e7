"""Who may use Glint's own Prefect server: its folder, its password, and links that open its pages.

The password is made with the server, and lies in the server's folder, which only its owner can read. Clients take it
from their environment; a browser gets it in exchange for the token of a link, which can be used once.
"""

import json
import os
import secrets
from base64 import b64encode
from contextlib import suppress
from pathlib import Path

import certifi
from itsdangerous import BadSignature, TimestampSigner

from glint.flows.errors import ServerError

LINK_SECONDS = 12 * 3600
"""Time for which a link can be opened, in seconds: a link that a run prints at its start is still good at its end."""

OPENING_PATH = "/glint/"
"""Path of the page that exchanges a link's token for the password, and goes on to the page named after it."""

USER = "glint"
"""User name in front of the generated password, as in HTTP's basic authentication."""

_SALT = "glint-link"
_LAST_LINE = "-----END CERTIFICATE-----\n"


def private_folder(folder: Path, home: Path) -> None:
    """Create a folder inside `home`, and `home` too, that only its owner can enter.

    Raises:
        ServerError: it cannot be written, or belongs to another user, who could read the password.
    """
    try:
        for part in (*reversed([parent for parent in folder.parents if parent.is_relative_to(home)]), folder):
            part.mkdir(parents=True, exist_ok=True, mode=0o700)
        owner = folder.stat().st_uid
        if owner != os.getuid():
            raise ServerError(f"{folder} belongs to user {owner}", "set GLINT_HOME to a folder of yours")
        folder.chmod(0o700)
    except OSError as error:
        raise ServerError(
            f"{folder} cannot be written ({error.strerror})", "set GLINT_HOME to a folder of yours"
        ) from None


def write_private(path: Path, text: str) -> None:
    """Write a file that only its owner can read, at once or not at all."""
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    draft.unlink(missing_ok=True)
    with os.fdopen(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
        file.write(text)
    draft.replace(path)


def certificate_file(folder: Path) -> Path:
    """Return a file of one certificate in a server's folder.

    Each client of Prefect reads a file of certificates, also for a server without TLS. All those that certifi trusts
    take 37 ms of processor.
    """
    path = folder / "certificate.pem"
    if not path.exists():
        first, end, _ = Path(certifi.where()).read_text(encoding="ascii", errors="ignore").partition(_LAST_LINE)
        write_private(path, first + end)
    return path


def new_authentication() -> str:
    """Return user:password of a new server: the one that the user has set, else a random one."""
    return os.environ.get("PREFECT_SERVER_API_AUTH_STRING") or f"{USER}:{secrets.token_urlsafe(32)}"


def header_value(authentication: str) -> str:
    """Return user:password as HTTP's basic authentication, and Prefect's pages, encode it."""
    return b64encode(authentication.encode()).decode()


def link(ui_url: str, authentication: str, page: str = "") -> str:
    """Return an address that opens a page of the server once, without a password.

    The token is in the fragment, which browsers do not send: it is in no log of the server.
    """
    token = TimestampSigner(authentication, salt=_SALT).sign(secrets.token_urlsafe(9)).decode()
    return f"{ui_url}{OPENING_PATH}{page}#{token}"


class Tokens:
    """The tokens of links that a server accepts: signed with its password, young enough, and not used before.

    record: file of the used ones, which a server that is started again with the same password reads; None: no file.
    """

    def __init__(self, authentication: str, record: Path | None = None) -> None:
        self._signer, self._record = TimestampSigner(authentication, salt=_SALT), record
        self._used: dict[str, float] = {}
        with suppress(OSError, ValueError, AttributeError):
            self._used = dict(json.loads(record.read_text()) if record else {})

    def use(self, token: str, now: float) -> bool:
        """Return whether a token is good, and remember it as used; `now`: seconds, of any clock."""
        try:
            name = self._signer.unsign(token, max_age=LINK_SECONDS).decode()
        except (BadSignature, UnicodeError):
            return False
        self._used = {known: moment for known, moment in self._used.items() if now - moment <= LINK_SECONDS}
        if name in self._used:
            return False
        self._used[name] = now
        if self._record is not None:
            # Where nothing can be written, a used link is known until the server ends.
            with suppress(OSError, ServerError):
                write_private(self._record, json.dumps(self._used))
        return True
