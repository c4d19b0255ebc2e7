"""What another user of the machine can do with the processes of a run: nothing."""

import os
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from glint.flows.runtime.dask_cluster import Cluster
from glint.flows.runtime.prefect_server import Server

pytestmark = [
    pytest.mark.server,
    pytest.mark.skipif(os.getuid() != 0, reason="only root can become a second user: run this test as root"),
]

NOBODY = 65534

INTRUSION = """
import asyncio, os, pickle, sys
from distributed import Security
from distributed.core import rpc
Security.temporary().get_connection_args("client")  # imports what the intruder needs, before it loses its rights
import distributed.comm.tcp, encodings.idna
os.setgroups([])
os.setgid(NOBODY)
os.setuid(NOBODY)

async def run(address, operation, connection):
    code = {"function": pickle.dumps(os.getuid), "args": pickle.dumps(()), "kwargs": pickle.dumps({})}
    async with asyncio.timeout(4), rpc(address, connection_args=connection, timeout=3) as target:
        return await getattr(target, operation)(**code)

for security in (Security(), Security.temporary()):
    for scheme in ("tls", "tcp"):
        try:
            connection = security.get_connection_args("client")
            print("ran as", asyncio.run(run(f"{scheme}://{sys.argv[1]}", sys.argv[2], connection)))
        except Exception as error:
            print(type(error).__name__)
""".replace("NOBODY", str(NOBODY))


def intrude(*arguments: str) -> str:
    """What the intrusion prints."""
    done = subprocess.run([sys.executable, "-c", INTRUSION, *arguments], capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_intrusion_succeeds_without_tls(tmp_path: Path) -> None:
    scheduler = subprocess.Popen(
        [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0",
         "--no-dashboard", "--scheduler-file", str(tmp_path / "scheduler.json")],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert scheduler.stderr is not None
        line = next(line for line in scheduler.stderr if "Scheduler at:" in line)
        assert "'result': 0" in intrude(line.split("tcp://")[1].strip(), "run_function")
    finally:
        scheduler.kill()
        scheduler.wait()


def test_nobody_else_runs_code_on_the_cluster(cluster: Cluster) -> None:
    addresses = [cluster.address, *cluster.client.nthreads()]
    addresses += [worker["nanny"] for worker in cluster.client.scheduler_info(n_workers=-1)["workers"].values()]
    assert len(addresses) == 5 and all(address.startswith("tls://127.0.0.1:") for address in addresses)
    for address, operation in ((addresses[0], "run_function"), (addresses[1], "run"), (addresses[-1], "run")):
        said = intrude(address.removeprefix("tls://"), operation)
        assert "ran as" not in said and len(said.split()) == 4, said


def test_what_a_cluster_listens_at_is_known(cluster: Cluster) -> None:
    info = cluster.client.scheduler_info(n_workers=-1)["workers"].values()
    known = {address.rpartition(":")[2] for address in [cluster.address, *cluster.client.nthreads()]}
    known |= {worker["nanny"].rpartition(":")[2] for worker in info} | {
        cluster.dashboard_url.split(":")[2].split("/")[0]
    }
    known |= {str(worker["services"]["dashboard"]) for worker in info}  # health and metrics, no commands
    open_ports = {
        f"{item.laddr.ip}:{item.laddr.port}"
        for pid in cluster.client.run(os.getpid).values()
        for item in psutil.Process(pid).net_connections("tcp")
        if item.status == psutil.CONN_LISTEN
    }
    assert open_ports and open_ports <= {f"127.0.0.1:{port}" for port in known}


def test_nobody_else_reads_the_home(server: Server, glint_home: Path) -> None:
    assert server.log is not None and server.process is not None
    folder = server.log.parent
    assert folder.stat().st_mode & 0o777 == 0o700
    assert (folder / "server.json").stat().st_mode & 0o777 == 0o600
    for path in (
        folder,
        folder / "server.json",
        folder / "prefect" / "prefect.db",
        Path("/proc") / str(server.process[0]) / "environ",
    ):
        done = subprocess.run(["cat", str(path)], user=NOBODY, group=NOBODY, extra_groups=[], capture_output=True)
        assert done.returncode != 0 and b"ermission denied" in done.stderr, path


def test_the_password_is_on_no_command_line_and_in_no_log(server: Server) -> None:
    assert server.authentication is not None and server.log is not None
    password = server.authentication.partition(":")[2]
    assert len(password) >= 32
    for process in psutil.process_iter(["cmdline"]):
        assert not any(password in part for part in process.info["cmdline"] or [])
    assert password not in server.log.read_text() and password not in repr(server)
