"""Runs that the page starts: the ordinary `glint run` of one capture, in a process of its own, with its progress.

The process is independent of the server: it goes on where the server ends.
"""

import json
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from time import time
from typing import Any

KEPT_LINES = 40
"""Lines of a run that are kept for the page, the newest ones."""


@dataclass
class Run:
    """A run of one capture. state: running, done or failed; lines: what it reported, as events of `glint run --json`;
    stages: seconds by stage that has ended, None where its result was stored already."""

    capture: str
    started: float = field(default_factory=time)
    state: str = "running"
    stage: str = ""
    done: int = 0
    total: int | None = None
    unit: str = ""
    error: str = ""
    remedy: str = ""
    version: str = ""
    stages: dict[str, float | None] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return the run as JSON values."""
        return asdict(self) | {"seconds": round(time() - self.started, 1)}


class Runs:
    """The runs of a server, one at a time for each capture. revision: a number that grows with every event."""

    def __init__(self, store: str) -> None:
        self._store = store
        self._runs: dict[str, Run] = {}
        self._lock = threading.Lock()
        self.revision = 0

    def of(self, capture: str) -> Run | None:
        """Return the newest run of OBJECT/CAPTURE that the page has started, None where it has started none."""
        return self._runs.get(capture)

    def start(self, catalogue: str, capture: str) -> Run:
        """Start the run of OBJECT/CAPTURE, or return the one that is going on."""
        with self._lock:
            known = self._runs.get(capture)
            if known is not None and known.state == "running":
                return known
            run = self._runs[capture] = Run(capture)
        command = [sys.executable, "-m", "glint", "run", catalogue, "--store", self._store, "--only", capture, "--json"]
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            start_new_session=True,
        )  # fmt: skip
        threading.Thread(target=self._follow, args=(run, process), name=f"run-{capture}", daemon=True).start()
        return run

    def _follow(self, run: Run, process: "subprocess.Popen[str]") -> None:
        for _ in _events(run, process):
            self.revision += 1


def _events(run: Run, process: "subprocess.Popen[str]") -> Iterator[None]:
    """Read what a run reports until it ends; yield after each change."""
    errors: deque[str] = deque(maxlen=KEPT_LINES)
    assert process.stdout is not None and process.stderr is not None
    reader = threading.Thread(target=errors.extend, args=(process.stderr,), daemon=True)
    reader.start()
    for line in process.stdout:
        try:
            event = json.loads(line)
        except ValueError:
            continue
        if isinstance(event, dict):
            note(run, event)
            yield
    status = process.wait()
    reader.join(1.0)
    if run.state == "running":
        run.state = "done" if status == 0 else "failed"
    if status != 0 and not run.error:
        lines = [line.strip() for line in errors if line.strip()]
        run.error = next((line.removeprefix("glint: ") for line in lines if line.startswith("glint: ")), "it ended")
        run.remedy = next((line.removeprefix("-> ") for line in lines if line.startswith("-> ")), "see the dashboard")
    yield


def note(run: Run, event: dict[str, Any]) -> None:
    """Take over what an event of `glint run --json` says of the run's capture."""
    kind = event.get("kind")
    if kind == "summary":
        for row in event.get("captures", ()):
            if row.get("capture") == run.capture:
                run.state = "failed" if row["error"] else "done"
                run.error, run.remedy, run.version = row["error"], row["remedy"], row["version"]
    elif event.get("capture") == run.capture:
        if kind == "progress":
            run.stage, run.done = event["stage"], event.get("done", 0)
            run.total, run.unit = event.get("total"), event.get("unit", "")
        elif kind == "stage":
            run.stages[event["stage"]] = None if event.get("cached") else event["seconds"]
        elif kind == "failed":
            run.error = event["text"]
