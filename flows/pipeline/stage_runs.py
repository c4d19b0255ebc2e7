"""Stages as task runs on Prefect's timeline, each inside the run of its capture.

A stage runs on a Dask worker, which knows nothing of Prefect. The flow's process announces it: it emits the same events
of changed states that Prefect's engine emits for its own task runs, from which the server records the runs. The
function that does so is not part of Prefect's public interface: tests/flows/pipeline/test_stage_runs.py reads
the recorded graph back from a server, and guards an upgrade.
"""

from datetime import datetime
from typing import Any
from uuid import uuid4

from prefect.client.schemas.objects import State, TaskRun, TaskRunResult
from prefect.events.schemas.events import Event
from prefect.states import Completed, Crashed, Failed, Pending, Running
from prefect.utilities.engine import emit_task_run_state_change_event

CACHED = "Cached"
"""Name of the state of a stage whose result was stored already."""


class StageRun:
    """The run of one stage; `parent` is the task run of its capture, in whose context the methods must be called."""

    def __init__(self, parent: TaskRun, stage: str, started: datetime) -> None:
        self.stage, self.started = stage, started
        identity = uuid4()
        times: dict[str, Any] = {"expected_start_time": started, "start_time": started}
        self._run = TaskRun(
            id=identity,
            name=stage,  # without "/", by which `glint status` recognises captures
            flow_run_id=parent.flow_run_id,
            task_key=f"stage-{stage}",
            dynamic_key=str(identity),
            task_inputs={"__parents__": [TaskRunResult(id=parent.id)]},
            run_count=1,
            **times,
        )
        self._state: State[Any] = Pending(timestamp=started)
        self._event: Event | None = None

    def announce_running(self) -> None:
        """Show the stage as running since its start."""
        self._announce(Running(timestamp=self.started))

    def announce_completed(self, ended: datetime, cached: bool = False) -> None:
        """Show the stage as completed, or as cached."""
        self._announce(Completed(timestamp=ended, name=CACHED if cached else "Completed"), ended)

    def announce_failed(self, ended: datetime, message: str) -> None:
        """Show the stage as failed, with the error and its remedy."""
        self._announce(Failed(timestamp=ended, message=message), ended)

    def announce_crashed(self, ended: datetime, message: str) -> None:
        """Show that the stage was lost with its process."""
        self._announce(Crashed(timestamp=ended, message=message), ended)

    def _announce(self, state: State[Any], ended: datetime | None = None) -> None:
        if ended is not None:
            times = {"end_time": ended, "total_run_time": ended - self.started}
            self._run = self._run.model_copy(update=times)
        self._event = emit_task_run_state_change_event(self._run, self._state, state, follows=self._event)
        self._state = state
