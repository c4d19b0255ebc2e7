import subprocess
import sys
import threading
import time
from dataclasses import replace
from datetime import timedelta

import obstore
import pytest

from glint.storage.locking.leases import lease
from glint.storage.locking.locks import run_holder, run_lock
from glint.storage.locking.owner import Holder, ObjectBusy
from tests.storage.stores import MemoryPlace

KEY = "objects/duck/run.json"
SHORT = timedelta(seconds=0.3)


def elsewhere() -> Holder:
    return replace(Holder.this_process("other"), host="elsewhere")


def test_one_run_holds_the_object_and_the_next_waits() -> None:
    place, told, entered = MemoryPlace(), [], threading.Event()

    def wait() -> None:
        with run_lock(place, "duck", wait_seconds=30, on_wait=told.append):
            entered.set()

    with run_lock(place, "duck", run="nightly"):
        assert (holder := run_holder(place, "duck")) is not None and holder.run == "nightly"
        with pytest.raises(ObjectBusy, match="run nightly"), run_lock(place, "duck"):
            pass
        waiter = threading.Thread(target=wait)
        waiter.start()
        while not told:
            time.sleep(0.01)
        assert not entered.is_set()
    waiter.join()
    assert entered.is_set() and told == [holder]
    assert run_holder(place, "duck") is None and not list(obstore.list(place.store))


def test_a_lease_lasts_while_it_is_renewed_and_a_term_longer() -> None:
    place = MemoryPlace()
    with lease(place, "duck", term=SHORT):
        time.sleep(3 * SHORT.total_seconds())
        with pytest.raises(ObjectBusy), lease(place, "duck", term=SHORT):
            pass
    obstore.put(place.store, KEY, elsewhere().as_bytes())
    with pytest.raises(ObjectBusy, match="on elsewhere"), lease(place, "duck", term=SHORT):
        pass
    with lease(place, "duck", wait_seconds=30, term=SHORT):
        pass


def test_a_dead_process_of_this_machine_holds_nothing() -> None:
    place = MemoryPlace()
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    obstore.put(place.store, KEY, replace(Holder.this_process("dead"), pid=process.pid).as_bytes())
    assert run_holder(place, "duck") is None
    with run_lock(place, "duck"):
        pass


def test_whoever_lost_the_lease_leaves_the_new_holder_alone() -> None:
    place = MemoryPlace()
    with run_lock(place, "duck"):
        obstore.put(place.store, KEY, elsewhere().as_bytes())
    assert run_holder(place, "duck") is not None


def test_a_torn_lease_is_taken_over() -> None:
    place = MemoryPlace()
    obstore.put(place.store, KEY, b"{")
    with run_lock(place, "duck"):
        pass


def test_many_claim_at_once_and_one_has_it() -> None:
    place, inside, most = MemoryPlace(), [0], [0]

    def work() -> None:
        with run_lock(place, "duck", wait_seconds=60):
            inside[0] += 1
            most[0] = max(most[0], inside[0])
            time.sleep(0.01)
            inside[0] -= 1

    workers = [threading.Thread(target=work) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert most == [1]
