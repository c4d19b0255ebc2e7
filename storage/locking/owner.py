"""Who works on an object."""

import json
import os
import socket
from dataclasses import asdict, dataclass
from datetime import UTC, datetime

from glint.storage.errors import StoreError


@dataclass(frozen=True, slots=True)
class Holder:
    """A run at work: process, machine, since when (ISO 8601, UTC) and the run's name."""

    pid: int
    host: str
    since: str
    run: str = ""

    @classmethod
    def this_process(cls, run: str) -> "Holder":
        """This process, from now on."""
        return cls(os.getpid(), socket.gethostname(), datetime.now(UTC).isoformat(timespec="microseconds"), run)

    @classmethod
    def read(cls, data: bytes) -> "Holder | None":
        """What `as_bytes` wrote, None for anything else."""
        try:
            return cls(**json.loads(data))
        except (ValueError, TypeError):
            return None

    def as_bytes(self) -> bytes:
        """JSON."""
        return json.dumps(asdict(self)).encode()

    def is_dead(self) -> bool:
        """Whether it certainly runs no more: it ran on this machine and its process is gone."""
        if self.host != socket.gethostname():
            return False
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return True
        except PermissionError:
            return False
        return False

    def __str__(self) -> str:
        """In words, for a message."""
        since = self.since.split(".")[0].replace("T", " ")
        return f"process {self.pid} on {self.host} since {since} UTC" + (f", run {self.run}" if self.run else "")


class ObjectBusy(StoreError):
    """Another run works on the object."""

    @classmethod
    def by(cls, object_id: str, holder: Holder | None) -> "ObjectBusy":
        """The error that names who it is."""
        who = holder or "another process"
        return cls(f"object {object_id} is being worked on by {who}", "wait for that run to end, or stop it")
