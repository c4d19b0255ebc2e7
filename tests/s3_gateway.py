"""A real S3 server for tests: deploy/gateway/start.sh on loopback, with keys and buckets of its own."""

import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from uuid import uuid4

SCRIPT = Path(__file__).parents[1] / "deploy" / "gateway" / "start.sh"
PROGRAMS = ("ceph", "ceph-authtool", "ceph-mon", "ceph-osd", "curl", "monmaptool", "radosgw", "radosgw-admin")


def missing() -> list[str]:
    """Programs of the gateway that are not installed (Debian: ceph-mon ceph-osd ceph-common radosgw curl)."""
    return [name for name in PROGRAMS if shutil.which(name) is None]


def free_port() -> int:
    with socket.socket() as candidate:
        candidate.bind(("127.0.0.1", 0))
        return int(candidate.getsockname()[1])


class Gateway:
    """The server; a context manager that starts and stops it.

    What it stores stays in `folder` (a short path: sockets lie there), also when it is killed and started again.
    """

    def __init__(self, folder: Path, buckets: Sequence[str] = ("store",), port: int | None = None) -> None:
        self.folder, self.port = folder, port or free_port()
        self.secret = f"secret{uuid4().hex}"
        self.environment = {
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{self.port}",
            "AWS_ACCESS_KEY_ID": f"key{uuid4().hex[:12]}",
            "AWS_SECRET_ACCESS_KEY": self.secret,
            "AWS_REGION": "us-east-1",
        }
        self._settings = {
            "GATEWAY_FOLDER": str(folder),
            "GATEWAY_PORT": str(self.port),
            "GATEWAY_MONITOR_PORT": str(free_port()),
            "GATEWAY_BUCKETS": " ".join(buckets),
        }
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> "Gateway":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(self) -> None:
        """Start it and wait until it takes requests and has its buckets."""
        self.folder.mkdir(parents=True, exist_ok=True)
        out = self.folder / "start.out"
        with out.open("w") as stream:
            self._process = subprocess.Popen(
                [str(SCRIPT)],
                env=os.environ | self.environment | self._settings,
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=stream,
                text=True,
                start_new_session=True,
            )
        deadline = time.monotonic() + 90
        while "gateway: http" not in out.read_text(errors="replace"):
            if self._process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError(f"the S3 gateway does not run: {out.read_text(errors='replace')[-2000:]}")
            time.sleep(0.05)

    def stop(self) -> None:
        """End it in good order."""
        self._end(signal.SIGTERM)

    def kill(self) -> None:
        """End all its processes at once, as a power cut would."""
        self._end(signal.SIGKILL)

    def _end(self, number: int) -> None:
        process, self._process = self._process, None
        if process is None or process.poll() is not None:
            return
        if number == signal.SIGKILL:
            os.killpg(process.pid, number)
        else:
            process.send_signal(number)
        process.wait(60)
