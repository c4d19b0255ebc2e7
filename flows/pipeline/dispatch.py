"""Work that is done on Dask workers: awaited, spread over all of them, and explained when a worker dies."""

import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from distributed import Client, Future
from distributed.client import FutureCancelledError
from distributed.scheduler import KilledWorker

from glint.flows.errors import ClusterError
from glint.flows.pipeline.stage_runs import PROGRESS_SECONDS, Hearing
from glint.flows.runtime.dask_cluster import TERMINATED

_TRIES = 3


@dataclass(frozen=True, slots=True)
class Capacity:
    """Workers there are now, and the bytes that the smallest of them may fill; None: any."""

    workers: int
    bytes: int | None


def capacity(client: Client) -> Capacity:
    """What a cluster has."""
    found = client.scheduler_info(n_workers=-1)["workers"].values()
    limits = [worker["memory_limit"] for worker in found]
    return Capacity(len(found), int(min(limits) * TERMINATED) if limits and all(limits) else None)


def awaited(future: Future, name: str, hearing: Hearing) -> Any:
    """The result of a task for a capture, what its worker tells passed on meanwhile.

    Raises:
        ClusterError: the worker died on it twice; else what the task raised.
    """
    # Waiting in `result` itself with a time-out can end, under load, in an error of Dask's own.
    ended = threading.Event()
    future.add_done_callback(lambda _: ended.set())
    while not ended.wait(PROGRESS_SECONDS) and not future.done():
        hearing.pass_on()
    try:
        return future.result()
    except KilledWorker as error:
        raise died(f"{name} {hearing.stage}") from error


def spread[Task, Shared, Result](
    client: Client, what: str, function: Callable[[Task, Shared], Result], tasks: Iterable[Task], common: Shared
) -> Iterator[Result]:
    """Apply a function to tasks on all workers, which get once what is common; results in the tasks' order.

    When the last worker that holds what is common dies, it is sent again, for what is left to do.

    Raises:
        ClusterError: workers died on it again and again.
    """
    left, lost = list(tasks), 0
    while left:
        shared = client.scatter(common, broadcast=True, hash=False)
        futures = client.map(function, left, common=shared, pure=False)
        try:
            while futures:
                result = futures[0].result()
                futures.pop(0).release()
                left.pop(0)
                yield result
        except (KilledWorker, FutureCancelledError) as error:
            lost += 1
            if lost == _TRIES or client.status != "running":
                raise died(what) from error
            client.cancel(futures, force=True)


def died(what: str) -> ClusterError:
    """The error for work that killed its workers."""
    return ClusterError(
        f"{what}: the worker process died, and so did the next one (in most cases the system was out of memory)",
        "run again, it goes on from here; if it recurs use fewer --workers, or give a smaller region",
    )
