"""The Dask cluster of a run: the one at a given scheduler, else a local one of processes with one thread.

A scheduler runs the code of whoever may talk to it. A local cluster therefore talks TLS, with a certificate that exists
only in the memory of its processes: neither another user of the machine nor a web page can use it.

It starts in the background: `Cluster(..)` returns at once, `client` waits for it. A Dask task gets one processor and
its libraries one thread. Nothing spills, so memory needs are checked before a task is sent.
"""

import atexit
import importlib
import logging
import multiprocessing
import socket
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from types import TracebackType

import dask
from dask.system import CPU_COUNT
from distributed import Client, LocalCluster, Scheduler, Security, Worker
from distributed.comm import CommClosedError
from distributed.core import Status
from distributed.deploy.spec import close_clusters
from distributed.diagnostics.plugin import WorkerPlugin
from distributed.scheduler import DEFAULT_EXTENSIONS
from distributed.system import MEMORY_LIMIT

from glint.flows.errors import ClusterError
from glint.flows.runtime.environment import (
    DASK_SETTINGS,
    LOCAL_DASK_SETTINGS,
    WEBSOCKET_ORIGINS,
    prepare_environment,
    start_forkserver,
)
from glint.flows.runtime.scheduler_client import connected_client
from glint.flows.runtime.signals import raise_if_interrupted

MEMORY_SHARE = 0.8
"""The part of the machine's memory that the workers of a local cluster share."""

POLL_SECONDS = 0.2
"""Interval at which a wait for the cluster looks whether the run was interrupted."""
STOP_SECONDS = 5.0
"""Time that Dask may take to stop a local cluster; what is stored is whole, whenever a worker is killed."""
WORKERS_SECONDS = 120
"""Time for which a given scheduler's first worker is awaited."""
DASHBOARD_SECONDS = 10.0
"""Time after the start of a local cluster at which Dask's dashboard is added: importing its plots would delay the first
task of every run."""
SCHEDULER_EXTENSIONS = {name: extension for name, extension in DEFAULT_EXTENSIONS.items() if name != "spans"}
"""Extensions of a local scheduler. That of spans, the only one that workers have, would keep a record of every task."""


@dataclass
class WarmUpPlugin(WorkerPlugin):
    """Prepares a worker for its first task: one thread for libraries, modules imported, their kernels loaded.

    A module may have a function `warm_up()` that calls its compiled kernels once on tiny arrays. Workers of a local
    cluster (owned) do not log errors: the run does.
    """

    modules: tuple[str, ...]
    owned: bool
    name = "glint-warm-up"

    def setup(self, worker: Worker) -> None:
        """Prepare the worker; Dask calls it in each worker that starts, replacements included."""
        from glint.tasks.engine.threads import use_one_thread

        if self.owned:
            logging.getLogger("distributed.worker").setLevel(logging.CRITICAL)
        use_one_thread()
        for name in self.modules:
            module = importlib.import_module(name)
            if hasattr(module, "warm_up"):
                module.warm_up()


class Cluster:
    """The cluster of a run; a context manager that stops what it started.

    `scheduler` is the address of a running one (tls://host:8786, with the certificates that Dask's configuration names,
    or tcp://host:8786), None for a local cluster of `workers` processes (as many as processors). `modules` are imported
    by every worker before its first task.
    """

    def __init__(self, scheduler: str | None = None, workers: int | None = None, modules: Sequence[str] = ()) -> None:
        prepare_environment()
        self._scheduler, self._workers, self._modules = scheduler, workers or CPU_COUNT, tuple(modules)
        self._cluster: LocalCluster | None = None
        self._client: Client | None = None
        self._dashboard: threading.Timer | None = None
        self._failure: BaseException | None = None
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._start, name="glint-cluster", daemon=True)
        self._thread.start()

    def __enter__(self) -> "Cluster":
        """Return the cluster, which may still be starting."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Stop the cluster."""
        if error is not None:
            # Otherwise each pending result is logged when the client closes, and each call that is cancelled before
            # it began as an error.
            for reporter in ("asyncio", "tornado.application"):
                logging.getLogger(reporter).setLevel(logging.CRITICAL)
        self.close()

    @property
    def client(self) -> Client:
        """The client of this process, for all its threads; waits for the cluster, and is closed with it.

        Workers of a local cluster may still be warming up: they take their first task when they are done.

        Raises:
            ClusterError: the scheduler does not answer, or no worker came.
        """
        while not self._ready.wait(POLL_SECONDS):
            raise_if_interrupted()
        if self._failure is not None:
            raise self._failure
        assert self._client is not None
        return self._client

    @property
    def address(self) -> str:
        """The scheduler's address, for clients in other processes."""
        return str(self.client.scheduler.address)

    @property
    def dashboard_url(self) -> str:
        """Dask's own dashboard, empty if it has none."""
        return str(self.client.dashboard_link or "")

    @property
    def workers(self) -> int:
        """Current number of workers."""
        return len(self.client.nthreads())

    @property
    def description(self) -> str:
        """The number of workers, and the address of Dask's dashboard."""
        dashboard = f", Dask's dashboard {self.dashboard_url}" if self.dashboard_url else ""
        return f"workers {self.workers}{dashboard}"

    def close(self) -> None:
        """Stop the local cluster and its processes, or disconnect from the given one. Safe to call twice."""
        closing = threading.Thread(target=self._close, name="glint-cluster-end", daemon=True)
        closing.start()
        closing.join(STOP_SECONDS)
        if closing.is_alive():
            # Dask waits for workers that are starting, in an interrupted run without end, and again at exit.
            atexit.unregister(close_clusters)
            logging.disable(logging.ERROR)
            for worker in multiprocessing.active_children():
                worker.kill()

    def _close(self) -> None:
        self._thread.join()
        if self._dashboard is not None:
            self._dashboard.cancel()
        client, self._client = self._client, None
        cluster, self._cluster = self._cluster, None
        if client is not None:
            client.close()
        if cluster is not None:
            cluster.close()

    def _start(self) -> None:
        try:
            if self._scheduler is None:
                self._start_local()
            else:
                self._client = self._given(self._scheduler)
        except BaseException as failure:
            self._failure = failure
        finally:
            self._ready.set()

    def _start_local(self) -> None:
        start_forkserver()
        dashboard = _free_address()
        dask.config.set(DASK_SETTINGS | LOCAL_DASK_SETTINGS | {WEBSOCKET_ORIGINS: [dashboard]})
        self._cluster = LocalCluster(
            n_workers=self._workers,
            threads_per_worker=1,
            processes=True,
            memory_limit=int(MEMORY_LIMIT * MEMORY_SHARE / self._workers),
            host="127.0.0.1",
            dashboard_address=dashboard,
            scheduler_kwargs={"dashboard": False, "extensions": SCHEDULER_EXTENSIONS},
            extensions={},
            security=Security.temporary(),
            silence_logs=logging.ERROR,
        )
        self._client = Client(self._cluster, set_as_default=False)
        # The run goes on while its workers warm up, which takes as long as its first requests to the server.
        self._ready.set()
        # A worker that dies meanwhile is replaced, and the scheduler tells the next one of the plug-in.
        with suppress(CommClosedError):
            self._client.register_plugin(WarmUpPlugin(self._modules, owned=True))
        self._dashboard = threading.Timer(DASHBOARD_SECONDS, _add_dashboard, [self._cluster.scheduler])
        self._dashboard.daemon = True
        self._dashboard.start()

    def _given(self, address: str) -> Client:
        client = connected_client(address)
        try:
            client.wait_for_workers(1, timeout=WORKERS_SECONDS)
            client.register_plugin(WarmUpPlugin(self._modules, owned=False))
        except TimeoutError:
            client.close()
            raise ClusterError(
                f"the Dask scheduler at {address} has no workers",
                f"start some with `dask worker {address} --nthreads 1`",
            ) from None
        except Exception as error:
            with suppress(Exception):
                client.unregister_worker_plugin(WarmUpPlugin.name)
            client.close()
            raise ClusterError(
                f"the Dask workers at {address} cannot run Glint ({error})", "install this version of Glint on each"
            ) from error
        return client


def _add_dashboard(scheduler: Scheduler) -> None:
    """Add Dask's pages to a scheduler of this process, as it does itself if it starts with them."""
    from distributed.dashboard.scheduler import connect

    def add() -> None:
        if scheduler.status == Status.running:
            connect(scheduler.http_application, scheduler.http_server, scheduler)

    with suppress(RuntimeError):  # the run has ended, and with it the loop
        scheduler.loop.add_callback(add)


def _free_address() -> str:
    """Return host:port of a free loopback port."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return f"127.0.0.1:{server.getsockname()[1]}"
