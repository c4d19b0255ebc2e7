"""Waiting for work on workers: results, errors of any kind, and the death of workers."""

import gc
import os
import signal
import time
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from dask.utils import key_split
from distributed.scheduler import TaskGroup

from glint.flows.errors import ClusterError
from glint.flows.pipeline.dispatch import scatter_map, task_key, wait_for
from glint.flows.pipeline.prefect_sink import TaskRunReporter
from glint.flows.runtime.dask_cluster import Cluster
from tests.flows.pipeline.sent_to_workers import Named, die, die_once, late, metrics_of_tasks, name_of, slowly, times

pytestmark = pytest.mark.server


REPORTER = cast(TaskRunReporter, SimpleNamespace(stage="labels"))


def test_the_result_of_a_task_is_returned(cluster: Cluster) -> None:
    future = cluster.client.submit(slowly, 0.5, pure=False, key=task_key("glass-2/front", "labels..surface"))
    assert key_split(future.key) == "labels..surface"
    assert wait_for(future, "glass-2/front", REPORTER) == "done"


def test_neither_scheduler_nor_workers_remember_captures(cluster: Cluster) -> None:
    def run(captures: range) -> tuple[int, int]:
        for number in captures:
            capture = Named(f"object/capture-{number}")
            wait_for(cluster.client.submit(name_of, capture, pure=False, key=task_key(capture.name, "survey")), "")
        gc.collect()
        figures = cluster.client.run(metrics_of_tasks, "survey")
        named = sum(isinstance(item, Named | TaskGroup) for item in gc.get_objects())
        prefixes = cluster.client.run_on_scheduler(lambda dask_scheduler: len(dask_scheduler.task_prefixes))
        return named + prefixes, max(figures.values())

    # Some of the last captures are still being released, more or fewer of them at each time.
    (named, figures), (named_later, figures_later) = run(range(100)), run(range(100, 300))
    assert named < 100 and named_later < 100
    assert figures > 0 and 0 < figures_later <= figures + 10


def test_a_time_out_of_the_task_is_its_own(cluster: Cluster) -> None:
    with pytest.raises(TimeoutError, match="the task's own"):
        wait_for(cluster.client.submit(late, pure=False), "glass/front", REPORTER)


def test_work_that_kills_its_workers_is_explained(cluster: Cluster) -> None:
    with pytest.raises(ClusterError, match=r"glass/front labels: the worker process died.*out of memory"):
        wait_for(cluster.client.submit(die, pure=False), "glass/front", REPORTER)
    with pytest.raises(ClusterError, match="glass/front clusters: the worker process died"):
        list(scatter_map(cluster.client, "glass/front", "clusters", die, range(3), "shared"))
    cluster.client.wait_for_workers(2, timeout=240)


def test_what_dead_workers_held_is_sent_again(cluster: Cluster, tmp_path: Path) -> None:
    found = list(scatter_map(cluster.client, "glass/front", "clusters", die_once, range(8), str(tmp_path)))
    assert found == [number**2 for number in range(8)]
    cluster.client.wait_for_workers(2, timeout=240)


def test_work_is_sent_while_all_workers_are_replaced(cluster: Cluster) -> None:
    for process in cluster.client.run(os.getpid).values():
        os.kill(process, signal.SIGKILL)
    assert list(scatter_map(cluster.client, "glass/front", "clusters", times, range(4), 3)) == [0, 3, 6, 9]
    cluster.client.wait_for_workers(2, timeout=240)


@pytest.mark.slow
def test_a_worker_that_dies_while_it_is_replaced_is_replaced_again(cluster: Cluster) -> None:
    end = time.monotonic() + 20
    while time.monotonic() < end:
        cluster.client.wait_for_workers(1, timeout=240)
        for process in cluster.client.run(os.getpid, on_error="ignore").values():
            os.kill(process, signal.SIGKILL)
        time.sleep(0.5)
    cluster.client.wait_for_workers(2, timeout=240)
