"""One Prefect server and one Dask cluster for all tests that need them, in a home of their own."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from glint.flows.runtime.dask_cluster import Cluster
from glint.flows.runtime.prefect_server import Server, start_server, stop_server


@pytest.fixture(scope="session")
def glint_home(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A home for Glint's own server; the environment is as before when the tests are done."""
    home, before = tmp_path_factory.mktemp("home"), os.environ.copy()
    os.environ.pop("PREFECT_API_URL", None)
    os.environ["GLINT_HOME"] = str(home)
    yield home
    stop_server(home)
    os.environ.clear()
    os.environ.update(before)


@pytest.fixture(scope="session")
def server(glint_home: Path) -> Iterator[Server]:
    """A Prefect server of its own, to which flows called in a test report."""
    # A run inside a test may have left the address of a server that has ended since.
    os.environ.pop("PREFECT_API_URL", None)
    found = start_server(glint_home)
    with found.connected():
        yield found


@pytest.fixture(scope="session")
def cluster(glint_home: Path) -> Iterator[Cluster]:
    """A local cluster of two workers."""
    with Cluster(workers=2) as found:
        yield found
