"""Awaiting work on workers: results, errors of any kind, progress meanwhile, and the death of those who do it."""

import os
import time
from pathlib import Path
from typing import Any, cast

import pytest

from glint.flows.errors import ClusterError
from glint.flows.pipeline import dispatch
from glint.flows.pipeline.dispatch import awaited, spread
from glint.flows.pipeline.stage_runs import Hearing
from glint.flows.runtime.dask_cluster import Cluster

pytestmark = pytest.mark.server


def slowly(seconds: float) -> str:
    time.sleep(seconds)
    return "done"


def late() -> None:
    raise TimeoutError("the task's own")


def die(task: Any = None, common: Any = None) -> None:
    os._exit(1)


def die_once(number: int, common: str) -> int:
    """End the worker that sees a mark first; its memory, and what was sent to it, goes with it."""
    mark = Path(common) / f"seen-{number}"
    if number in (3, 4) and not mark.exists():
        mark.touch()
        os._exit(1)
    return number**2


class Heard:
    """What awaiting passes on to a hearing."""

    def __init__(self, stage: str = "labels") -> None:
        self.stage, self.times = stage, 0

    def pass_on(self) -> None:
        self.times += 1


def test_what_takes_long_is_told_meanwhile(cluster: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dispatch, "PROGRESS_SECONDS", 0.05)
    heard = Heard()
    future = cluster.client.submit(slowly, 0.5, pure=False)
    assert awaited(future, "glass/front", cast(Hearing, heard)) == "done"
    assert heard.times


def test_a_time_out_of_the_task_is_its_own(cluster: Cluster) -> None:
    with pytest.raises(TimeoutError, match="the task's own"):
        awaited(cluster.client.submit(late, pure=False), "glass/front", cast(Hearing, Heard()))


def test_work_that_kills_its_workers_is_explained(cluster: Cluster) -> None:
    with pytest.raises(ClusterError, match=r"glass/front labels: the worker process died.*out of memory"):
        awaited(cluster.client.submit(die, pure=False), "glass/front", cast(Hearing, Heard()))
    with pytest.raises(ClusterError, match="worker process died"):
        list(spread(cluster.client, "glass/front", die, range(3), "common"))
    cluster.client.wait_for_workers(2, timeout=240)


def test_what_dead_workers_held_is_sent_again(cluster: Cluster, tmp_path: Path) -> None:
    found = list(spread(cluster.client, "glass/front", die_once, range(8), str(tmp_path)))
    assert found == [number**2 for number in range(8)]
    cluster.client.wait_for_workers(2, timeout=240)
