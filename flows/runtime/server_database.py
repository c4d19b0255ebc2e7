"""The database of Glint's own Prefect server: a damaged one is moved aside, it only holds what the dashboard shows.

Results lie in the store and do not depend on it. What was done is kept as a notice until a command has shown it.
"""

import sqlite3
import time
from contextlib import closing, suppress
from datetime import UTC, datetime
from pathlib import Path

CHECK_SECONDS = 5.0
"""Time that a check may take; a database too large for it counts as whole."""
_FILES = ("", "-wal", "-shm")
_NOTICE = "notice.txt"


def damage(folder: Path, is_up: bool = False) -> str:
    """Return what is wrong with the database in a server's folder, empty if it is whole or cannot be checked now.

    is_up: the server answers, so that its tables must be there.
    """
    path = _database(folder)
    if not path.exists():
        return "it was removed while the server was running" if is_up else ""
    deadline = time.monotonic() + CHECK_SECONDS
    try:
        with closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True, timeout=1.0)) as connection:
            connection.set_progress_handler(lambda: time.monotonic() > deadline, 10_000)
            (result,) = connection.execute("PRAGMA quick_check(1)").fetchone()
            if result != "ok":
                return " ".join(str(result).split())
            if is_up:
                connection.execute("SELECT 1 FROM flow_run LIMIT 1").fetchone()
    except sqlite3.OperationalError as error:
        # Locked, too large to be checked in time, or opened by a user who may only read: no sign of damage.
        return str(error) if any(sign in str(error) for sign in ("malformed", "disk I/O", "no such table")) else ""
    except sqlite3.DatabaseError as error:
        return str(error)
    return ""


def set_damaged_aside(folder: Path, cause: str = "") -> None:
    """Move a damaged database aside and leave a notice; to be called while the server does not run.

    cause: what is wrong, if it is known already.
    """
    cause = cause or damage(folder)
    if not cause:
        return
    path = _database(folder)
    aside = path.with_name(f"{path.name}.damaged-{datetime.now(UTC):%Y%m%dT%H%M%S}")
    for suffix in _FILES:
        with suppress(FileNotFoundError):
            path.with_name(path.name + suffix).rename(aside.with_name(aside.name + suffix))
    notice = f"the dashboard's database was damaged ({cause}): it is now {aside}, and the dashboard begins anew; "
    (folder / _NOTICE).write_text(f"{notice}results are untouched\n", encoding="utf-8")


def take_notice(folder: Path) -> str:
    """Return the notice that no command has shown yet, and remove it; empty if there is none."""
    path = folder / _NOTICE
    try:
        text = path.read_text(encoding="utf-8").strip()
        path.unlink()
    except OSError:
        return ""
    return text


def _database(folder: Path) -> Path:
    return folder / "prefect" / "prefect.db"
