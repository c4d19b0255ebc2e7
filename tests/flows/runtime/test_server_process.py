"""A run keeps the server alive, whatever one attempt ends in."""

import threading
from pathlib import Path

import pytest

from glint.flows.runtime import server_process
from glint.flows.runtime.server_process import State, keep


def test_a_restart_that_fails_is_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ended, attempts = threading.Event(), list[Path]()
    folder = tmp_path / "home" / "server" / "here"
    folder.mkdir(parents=True)

    def spawn(folder: Path, previous: State | None = None) -> State:
        attempts.append(folder)
        if len(attempts) == 1:
            raise OSError("no more processes")
        ended.set()
        assert previous is not None
        return previous

    monkeypatch.setattr(server_process, "KEEPER_SECONDS", 0.01)
    monkeypatch.setattr(server_process, "read_state", lambda folder: State("http://127.0.0.1:1/api", (0, 0.0), "", ""))
    monkeypatch.setattr(server_process, "is_alive", lambda pid, start_time: False)
    monkeypatch.setattr(server_process, "spawn", spawn)
    keep(folder, ended)
    assert len(attempts) == 2
