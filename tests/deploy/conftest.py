"""A Prefect server, and a worker of Prefect that takes what is deployed on it."""

import os
import subprocess
import sys
from collections.abc import Iterator

import pytest

from glint.flows.runtime.prefect_server import Server
from tests.flows.conftest import glint_home, server

__all__ = ["glint_home", "server", "worker"]


@pytest.fixture(scope="session")
def worker(server: Server, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The name of the work pool that a process worker serves."""
    folder = tmp_path_factory.mktemp("worker")
    subprocess.run(
        [sys.executable, "-m", "prefect", "work-pool", "create", "glint", "--type", "process"],
        env=os.environ | {"PREFECT_API_URL": server.api_url},
        check=True,
        capture_output=True,
        cwd=folder,
    )
    with (folder / "log").open("w") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "prefect", "worker", "start", "--pool", "glint", "--type", "process"],
            env=os.environ | {"PREFECT_API_URL": server.api_url, "PREFECT_WORKER_QUERY_SECONDS": "1"},
            stdout=log,
            stderr=log,
            cwd=folder,
        )
    yield "glint"
    process.terminate()
    try:
        process.wait(30)
    except subprocess.TimeoutExpired:
        process.kill()  # it waits for the server's answers, which a busy machine delays
