"""Runs that the page starts: the ordinary `glint run` of a capture or object, in a process of its own, with progress.

The process is independent of the server: it outlives the server, and so writes to files, not to pipes.
"""

import json
import logging
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field
from tempfile import TemporaryFile
from typing import IO, Any

from glint.flows.review.remedies import on_page

LOG = logging.getLogger(__name__)
KEPT_BYTES = 20_000
"""Bytes of a failed run's errors in which its reason is looked for, the newest ones."""
READ_SECONDS = 0.2
"""Interval at which a run's reports are read."""
AGAIN = "run again: it goes on where it stopped; the dashboard has the details"
"""What to do about a run that has ended without saying why."""


@dataclass
class Run:
    """A run of one capture (`capture` is OBJECT/CAPTURE), or of all captures of an object (OBJECT).

    state: running, done, failed or stopped; is_stopping: whether a person has asked it to stop; ended: seconds since
    the epoch, None while it runs; share: part of its time that has passed, seconds_left: until it ends, both None
    before they are known, and for an object; stages: seconds by stage that has ended, None where its result was stored
    already. Of an object, names of stages and errors begin with the capture.
    """

    capture: str
    started: float = field(default_factory=time.time)
    ended: float | None = None
    state: str = "running"
    stage: str = ""
    done: int = 0
    total: int | None = None
    unit: str = ""
    share: float | None = None
    seconds_left: float | None = None
    error: str = ""
    remedy: str = ""
    version: str = ""
    stages: dict[str, float | None] = field(default_factory=dict)
    is_stopping: bool = False

    def end(self, state: str) -> None:
        """Record that the run has ended, as done or failed; one that fails after it was asked to stop is stopped."""
        self.ended, self.state = time.time(), "stopped" if state == "failed" and self.is_stopping else state

    def to_json(self) -> dict[str, Any]:
        """Return the run as JSON values."""
        seconds = round((self.ended or time.time()) - self.started, 1)
        return asdict(self) | {"seconds": seconds, "error": on_page(self.error), "remedy": on_page(self.remedy)}


def run_json(run: Run | None) -> dict[str, Any] | None:
    """Return a run as JSON values, None for none."""
    return None if run is None else run.to_json()


class Runs:
    """The runs of a server, one at a time for each capture or object.

    revision: a number that grows with every event.
    """

    def __init__(self, store: str, scheduler: str | None = None) -> None:
        self._options = ["--store", store, *(["--scheduler", scheduler] if scheduler else [])]
        self._runs: dict[str, Run] = {}
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        self._lock = threading.Lock()
        self.revision = 0

    def of(self, capture: str) -> Run | None:
        """Return the newest run of OBJECT/CAPTURE or OBJECT that the page has started, None without one."""
        return self._runs.get(capture)

    def start(self, catalogue: str, capture: str) -> Run:
        """Start the run of OBJECT/CAPTURE or OBJECT, or return the one that is going on."""
        with self._lock:
            known = self._runs.get(capture)
            if known is not None and known.state == "running":
                return known
            run = self._runs[capture] = Run(capture)
        command = [sys.executable, "-m", "glint", "run", catalogue, *self._options, "--only", capture, "--json"]
        threading.Thread(target=self._follow, args=(run, command), name=f"run-{capture}", daemon=True).start()
        return run

    def stop(self, capture: str) -> Run | None:
        """Interrupt the run of OBJECT/CAPTURE or OBJECT that is going on, and return it; None: there was none.

        What is finished is kept, as after Ctrl-C. The run ends within seconds, not at once.
        """
        # SIGTERM, not SIGINT: a server that was started in the background ignores that, and so do its processes until
        # they handle it themselves.
        with self._lock:
            run = self._runs.get(capture)
            if run is not None and run.state == "running" and not run.is_stopping:
                run.is_stopping = True
                if capture in self._processes:
                    self._processes[capture].terminate()
        return run

    def _follow(self, run: Run, command: Sequence[str]) -> None:
        """Start a run, and take over what it reports until it ends."""
        try:
            # The files have no name: they are gone when both processes have ended, however they do.
            with TemporaryFile() as output, TemporaryFile() as errors:
                process = subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, stdout=output, stderr=errors, start_new_session=True
                )
                with self._lock:
                    self._processes[run.capture] = process
                    if run.is_stopping:
                        process.terminate()
                for _ in _events(run, process, output, errors):
                    self._changed()
        except OSError as error:
            self._failed(run, f"it did not start: {error}", "free memory and disk space")
        except Exception as error:
            # A report that this server does not understand must not leave the run as one that goes on for ever.
            LOG.exception("the reports of the run of %s cannot be followed", run.capture)
            self._failed(run, f"its reports cannot be followed: {error!r}", "it may go on: see the dashboard")
        finally:
            with self._lock:
                # The next run may have begun already, and its process is the one to stop then.
                if self._runs.get(run.capture) is run:
                    self._processes.pop(run.capture, None)

    def _failed(self, run: Run, error: str, remedy: str) -> None:
        run.error, run.remedy = error, remedy
        run.end("failed")
        self._changed()

    def _changed(self) -> None:
        with self._lock:
            self.revision += 1


def _events(run: Run, process: "subprocess.Popen[bytes]", output: IO[bytes], errors: IO[bytes]) -> Iterator[None]:
    """Read what a run reports until it ends; yield after each change."""
    for line in _lines(process, output):
        try:
            event = json.loads(line)
        except ValueError:
            continue
        if isinstance(event, dict):
            note(run, event)
            yield
    status = process.wait()
    if run.state != "running":
        return  # its summary has said how it ended; the exit status counts a failure of the object's model, too
    run.end("done" if status == 0 else "failed")
    if run.state == "failed" and not run.error:
        length = os.fstat(errors.fileno()).st_size
        text = os.pread(errors.fileno(), KEPT_BYTES, max(0, length - KEPT_BYTES)).decode(errors="replace")
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        run.error = next((line.removeprefix("glint: ") for line in lines if line.startswith("glint: ")), "it ended")
        run.remedy = next((line.removeprefix("-> ") for line in lines if line.startswith("-> ")), AGAIN)
    yield


def _lines(process: "subprocess.Popen[bytes]", output: IO[bytes]) -> Iterator[bytes]:
    """Yield the lines that a process writes to a file, until it has ended."""
    place, pending = 0, b""
    while True:
        has_ended = process.poll() is not None
        # Both processes share the file's position, so that it is never moved.
        part = os.pread(output.fileno(), 1 << 20, place)
        place += len(part)
        *lines, pending = (pending + part).split(b"\n")
        yield from lines
        if not part:
            if has_ended:
                return
            time.sleep(READ_SECONDS)


def note(run: Run, event: dict[str, Any]) -> None:
    """Take over what an event of `glint run --json` says of the run's capture, or of those of its object."""
    kind = event.get("kind")
    if kind == "summary":
        rows = [row for row in event.get("captures", ()) if _is_of(run, row.get("capture", ""))]
        if rows:
            row = next((row for row in rows if row["error"]), rows[0])
            run.end("failed" if row["error"] else "done")
            run.error = _prefix(run, row["capture"]) + row["error"] if row["error"] else ""
            run.remedy, run.version = row["remedy"], row["version"] or ""
    elif _is_of(run, event.get("capture", "")):
        prefix = _prefix(run, event["capture"])
        if kind == "progress":
            run.stage, run.done = _stage(prefix, event), event.get("done", 0)
            run.total, run.unit = event.get("total"), event.get("unit", "")
            if not prefix:
                run.share, run.seconds_left = event.get("share", run.share), event.get("seconds_left", run.seconds_left)
        elif kind == "stage":
            run.stages[_stage(prefix, event)] = None if event.get("cached") else event["seconds"]
        elif kind == "failed":
            run.error = prefix + event["text"]


def _is_of(run: Run, name: str) -> bool:
    """Return whether OBJECT/CAPTURE takes part in a run."""
    return name == run.capture or name.startswith(f"{run.capture}/")


def _stage(prefix: str, event: dict[str, Any]) -> str:
    """Return the stage that an event names, with its capture; the model has one stage, of the same name."""
    stage = str(event["stage"])
    return stage if prefix == f"{stage}: " else prefix + stage


def _prefix(run: Run, name: str) -> str:
    """Return what tells OBJECT/CAPTURE from other captures of the run: nothing where it is the only one."""
    return "" if name == run.capture else f"{name.removeprefix(f'{run.capture}/')}: "
