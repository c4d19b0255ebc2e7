import multiprocessing
import os
import signal
import threading
import time
from multiprocessing.synchronize import Event
from pathlib import Path

import pytest

from glint.storage.locations.location import Location
from glint.storage.locking.locks import Holder, ObjectBusy, mutation_lock, run_holder, run_lock
from tests.storage.stores import local_place

SPAWN = multiprocessing.get_context("spawn")


@pytest.fixture
def place(tmp_path: Path) -> Location:
    return local_place(tmp_path / "store")


def _hold(place: Location, held: Event, release: Event) -> None:
    with run_lock(place, "duck", run="nightly"):
        held.set()
        release.wait(60)


def test_a_second_run_is_told_who_holds_the_object(place: Location) -> None:
    held, release = SPAWN.Event(), SPAWN.Event()
    other = SPAWN.Process(target=_hold, args=(place, held, release))
    other.start()
    assert held.wait(60)
    with (
        pytest.raises(ObjectBusy, match=rf"process {other.pid} on .* since 20.*, run nightly"),
        run_lock(place, "duck"),
    ):
        pass
    holder = run_holder(place, "duck")
    assert holder is not None and holder.pid == other.pid
    with run_lock(place, "cup"):
        pass
    told: list[Holder] = []
    entered = threading.Event()

    def wait() -> None:
        with run_lock(place, "duck", wait_seconds=60, on_wait=told.append):
            entered.set()

    waiter = threading.Thread(target=wait)
    waiter.start()
    while not told:
        time.sleep(0.01)
    assert told == [holder] and not entered.is_set()
    release.set()
    other.join()
    waiter.join()
    assert told == [holder], "told once"
    assert entered.is_set(), "it went on when the other run had ended"
    assert run_holder(place, "duck") is None


def test_a_killed_run_leaves_no_lock(place: Location) -> None:
    held, release = SPAWN.Event(), SPAWN.Event()
    other = SPAWN.Process(target=_hold, args=(place, held, release))
    other.start()
    assert held.wait(60) and other.pid is not None
    os.kill(other.pid, signal.SIGKILL)
    other.join()
    assert run_holder(place, "duck") is None
    with run_lock(place, "duck"):
        pass


def test_looking_who_runs_does_not_disturb_a_run(place: Location) -> None:
    stop = threading.Event()

    def look() -> None:
        while not stop.is_set():
            run_holder(place, "duck")

    looker = threading.Thread(target=look)
    with run_lock(place, "duck"):
        pass
    looker.start()
    try:
        for _ in range(300):
            with run_lock(place, "duck"):
                pass
    finally:
        stop.set()
        looker.join()


def test_mutations_of_one_object_take_turns(place: Location) -> None:
    inside, most = [0], [0]

    def mutate() -> None:
        for _ in range(20):
            with mutation_lock(place, "duck"):
                inside[0] += 1
                most[0] = max(most[0], inside[0])
                time.sleep(0.0005)
                inside[0] -= 1

    threads = [threading.Thread(target=mutate) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == [1]
