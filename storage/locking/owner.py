"""The owner of a lock: the run that works on an object."""

import json
import os
import socket
from dataclasses import asdict, dataclass
from datetime import UTC, datetime

from glint.storage.errors import StoreError


@dataclass(frozen=True, slots=True)
class LockOwner:
    """A running process: its id, machine, start of ownership (ISO 8601, UTC) and the run's name."""

    pid: int
    host: str
    since: str
    run: str = ""

    @classmethod
    def this_process(cls, run: str) -> "LockOwner":
        """Return this process as an owner."""
        return cls(os.getpid(), socket.gethostname(), datetime.now(UTC).isoformat(timespec="microseconds"), run)

    @classmethod
    def from_bytes(cls, data: bytes) -> "LockOwner | None":
        """Parse the result of `as_bytes`; None if it is anything else."""
        try:
            owner = cls(**json.loads(data))
        except (ValueError, TypeError):
            return None
        is_text = all(isinstance(text, str) for text in (owner.host, owner.since, owner.run))
        return owner if is_text and type(owner.pid) is int and 0 < owner.pid < 2**31 else None

    def as_bytes(self) -> bytes:
        """Return the owner as JSON."""
        return json.dumps(asdict(self)).encode()

    def is_dead(self) -> bool:
        """Return whether the owner ran on this machine and its process has ended; False if this cannot be known."""
        if self.host != socket.gethostname():
            return False
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return True
        except PermissionError:
            # It runs, under another user.
            return False
        return False

    def __str__(self) -> str:
        """Return a description for messages."""
        since = self.since.split(".")[0].replace("T", " ")
        return f"process {self.pid} on {self.host} since {since} UTC" + (f", run {self.run}" if self.run else "")


class ObjectBusy(StoreError):
    """Another run works on the object."""

    @classmethod
    def owned_by(cls, object_id: str, owner: LockOwner | None) -> "ObjectBusy":
        """Return the error that names the owner of the object's lock."""
        return cls(
            f"object {object_id} is being worked on by {owner or 'another process'}",
            "wait for that run to end, or stop it",
        )
