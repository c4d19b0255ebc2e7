"""Prefect's own command for the server of this machine: its address and password come from the environment."""

import os
import subprocess
import sys
from collections.abc import Sequence

from glint.flows.runtime.environment import prepare_environment
from glint.flows.runtime.prefect_server import Server
from glint.flows.runtime.server_process import read_state

WORK_POLL_SECONDS = 2.0
"""Interval at which a worker's password is compared with that of the running server."""


def run_prefect(arguments: Sequence[str]) -> int:
    """Run Prefect's command, telemetry off, and return its exit status."""
    child = _start(arguments)
    try:
        return child.wait()
    except KeyboardInterrupt:
        child.terminate()
        return child.wait()


def has_pool(pool: str) -> bool:
    """Return whether the server has a work pool: Prefect makes one of any name when a worker asks for it."""
    from prefect.client.orchestration import get_client
    from prefect.exceptions import ObjectNotFound

    with get_client(sync_client=True) as client:
        try:
            client.read_work_pool(pool)
        except ObjectNotFound:
            return False
        return True


def run_worker(server: Server, pool: str) -> int:
    """Serve a work pool until the worker ends, and return its exit status.

    A server that was stopped and started again has another password, with which the worker is started again.
    """
    arguments = ["worker", "start", "--pool", pool]
    if server.log is None:
        return run_prefect(arguments)
    folder = server.log.parent
    known = read_state(folder)
    child = _start(arguments)
    try:
        while True:
            try:
                return child.wait(WORK_POLL_SECONDS)
            except subprocess.TimeoutExpired:
                state = read_state(folder)
                if state is not None and (known is None or state.authentication != known.authentication):
                    known = state
                    child.terminate()
                    child.wait()
                    prepare_environment(state.api_url, folder / "prefect", state.authentication)
                    child = _start(arguments)
    finally:
        child.terminate()
        child.wait()


def _start(arguments: Sequence[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen([sys.executable, "-m", "prefect", *arguments], env=os.environ.copy())
