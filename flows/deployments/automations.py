"""The automations that `glint deploy` creates: crashed flow runs are detected, failures and warnings are sent out."""

from datetime import timedelta
from typing import Any

from prefect.client.schemas.objects import StateType
from prefect.events.actions import ChangeFlowRunState, SendNotification
from prefect.events.schemas.automations import AutomationCore, EventTrigger, Posture
from prefect.events.schemas.events import ResourceSpecification

from glint.flows.deployments.maintenance import DISK_EVENT
from glint.flows.pipeline.drift import DRIFT_EVENT

TAG = "glint"
"""Tag of Glint's deployments and their flow runs."""

HEARTBEAT_SECONDS = 30
"""Interval of a flow run's heartbeats; after three missed ones the run counts as crashed."""

TERMINAL_STATES = ("Completed", "Failed", "PartiallyCompleted", "Cancelled", "Crashed", "Paused")
"""States after which no heartbeat is expected."""

HEARTBEAT_EVENT = "prefect.flow-run.heartbeat"
FLOW_RUN_URL = "{{ flow_run|ui_url }}"


def heartbeat_automation() -> AutomationCore:
    """Return the automation that marks a flow run as crashed when its heartbeats stop before it has ended."""
    return AutomationCore(
        name="glint: dead flow runs",
        description="Marks flow runs as crashed whose process or machine is gone.",
        trigger=EventTrigger(
            posture=Posture.Proactive,
            after={HEARTBEAT_EVENT},
            expect={HEARTBEAT_EVENT, *(f"prefect.flow-run.{state}" for state in TERMINAL_STATES)},
            match=ResourceSpecification({"prefect.resource.id": "prefect.flow-run.*"}),
            for_each={"prefect.resource.id"},
            threshold=1,
            within=timedelta(seconds=3 * HEARTBEAT_SECONDS),
        ),
        actions=[
            ChangeFlowRunState(
                state=StateType.CRASHED,
                name="Crashed",
                message="The process of this flow run sends no heartbeats any more: run it again.",
                force=False,
            )
        ],
    )


def notification_automations(block: Any) -> list[AutomationCore]:
    """Return the automations that notify through a block (its document id) of failures, drift and low disk space."""
    return [
        _notification(
            block,
            "failure",
            "Glint: {{ flow.name }} {{ flow_run.state.name }}",
            "{{ flow_run.name }}: {{ flow_run.state.message }}\n" + FLOW_RUN_URL,
            expect={"prefect.flow-run.Failed", "prefect.flow-run.PartiallyCompleted", "prefect.flow-run.Crashed"},
            match_related=[
                ResourceSpecification(
                    {"prefect.resource.id": "prefect.deployment.*", "prefect.resource.role": "deployment"}
                ),
                ResourceSpecification({"prefect.resource.id": f"prefect.tag.{TAG}", "prefect.resource.role": "tag"}),
            ],
        ),
        _notification(
            block,
            "drift",
            "Glint: surface changed between versions",
            "{{ event.payload.object }}/{{ event.payload.capture }}: the 95th percentile of normal change from"
            " {{ event.payload.before }} to {{ event.payload.after }} is {{ event.payload.degrees }} degrees",
            expect={DRIFT_EVENT},
        ),
        _notification(block, "disk", "Glint: low disk space", "{{ event.payload.warning }}", expect={DISK_EVENT}),
    ]


def _notification(block: Any, name: str, subject: str, body: str, **trigger: Any) -> AutomationCore:
    return AutomationCore(
        name=f"glint: {name}",
        trigger=EventTrigger(posture=Posture.Reactive, threshold=1, within=timedelta(0), **trigger),
        actions=[SendNotification(block_document_id=block, subject=subject, body=body)],
    )
