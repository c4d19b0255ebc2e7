"""What the files of deploy/ start, started here as processes: the certificate, Dask with it, the guarded server."""

import json
import os
import shutil
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import dask
import pytest

from glint.flows.errors import ClusterError
from glint.flows.runtime import scheduler_client
from glint.flows.runtime.scheduler_client import connected_client
from tests.acceptance.processes import Services, answers
from tests.deploy.test_files import COMPOSE
from tests.polling import PATIENCE
from tests.s3_gateway import free_port

pytestmark = pytest.mark.server

FOLDER = "/etc/glint/dask"
BIN = Path(sys.executable).parent


def environment(name: str, folder: Path) -> dict[str, str]:
    """The settings of a service, with the certificate in a folder of this machine."""
    settings = COMPOSE["services"][name]["environment"]
    return {key: str(value).replace(FOLDER, str(folder)) for key, value in settings.items() if "${" not in str(value)}


@pytest.fixture(scope="module")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the certificate that the service `certificate` makes."""
    if shutil.which("openssl") is None:
        pytest.skip("no openssl (Debian's package openssl)")
    folder = tmp_path_factory.mktemp("certificate")
    command = [part.replace(FOLDER, str(folder)) for part in COMPOSE["services"]["certificate"]["command"]]
    for _ in range(2):  # the second time it leaves the first one's alone
        subprocess.run(command, check=True, capture_output=True)
        kept = (folder / "certificate.pem").read_bytes()
    assert (folder / "key.pem").stat().st_mode & 0o777 == 0o600
    assert (folder / "certificate.pem").read_bytes() == kept
    return folder


@pytest.fixture
def services(tmp_path: Path) -> Iterator[Services]:
    with Services(tmp_path) as running:
        yield running


def test_dask_serves_holders_of_the_certificate(
    services: Services, certificate: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    port, dashboard = free_port(), free_port()
    settings = environment("dask-scheduler", certificate)
    places = {"0.0.0.0": "127.0.0.1", "8786": str(port), ":8787": f"127.0.0.1:{dashboard}"}
    command = [places.get(part, part) for part in COMPOSE["services"]["dask-scheduler"]["command"]]
    services.start(
        "scheduler",
        [str(BIN / command[0]), *command[1:]],
        settings,
        lambda: answers(f"http://127.0.0.1:{dashboard}/health"),
    )
    command = [
        part for part in COMPOSE["services"]["dask-worker"]["command"] if "${" not in part and "/tmp" not in part
    ]
    command = [part.replace("dask-scheduler:8786", f"127.0.0.1:{port}") for part in command]
    services.start("worker", [str(BIN / command[0]), *command[1:], "--host=127.0.0.1"], settings, lambda: True)
    address = f"tls://127.0.0.1:{port}"
    with pytest.raises(ClusterError, match="wants certificates"):
        connected_client(address)
    with monkeypatch.context() as impatient, pytest.raises(ClusterError, match="does not answer"):
        impatient.setattr(scheduler_client, "CONNECT_SECONDS", 2.0)
        connected_client(address.replace("tls", "tcp"))
    names = {name: name.removeprefix("DASK_").lower().replace("__", ".") for name in settings}
    with dask.config.set({names[n]: settings[n] for n in settings if "TLS" in n or "ENCRYPTION" in n}):
        client = connected_client(address)
        client.wait_for_workers(1, timeout=PATIENCE)
        assert client.submit(abs, -5).result(timeout=PATIENCE) == 5
        assert all(worker.startswith("tls://") for worker in client.nthreads())
        client.close()


@pytest.mark.long
def test_the_server_of_compose_is_guarded(services: Services, tmp_path: Path) -> None:
    port = free_port()
    origin = f"http://127.0.0.1:{port}"
    places = {"--host=0.0.0.0": "--host=127.0.0.1", "--port=4200": f"--port={port}"}
    command = [places.get(part, part) for part in COMPOSE["services"]["prefect-server"]["command"]]
    settings = environment("prefect-server", tmp_path) | {
        "GLINT_SERVER_ORIGINS": f"{origin},http://prefect-server:4200",
        "PREFECT_HOME": str(tmp_path / "prefect"),
        "PREFECT_SERVER_API_AUTH_STRING": "glint:secret",
        "PREFECT_SERVER_UI_API_URL": f"{origin}/api",
        "PREFECT_SERVER_UI_STATIC_DIRECTORY": str(tmp_path / "pages"),
        "DO_NOT_TRACK": "1",
    }
    program = [sys.executable, "-m", command[0], *command[1:]]
    services.start("prefect-server", program, settings, lambda: answers(f"{origin}/api/health"))
    assert status(f"{origin}/api/admin/version") == 401
    assert status(f"{origin}/api/health", Host="prefect-server:4200") == 200
    assert status(f"{origin}/api/health", Host="pages.example") == 400
    assert status(f"{origin}/api/health", Origin="http://pages.example") == 403
    with urllib.request.urlopen(f"{origin}/ui-settings") as answer:
        assert json.load(answer)["available_uis"] == ["v1"]


@pytest.mark.long
def test_the_review_page_of_compose_is_behind_the_password(services: Services, tmp_path: Path) -> None:
    port = free_port()
    origin = f"http://127.0.0.1:{port}"
    places = {"--host=0.0.0.0": "--host=127.0.0.1", "--port=4300": f"--port={port}"}
    command = [places.get(part, part) for part in COMPOSE["services"]["review"]["command"] if "${" not in part]
    command = [part.replace("--origin=http://127.0.0.1:4300", f"--origin={origin}") for part in command]
    settings = {"GLINT_REVIEW_PASSWORD": "glint:a long secret", "GLINT_STORE": str(tmp_path / "store")}
    settings |= {"GLINT_HOME": str(tmp_path / "home")}
    program = [sys.executable, "-m", *command]
    services.start("review", program, settings, lambda: answers(f"{origin}/open"))
    assert status(f"{origin}/api/captures") == 401
    assert status(f"{origin}/open", Host="pages.example") == 400
    for password, expected in ((b"glint:a wrong secret", 403), (b"glint:a long secret", 200)):
        request = urllib.request.Request(f"{origin}/api/session", password)
        try:
            with urllib.request.urlopen(request) as answer:
                assert answer.status == expected and "HttpOnly" in answer.headers["Set-Cookie"]
        except urllib.error.HTTPError as refused:
            assert refused.code == expected


@pytest.mark.parametrize("missing", ["GLINT_SERVER_ORIGINS", "PREFECT_SERVER_API_AUTH_STRING"])
def test_the_server_refuses_to_start_unguarded(missing: str) -> None:
    settings = {"GLINT_SERVER_ORIGINS": "http://127.0.0.1:4200", "PREFECT_SERVER_API_AUTH_STRING": "glint:secret"}
    del settings[missing]
    code = "from glint.flows.runtime.server_app import create; create()"
    clean = {name: value for name, value in os.environ.items() if name not in (missing, "PREFECT_API_AUTH_STRING")}
    done = subprocess.run([sys.executable, "-c", code], env=clean | settings, capture_output=True, text=True)
    assert done.returncode != 0 and missing in done.stderr.splitlines()[-1]


def status(url: str, **headers: str) -> int:
    """The status of the answer to a request."""
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers)) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as refused:
        return refused.code
