"""Glint's home, the settings of libraries, and the process that passes them to workers.

Prefect, numba and OpenMP read theirs once, at import, so `prepare_environment` is called before they are imported.
"""

import os
from pathlib import Path

ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
"""One thread per process: there are as many workers as processors."""

WORKER_MEMORY = {"MALLOC_TRIM_THRESHOLD_": 64 << 20, "MALLOC_MMAP_THRESHOLD_": 16 << 20}
"""Arrays of some megabytes are allocated all the time; returning their memory to the system each time, as with Dask's
own setting, costs a tenth of a worker's time."""

FORKED = ("glint.tasks.forked", "distributed", "av")
"""Modules that are imported before workers are forked: the large ones whose import, unlike icechunk's, starts no
threads, which a fork does not copy. The first one loads compiled kernels."""

TERMINATED = 0.95
"""Share of its memory limit at which a worker is terminated."""

DASK_SETTINGS = {
    # A task that killed two workers is the cause of their deaths: it fails, other tasks continue.
    "distributed.scheduler.allowed-failures": 1,
    # A graph cut holds the GIL for minutes; the death of a local worker is noticed without heartbeats.
    "distributed.scheduler.worker-ttl": None,
    # The stages of a capture may be queued at a busy worker; an idle one takes them over at once.
    "distributed.scheduler.work-stealing-interval": "100ms",
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": TERMINATED,
    # At its default intervals, monitoring costs Dask a twentieth of two processors, all through the run. A worker that
    # outgrows its memory between two looks is killed by the system, with the same consequence.
    "distributed.worker.memory.monitor-interval": "500ms",
    "distributed.worker.profile.interval": "200ms",
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.client.scheduler-info-interval": "10s",
    # Each of these logs, one for every connection, holds what it has sent, with the catalogue's entry of each capture.
    # That of profiles gets an entry in every cycle: these cover ten minutes.
    "distributed.admin.low-level-log-length": 20,
    "distributed.worker.profile.cycle": "30s",
    "distributed.scheduler.dashboard.bokeh-application.check_unused_sessions_milliseconds": 10_000,
    # The memory manager would remove copies of what is sent to all workers on purpose.
    "distributed.scheduler.active-memory-manager.start": False,
    **{f"distributed.nanny.pre-spawn-environ.{name}": value for name, value in WORKER_MEMORY.items()},
}
"""Settings of Dask; deploy/ repeats them in the environment of its containers."""

WEBSOCKET_ORIGINS = "distributed.scheduler.dashboard.bokeh-application.allow_websocket_origin"
"""Setting of Dask: the origins whose pages may read its dashboard, all of them by default."""

LOCAL_DASK_SETTINGS = {
    # The place of a dead worker is given up when it was absent for so long. A replacement takes more than Dask's 15 s
    # on a busy machine, and one that dies again in that time counts as absent all the while.
    "distributed.deploy.lost-worker-timeout": "1 day",
    # Workers are forked from a process that has imported what they need.
    "distributed.worker.multiprocessing-method": "forkserver",
}
"""Settings of Dask that only a local cluster needs besides DASK_SETTINGS."""

_PREFECT = {
    "DO_NOT_TRACK": "1",
    "PREFECT_SERVER_ANALYTICS_ENABLED": "false",
    "PREFECT_SERVER_EPHEMERAL_ENABLED": "false",
    # The console shows progress and errors in a sentence; the dashboard has all log lines and tracebacks.
    "PREFECT_LOGGING_HANDLERS_CONSOLE_LEVEL": "CRITICAL",
    "PREFECT_LOGGING_INTERNAL_LEVEL": "CRITICAL",
    "PREFECT_LOGGING_TO_API_WHEN_MISSING_FLOW": "ignore",
    # One request for the log lines of five seconds rather than two; what waits is sent when a flow run ends.
    "PREFECT_LOGGING_TO_API_BATCH_INTERVAL": "5",
}


def glint_home() -> Path:
    """Return the folder of Glint's own server: $GLINT_HOME, else ~/.glint."""
    return Path(os.environ.get("GLINT_HOME") or Path.home() / ".glint").absolute()


def prepare_environment(
    api_url: str | None = None, prefect_home: Path | None = None, authentication: str | None = None
) -> None:
    """Set variables that libraries read at import, for this process and its workers; the user's own values are kept.

    `api_url`, `prefect_home` and `authentication` (user:password) belong to Glint's own server and replace earlier
    values.
    """
    for name, value in (ONE_THREAD | _PREFECT).items():
        os.environ.setdefault(name, value)
    if api_url is not None:
        os.environ["PREFECT_API_URL"] = api_url
    if prefect_home is not None:
        os.environ["PREFECT_HOME"] = str(prefect_home)
    if authentication is not None:
        os.environ["PREFECT_API_AUTH_STRING"] = authentication


def start_forkserver() -> None:
    """Start the process from which the workers of a local cluster are forked, unless it runs.

    It imports FORKED, which takes longer than whatever else a run begins with. An interrupt at the terminal, which
    reaches all processes, is for this one to handle: the others never receive it.
    """
    import multiprocessing
    import signal
    from multiprocessing import forkserver, resource_tracker

    prepare_environment()
    # As Dask would before its first worker: memory is set up when a process starts, and forks inherit it.
    os.environ.update({name: str(value) for name, value in WORKER_MEMORY.items()})
    multiprocessing.get_context("forkserver").set_forkserver_preload([*FORKED])
    resource_tracker.ensure_running()  # else the forkserver starts it, which unblocks signals
    received = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, received)
