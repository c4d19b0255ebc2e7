"""A real Azure blob server for tests: the emulator azurite on loopback, with a key and containers of its own.

Tests that need it are skipped where `azurite-blob` is neither on the PATH nor named by GLINT_AZURITE.
"""

import base64
import hmac
import os
import secrets
import shutil
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Sequence
from email.utils import formatdate
from pathlib import Path

from tests.s3_gateway import free_port

ACCOUNT = "glinttest"
VERSION = "2021-12-02"


def program() -> str | None:
    """The emulator, if it is installed (npm install azurite)."""
    return os.environ.get("GLINT_AZURITE") or shutil.which("azurite-blob")


class Emulator:
    """The server; a context manager that starts and stops it. What it stores stays in `folder`."""

    def __init__(self, folder: Path, containers: Sequence[str] = ("store",)) -> None:
        self.folder, self.port, self._containers = folder, free_port(), tuple(containers)
        self.secret = base64.b64encode(secrets.token_bytes(48)).decode()
        self.url = f"http://127.0.0.1:{self.port}/{ACCOUNT}"
        self.environment = {
            "AZURE_STORAGE_ACCOUNT_NAME": ACCOUNT,
            "AZURE_STORAGE_ACCOUNT_KEY": self.secret,
            "AZURE_STORAGE_ENDPOINT": self.url,
        }
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> "Emulator":
        command = [str(program()), "--blobHost", "127.0.0.1", "--blobPort", str(self.port), "--silent"]
        command += ["--location", str(self.folder), "--skipApiVersionCheck", "--disableTelemetry"]
        self.folder.mkdir(parents=True, exist_ok=True)
        with (self.folder / "out").open("wb") as out:
            self._process = subprocess.Popen(
                command, env=os.environ | {"AZURITE_ACCOUNTS": f"{ACCOUNT}:{self.secret}"}, stdout=out, stderr=out
            )
        for name in self._containers:
            self._make(name)
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.terminate()
            self._process.wait(20)

    def _make(self, container: str) -> None:
        date = formatdate(usegmt=True)
        lines = ["PUT", *([""] * 11), f"x-ms-date:{date}", f"x-ms-version:{VERSION}"]
        signed = "\n".join([*lines, f"/{ACCOUNT}/{ACCOUNT}/{container}", "restype:container"])
        mac = base64.b64encode(hmac.digest(base64.b64decode(self.secret), signed.encode(), "sha256")).decode()
        headers = {"x-ms-date": date, "x-ms-version": VERSION, "Authorization": f"SharedKey {ACCOUNT}:{mac}"}
        request = urllib.request.Request(f"{self.url}/{container}?restype=container", method="PUT", headers=headers)
        deadline = time.monotonic() + 60
        while True:
            try:
                urllib.request.urlopen(request, timeout=10).close()
                return
            except urllib.error.HTTPError as error:
                raise RuntimeError(f"no container {container}: {error.read()[:500]!r}") from error
            except OSError:
                if time.monotonic() > deadline:
                    raise RuntimeError("the Azure emulator does not answer") from None
                time.sleep(0.1)
