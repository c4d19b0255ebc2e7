"""Work that is done on Dask workers: awaited with its progress on the dashboard, and explained when a worker dies."""

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from dask.utils import format_bytes
from distributed import Client, Future
from distributed.client import FutureCancelledError
from distributed.scheduler import KilledWorker
from prefect.artifacts import create_progress_artifact, update_progress_artifact

from flows.artifacts import artifact_key
from flows.cluster import TERMINATED
from flows.errors import ClusterError
from flows.progress import Event, Reporter

PROGRESS_SECONDS = 5.0
"""A stage that takes longer has its progress on the dashboard, as often as this."""

_TRIES = 3


class DashboardProgress:
    """The progress callable of a stage that also keeps a progress bar on its task run's page."""

    def __init__(self, reporter: Reporter, name: str) -> None:
        self._reporter, self._name = reporter, name
        self._shown, self._artifact = time.monotonic(), None

    def __call__(self, done: int, total: int | None) -> None:
        """Tell that `done` of `total` parts are done."""
        self._reporter(done, total)
        self._show(done, total)

    def repeat(self, event: Event | None) -> None:
        """Put on the dashboard what a worker told."""
        if event is not None and event.done is not None:
            self._show(event.done, event.total)

    def _show(self, done: int, total: int | None) -> None:
        now = time.monotonic()
        if not total or now - self._shown < PROGRESS_SECONDS:
            return
        self._shown, percent = now, min(100.0, 100.0 * done / total)
        if self._artifact is None:
            made: Any = create_progress_artifact(percent, key=artifact_key(self._name), description=self._name)
            self._artifact = made
        else:
            update_progress_artifact(self._artifact, percent, description=self._name)


def awaited(future: Future, what: str, meanwhile: Callable[[], None]) -> Any:
    """The result of a task; `meanwhile` is called every few seconds.

    Raises:
        ClusterError: the worker died on it twice; else what the task raised.
    """
    # Waiting in `result` itself with a time-out can end, under load, in an error of Dask's own.
    ended = threading.Event()
    future.add_done_callback(lambda _: ended.set())
    while not ended.wait(PROGRESS_SECONDS) and not future.done():
        meanwhile()
    try:
        return future.result()
    except KilledWorker as error:
        raise died(what) from error


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


def task_bytes(client: Client) -> int | None:
    """Memory that the smallest worker may fill; None without limit."""
    limits = [worker["memory_limit"] for worker in client.scheduler_info(n_workers=-1)["workers"].values()]
    return int(min(limits) * TERMINATED) if limits and all(limits) else None


def check_bytes(client: Client, projected: int, what: str) -> None:
    """Refuse work that is projected to need more bytes in one process than a worker has.

    Raises:
        ClusterError: it does not fit.
    """
    limit = task_bytes(client)
    if limit is not None and projected > limit:
        raise ClusterError(
            f"{what} needs {format_bytes(projected)} in one process, its workers have {format_bytes(limit)}",
            "give a smaller region, use fewer --workers, or a --scheduler whose workers have more memory",
        )


def died(what: str) -> ClusterError:
    """The error for work that killed its workers."""
    return ClusterError(
        f"{what}: the worker process died, and so did the next one (in most cases the system was out of memory)",
        "run again, it goes on from here; if it recurs use fewer --workers, or give a smaller region",
    )
