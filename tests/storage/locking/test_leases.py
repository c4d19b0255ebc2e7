import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field, replace
from datetime import timedelta
from pathlib import Path

import obstore
import pytest
from obstore.exceptions import BaseError
from obstore.store import LocalStore, ObjectStore

from glint.storage.errors import StoreError
from glint.storage.locking import leases
from glint.storage.locking.leases import lease
from glint.storage.locking.locks import run_lock, run_owner
from glint.storage.locking.owner import LockOwner, ObjectBusy
from tests.storage.stores import MemoryLocation

KEY = "objects/duck/run.json"
SHORT_TERM = timedelta(seconds=1.5)
"""Longer than a busy machine lets a thread wait."""


def foreign_owner() -> LockOwner:
    return replace(LockOwner.this_process("other"), host="elsewhere")


def test_a_lease_keeps_the_second_run_out_until_it_is_released() -> None:
    location = MemoryLocation()
    with run_lock(location, "duck", run="nightly"):
        assert (owner := run_owner(location, "duck")) is not None and owner.run == "nightly"
        with pytest.raises(ObjectBusy, match="run nightly"), run_lock(location, "duck"):
            pass
        assert run_owner(location, "duck") == owner
    assert run_owner(location, "duck") is None and not list(obstore.list(location.store))
    with run_lock(location, "duck"):
        pass


@pytest.mark.long
def test_a_lease_lasts_while_it_is_renewed_and_a_term_longer() -> None:
    location = MemoryLocation()
    with lease(location, "duck", term=SHORT_TERM):
        time.sleep(1.5 * SHORT_TERM.total_seconds())
        with pytest.raises(ObjectBusy), lease(location, "duck", term=SHORT_TERM):
            pass
    obstore.put(location.store, KEY, foreign_owner().as_bytes())
    with pytest.raises(ObjectBusy, match="on elsewhere"), lease(location, "duck", term=SHORT_TERM):
        pass
    time.sleep(1.2 * SHORT_TERM.total_seconds())
    with lease(location, "duck", term=SHORT_TERM):
        pass


def test_a_dead_process_of_this_machine_owns_nothing() -> None:
    location = MemoryLocation()
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    obstore.put(location.store, KEY, replace(LockOwner.this_process("dead"), pid=process.pid).as_bytes())
    assert run_owner(location, "duck") is None
    with run_lock(location, "duck"):
        pass


def test_a_run_that_lost_its_lease_leaves_the_new_owner_alone() -> None:
    location = MemoryLocation()
    with run_lock(location, "duck"):
        obstore.put(location.store, KEY, foreign_owner().as_bytes())
    assert run_owner(location, "duck") is not None


@pytest.mark.long
def test_a_run_that_lost_its_lease_does_not_renew_it(monkeypatch: pytest.MonkeyPatch) -> None:
    location = MemoryLocation()
    with lease(location, "duck", term=timedelta(seconds=0.3)):
        obstore.put(location.store, KEY, foreign_owner().as_bytes())
        time.sleep(0.5)
        owner = LockOwner.from_bytes(bytes(obstore.get(location.store, KEY).bytes()))
        assert owner is not None and owner.host == "elsewhere"


@pytest.mark.long
def test_a_renewal_that_fails_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    renewed = threading.Event()

    def answers(store: ObjectStore, key: str) -> None:
        monkeypatch.undo()
        renewed.set()
        raise BaseError("the store does not answer")

    location = MemoryLocation()
    with lease(location, "duck", term=timedelta(seconds=0.3)):
        before = obstore.head(location.store, KEY)["last_modified"]
        monkeypatch.setattr(leases, "_read", answers)
        assert renewed.wait(60)
        time.sleep(0.3)
        assert obstore.head(location.store, KEY)["last_modified"] > before


@dataclass(frozen=True, slots=True)
class FolderLocation(MemoryLocation):
    """The same in a folder, which can be made to fail."""

    folder: Path = field(kw_only=True)

    def obstore(self) -> ObjectStore:
        return LocalStore(self.folder)


def test_a_run_succeeds_though_its_lease_cannot_be_released(tmp_path: Path) -> None:
    location = FolderLocation(folder=tmp_path)
    with run_lock(location, "duck"):
        folder = tmp_path / "objects" / "duck"
        folder.rename(tmp_path / "moved")
        folder.symlink_to(folder)
        with pytest.raises(StoreError):
            run_owner(location, "duck")


def test_a_torn_lease_is_taken_over() -> None:
    location = MemoryLocation()
    obstore.put(location.store, KEY, b"{")
    with run_lock(location, "duck"):
        pass


def test_of_concurrent_claims_a_single_one_succeeds() -> None:
    location, concurrent, maximum, completed = MemoryLocation(), [0], [0], []

    def work() -> None:
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            try:
                with run_lock(location, "duck"):
                    concurrent[0] += 1
                    maximum[0] = max(maximum[0], concurrent[0])
                    time.sleep(0.01)
                    concurrent[0] -= 1
                    completed.append(True)
                    return
            except ObjectBusy:
                time.sleep(0.005)

    workers = [threading.Thread(target=work) for _ in range(4)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert maximum == [1] and len(completed) == 4
