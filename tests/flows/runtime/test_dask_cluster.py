import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import urlopen

import psutil
import pytest

from glint.flows.errors import ClusterError
from glint.flows.runtime.dask_cluster import Cluster
from glint.flows.runtime.environment import FORKED, WORKER_MEMORY
from tests.flows.runtime.dask_certificates import certificates
from tests.polling import PATIENCE, until

pytestmark = pytest.mark.server


def settings_of_a_worker() -> tuple[str | None, int, int]:
    import cv2
    import numba

    return os.environ.get("OMP_NUM_THREADS"), numba.get_num_threads(), cv2.getNumThreads()


def die() -> None:
    os._exit(1)


def test_workers_are_processes_of_one_thread(cluster: Cluster) -> None:
    assert cluster.workers == 2
    assert set(cluster.client.nthreads().values()) == {1}
    until(lambda: set(cluster.client.run(settings_of_a_worker).values()) == {("1", 1, 1)})
    assert len(set(cluster.client.run(os.getpid).values()) - {os.getpid()}) == 2


def test_workers_are_forked_from_a_process_with_their_memory_settings(cluster: Cluster) -> None:
    worker = next(iter(cluster.client.run(os.getpid).values()))
    forked_from = psutil.Process(worker).parent()
    assert forked_from is not None and forked_from.pid != os.getpid()
    environment = forked_from.environ()
    assert {name: environment.get(name) for name in WORKER_MEMORY} == {
        name: str(value) for name, value in WORKER_MEMORY.items()
    }


def test_what_workers_are_sent_needs_no_prefect() -> None:
    code = "import sys, glint.flows.pipeline.worker; sys.exit('prefect' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[3]).returncode == 0


def test_what_is_imported_before_workers_are_forked_starts_no_threads() -> None:
    """A fork copies no threads: a library that waits for one of its own would wait for ever."""
    code = "import importlib, os, sys; [importlib.import_module(each) for each in sys.argv[1:]]; "
    code += "sys.exit(len(os.listdir('/proc/self/task')))"
    assert subprocess.run([sys.executable, "-c", code, *FORKED], cwd=Path(__file__).parents[3]).returncode == 1


def test_scheduler_workers_and_dashboard_are_on_loopback(cluster: Cluster) -> None:
    assert cluster.address.startswith("tls://127.0.0.1:")
    assert cluster.dashboard_url.startswith("http://127.0.0.1:")
    assert all(address.startswith("tls://127.0.0.1:") for address in cluster.client.nthreads())
    listening = {each.laddr.ip for each in psutil.Process().net_connections("tcp") if each.status == psutil.CONN_LISTEN}
    assert listening == {"127.0.0.1"}


def test_the_dashboard_is_added_after_the_start(cluster: Cluster) -> None:
    def has_pages() -> bool:
        with suppress(HTTPError), urlopen(cluster.dashboard_url) as answer:
            return b"bokeh" in answer.read()
        return False

    until(has_pages)


def test_a_run_that_ends_at_once_has_no_dashboard() -> None:
    code = """
import sys
from glint.flows.runtime.dask_cluster import Cluster
if __name__ == "__main__":
    with Cluster(workers=1) as cluster:
        assert cluster.client.submit(abs, -1).result() == 1
    sys.exit("bokeh" in sys.modules)
"""
    script = subprocess.run([sys.executable, "-c", code], cwd=Path(__file__).parents[3], capture_output=True, text=True)
    assert script.returncode == 0 and script.stderr == ""


def test_the_client_is_nobodys_default(cluster: Cluster) -> None:
    from distributed import default_client

    assert cluster.client is not None
    with pytest.raises(ValueError, match="No clients found"):
        default_client()


def test_work_that_does_not_fit_is_refused(cluster: Cluster) -> None:
    from glint.flows.pipeline.dispatch import capacity
    from glint.flows.pipeline.worker import check_bytes

    found = capacity(cluster.client)
    limit = found.bytes
    assert found.workers == 2 and limit is not None
    check_bytes(limit, limit, "glass/front")
    with pytest.raises(ClusterError, match=r"glass/front needs .* in one process.*smaller region"):
        check_bytes(limit, limit + 1, "glass/front")


def test_a_task_that_kills_its_workers_fails_and_others_go_on(cluster: Cluster) -> None:
    from distributed import KilledWorker

    deadly = cluster.client.submit(die, pure=False)
    with pytest.raises(KilledWorker):
        deadly.result(timeout=PATIENCE)
    assert cluster.client.submit(abs, -3).result(timeout=PATIENCE) == 3
    cluster.client.wait_for_workers(2, timeout=PATIENCE)
    until(lambda: set(cluster.client.run(settings_of_a_worker).values()) == {("1", 1, 1)})


def test_a_given_scheduler_is_used_and_left(cluster: Cluster) -> None:
    with (
        certificates(cluster),
        Cluster(scheduler=cluster.address, modules=["glint.tasks.algorithms.geometry.vectors"]) as second,
    ):
        assert second.address == cluster.address
        assert second.client is not cluster.client
        imported = second.client.run(lambda: "glint.tasks.algorithms.geometry.vectors" in sys.modules)
        assert set(imported.values()) == {True}
    assert cluster.client.submit(abs, -4).result(timeout=PATIENCE) == 4


def test_workers_that_cannot_run_glint_are_refused(cluster: Cluster) -> None:
    with (
        certificates(cluster),
        Cluster(scheduler=cluster.address, modules=["no.such.module"]) as second,
        pytest.raises(ClusterError, match=r"cannot run Glint.*no"),
    ):
        _ = second.client


def is_alive(process: psutil.Process) -> bool:
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


RUN = """
import sys, time
from glint.flows.runtime.dask_cluster import Cluster

def main():
    with Cluster(workers=2) as cluster:
        futures = cluster.client.map(time.sleep, [600] * 4, pure=False)
        print("ready", flush=True)
        cluster.client.gather(futures)

if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit(130)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_nothing_is_left_when_a_run_is_interrupted(number: signal.Signals, tmp_path: Path) -> None:
    (tmp_path / "run.py").write_text(RUN)
    process = subprocess.Popen(
        [sys.executable, str(tmp_path / "run.py")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # A test that runs in the background inherits that interrupts are ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler) and None,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    children = psutil.Process(process.pid).children(recursive=True)
    assert len(children) >= 2
    if number is signal.SIGINT:
        os.killpg(process.pid, number)
        assert process.wait(PATIENCE) == 130
        assert process.stderr is not None
        assert "Traceback" not in process.stderr.read()
    else:
        process.kill()
        process.wait(PATIENCE)
    until(lambda: not [child for child in children if is_alive(child)])
