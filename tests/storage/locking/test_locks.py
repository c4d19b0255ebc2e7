import fcntl
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from multiprocessing.context import SpawnProcess
from multiprocessing.synchronize import Event
from pathlib import Path

import pytest

from glint.storage.locations.location import Location
from glint.storage.locking import locks
from glint.storage.locking.locks import mutation_lock, run_lock, run_owner
from glint.storage.locking.owner import LockOwner, ObjectBusy
from tests.storage.stores import local_store

SPAWN = multiprocessing.get_context("spawn")


@pytest.fixture
def location(tmp_path: Path) -> Location:
    return local_store(tmp_path / "store")


def _hold(location: Location, held: Event, release: Event) -> None:
    with run_lock(location, "duck", run="nightly"):
        held.set()
        release.wait(60)


@contextmanager
def running_process(location: Location) -> Iterator[tuple[SpawnProcess, Event]]:
    """Yield a process that holds the run lock, and the event on which it releases it."""
    held, release = SPAWN.Event(), SPAWN.Event()
    process = SPAWN.Process(target=_hold, args=(location, held, release))
    process.start()
    try:
        assert held.wait(60)
        yield process, release
    finally:
        # A killed process would never answer the event.
        if process.is_alive():
            release.set()
        process.join()


@pytest.mark.long
def test_a_second_run_is_refused_at_once_and_names_the_owner(
    location: Location, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(locks, "MAX_STATUS_CHECK_SECONDS", 30.0)
    with running_process(location) as (process, release):
        started = time.monotonic()
        with (
            pytest.raises(ObjectBusy, match=rf"process {process.pid} on .* since 20.*, run nightly"),
            run_lock(location, "duck"),
        ):
            pass
        assert time.monotonic() - started < locks.MAX_STATUS_CHECK_SECONDS
        owner = run_owner(location, "duck")
        assert owner is not None and owner.pid == process.pid and owner.run == "nightly"
        with run_lock(location, "cup"):
            pass
        assert run_owner(location, "duck") == owner
        release.set()
        process.join()
        assert run_owner(location, "duck") is None
        with run_lock(location, "duck"):
            pass


@pytest.mark.long
def test_a_killed_run_leaves_no_lock(location: Location) -> None:
    with running_process(location) as (process, _):
        assert process.pid is not None
        os.kill(process.pid, signal.SIGKILL)
        process.join()
        assert run_owner(location, "duck") is None
        with run_lock(location, "duck"):
            pass


def test_a_status_check_does_not_disturb_the_run_after_a_killed_one(location: Location) -> None:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    path = Path(location.path) / "objects" / "duck" / "run.lock"
    path.parent.mkdir(parents=True)
    path.write_bytes(replace(LockOwner.this_process("killed"), pid=process.pid).as_bytes())
    with path.open("rb") as handle:
        fcntl.flock(handle, fcntl.LOCK_SH)
        threading.Timer(0.3, fcntl.flock, (handle, fcntl.LOCK_UN)).start()
        with run_lock(location, "duck"):
            assert (owner := run_owner(location, "duck")) is not None and not owner.is_dead()


def test_a_status_check_does_not_disturb_another_after_a_killed_run(location: Location) -> None:
    path = Path(location.path) / "objects" / "duck" / "run.lock"
    path.parent.mkdir(parents=True)
    path.write_bytes(LockOwner.this_process("killed").as_bytes())
    with path.open("rb") as handle:
        fcntl.flock(handle, fcntl.LOCK_SH)
        assert run_owner(location, "duck") is None


def test_a_status_check_does_not_disturb_the_next_run_of_a_process(location: Location) -> None:
    with run_lock(location, "duck", run="first"):
        pass
    with (Path(location.path) / "objects" / "duck" / "run.lock").open("rb") as handle:
        fcntl.flock(handle, fcntl.LOCK_SH)
        threading.Timer(0.3, fcntl.flock, (handle, fcntl.LOCK_UN)).start()
        with run_lock(location, "duck", run="second"):
            assert (owner := run_owner(location, "duck")) is not None and owner.run == "second"


def test_status_checks_do_not_disturb_a_run(location: Location) -> None:
    stop = threading.Event()

    def check() -> None:
        while not stop.is_set():
            run_owner(location, "duck")

    checker = threading.Thread(target=check)
    with run_lock(location, "duck"):
        pass
    checker.start()
    try:
        for _ in range(300):
            with run_lock(location, "duck"):
                pass
    finally:
        stop.set()
        checker.join()


def test_mutations_of_an_object_exclude_one_another(location: Location) -> None:
    concurrent, maximum = [0], [0]

    def mutate() -> None:
        for _ in range(20):
            with mutation_lock(location, "duck"):
                concurrent[0] += 1
                maximum[0] = max(maximum[0], concurrent[0])
                time.sleep(0.0005)
                concurrent[0] -= 1

    threads = [threading.Thread(target=mutate) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert maximum == [1]


@pytest.mark.parametrize(
    "changes",
    [{"pid": "12"}, {"pid": 1.5}, {"pid": True}, {"pid": 10**30}, {"pid": 0}, {"pid": -1}, {"since": 3}, {"run": None}],
)
def test_a_record_that_no_process_wrote_names_no_owner(changes: dict[str, object]) -> None:
    fields = {"pid": 12, "host": "here", "since": "2026-01-01", "run": ""}
    assert LockOwner.from_bytes(json.dumps(fields).encode()) == LockOwner(12, "here", "2026-01-01")
    assert LockOwner.from_bytes(json.dumps(fields | changes).encode()) is None


def test_only_a_process_of_this_machine_that_ended_is_dead(monkeypatch: pytest.MonkeyPatch) -> None:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    alive = LockOwner.this_process("")
    ended = replace(alive, pid=process.pid)
    assert ended.is_dead() and not alive.is_dead()
    assert not replace(ended, host="elsewhere").is_dead(), "nobody here knows the processes of another machine"

    def refuse(pid: int, number: int) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "kill", refuse)
    assert not alive.is_dead(), "it runs, under another user"
