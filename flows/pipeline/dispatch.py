"""Send work to Dask workers: wait for one task, map over all workers, explain the death of a worker."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any
from uuid import uuid4

from distributed import Client, Future
from distributed.client import FutureCancelledError
from distributed.scheduler import KilledWorker

from glint.flows.errors import ClusterError
from glint.flows.pipeline.prefect_sink import TaskRunReporter
from glint.flows.runtime.dask_cluster import WORKERS_SECONDS
from glint.flows.runtime.environment import TERMINATED

_ATTEMPTS = 3


@dataclass(frozen=True, slots=True)
class Capacity:
    """Current number of workers, and the bytes that the smallest of them may use (None: no limit)."""

    workers: int
    bytes: int | None


def capacity(client: Client) -> Capacity:
    """Return the capacity of a cluster."""
    workers = client.scheduler_info(n_workers=-1)["workers"].values()
    limits = [worker["memory_limit"] for worker in workers]
    return Capacity(len(workers), int(min(limits) * TERMINATED) if limits and all(limits) else None)


def task_key(work: str, kind: str) -> tuple[str, str, str]:
    """Return the key of a Dask task: its kind, and the capture or object that it works for.

    Dask groups tasks by the first part, and keeps figures of each group for as long as its scheduler runs.
    """
    return kind, work, uuid4().hex


def wait_for(future: Future, work: str, reporter: TaskRunReporter | None = None) -> Any:
    """Return the result of a task; work: capture or object, whose stage the reporter knows.

    Raises:
        ClusterError: its worker died twice; else what the task raised.
    """
    try:
        return future.result()
    except KilledWorker as error:
        raise worker_died(work if reporter is None else f"{work} {reporter.stage}") from error


def scatter_map[Task, Shared, Result](
    client: Client,
    capture: str,
    stage: str,
    function: Callable[[Task, Shared], Result],
    tasks: Iterable[Task],
    shared: Shared,
) -> Iterator[Result]:
    """Apply a function to tasks on all workers, to which `shared` is sent once; yield results in the tasks' order.

    When workers die to which `shared` was sent, or while it is sent, it is sent again for the remaining tasks.

    Raises:
        ClusterError: workers died repeatedly.
    """
    remaining, failures = list(tasks), 0
    while remaining:
        futures: list[Future] = []
        try:
            scattered = _scattered(client, shared)
            keys = [task_key(capture, stage) for _ in remaining]
            futures = client.map(function, remaining, shared=scattered, pure=False, key=keys)
            while futures:
                result = futures[0].result()
                futures.pop(0).release()
                remaining.pop(0)
                yield result
        except (KilledWorker, FutureCancelledError, _NotSent) as error:
            failures += 1
            if client.status == "running":
                # Tasks that are left alone would go on, and kill the next workers.
                client.cancel(futures, force=True)
            if failures == _ATTEMPTS or client.status != "running":
                raise worker_died(f"{capture} {stage}") from error


def worker_died(work: str) -> ClusterError:
    """Return the error for work that killed its workers."""
    return ClusterError(
        f"{work}: the worker process died, and so did the next one (in most cases the system was out of memory)",
        "run again, it goes on from here; if it recurs use fewer --workers, or give a smaller region",
    )


class _NotSent(Exception):
    """No worker was there to take what is shared, or one died while it was sent."""


def _scattered(client: Client, shared: object) -> Future:
    try:
        client.wait_for_workers(1, timeout=WORKERS_SECONDS)
        return client.scatter(shared, broadcast=True, hash=False)
    except OSError as error:
        raise _NotSent from error
