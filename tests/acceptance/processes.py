"""The services of a production set-up as processes on loopback, each with its log in a folder."""

import os
import shutil
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from tests.polling import PATIENCE
from tests.s3_gateway import free_port


class Services:
    """Processes that are started one by one and all ended at the end; a context manager."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._open = folder, ExitStack()
        self.processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> "Services":
        return self

    def __exit__(self, *_: object) -> None:
        for name in reversed(list(self.processes)):
            self.end(name)
        self._open.close()

    def start(
        self, name: str, command: Sequence[str], environment: Mapping[str, str], ready: Callable[[], bool]
    ) -> None:
        """Start a service and wait until it is ready."""
        log = self._open.enter_context((self.folder / f"{name}.log").open("ab"))
        self.processes[name] = subprocess.Popen(
            command, env=os.environ | environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log, cwd=self.folder
        )
        deadline = time.monotonic() + PATIENCE
        while not ready():
            if self.processes[name].poll() is not None or time.monotonic() > deadline:
                raise RuntimeError(f"{name} does not run: {self.log(name)[-2000:]}")
            time.sleep(0.1)

    def end(self, name: str) -> None:
        """End a service in good order."""
        process = self.processes.pop(name)
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(30)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def log(self, name: str) -> str:
        """What a service has said."""
        return (self.folder / f"{name}.log").read_text(errors="replace")


def answers(url: str) -> bool:
    """Whether an address answers well."""
    try:
        with urllib.request.urlopen(url, timeout=2) as answer:
            return bool(answer.status == 200)
    except (OSError, urllib.error.URLError):
        return False


def python(*arguments: str) -> list[str]:
    """A module of this environment as a command."""
    return [sys.executable, "-m", *arguments]


class Postgres:
    """A database of its own; Debian's package `postgresql`."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, free_port()
        self.programs = next(iter(sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)), None)

    @property
    def missing(self) -> bool:
        """Whether it is not installed."""
        return self.programs is None or shutil.which("runuser") is None

    def start(self, services: Services, password: str) -> str:
        """Make and start it; the address of the database `prefect` for Prefect."""
        assert self.programs is not None
        self.folder.mkdir()
        if os.geteuid() == 0:
            shutil.chown(self.folder, "postgres", "postgres")
        secret = self.folder.with_suffix(".password")
        secret.write_text(password)
        secret.chmod(0o644)
        options = ["--username=prefect", f"--pwfile={secret}", "--auth=scram-sha-256", "--no-sync", "--encoding=UTF8"]
        made = [*self._as_user(), str(self.programs / "initdb"), *options, str(self.folder / "data")]
        subprocess.run(made, check=True, capture_output=True, cwd="/")
        secret.unlink()
        settings = [f"-cunix_socket_directories={self.folder}", "-clisten_addresses=127.0.0.1", f"-cport={self.port}"]
        command = [*self._as_user(), str(self.programs / "postgres"), "-D", str(self.folder / "data"), *settings]
        environment = {"PGPASSWORD": password}
        check = [str(self.programs / "pg_isready"), "--quiet", "-h", "127.0.0.1", "-p", str(self.port)]
        services.start("postgres", command, {}, lambda: subprocess.run(check).returncode == 0)
        create = [str(self.programs / "createdb"), *self._server(), "prefect"]
        subprocess.run(create, env=os.environ | environment, check=True)
        return f"postgresql+asyncpg://prefect:{password}@127.0.0.1:{self.port}/prefect"

    def dump(self, password: str) -> bytes:
        """All that it holds, as a back-up has it."""
        assert self.programs is not None
        command = [str(self.programs / "pg_dump"), *self._server(), "prefect"]
        return subprocess.run(
            command, env=os.environ | {"PGPASSWORD": password}, check=True, capture_output=True
        ).stdout

    def _server(self) -> list[str]:
        return ["-h", "127.0.0.1", "-p", str(self.port), "-U", "prefect"]

    def _as_user(self) -> list[str]:
        return ["runuser", "-u", "postgres", "--"] if os.geteuid() == 0 else []
