"""Surfaces that moved further than a run allows: told on the terminal, on the dashboard, and as an event."""

from collections.abc import Callable, Sequence

from prefect.artifacts import create_markdown_artifact
from prefect.events import emit_event

from glint.flows.reporting.artifacts import artifact_key, plain
from glint.flows.reporting.events import Event
from glint.tasks.version_diff import Drift

EVENT = "glint.drift"
"""Name of the event; its resource is `glint.object.OBJECT`, its payload says which capture moved, and how far."""


def tell_drifts(drifts: Sequence[Drift], allowed: float, show: Callable[[Event], None]) -> None:
    """Tell what moved by more than the `allowed` degrees; automations of Prefect can react to the event."""
    if not drifts:
        return
    object_id = drifts[0].object_id
    create_markdown_artifact(drift_page(drifts, allowed), key=artifact_key(f"drift {object_id}"))
    for each in drifts:
        show(Event("warning", f"{each.object_id}/{each.capture_id}", text=str(each)))
        emit_event(
            EVENT,
            resource={"prefect.resource.id": f"glint.object.{object_id}", "prefect.resource.name": object_id},
            payload={
                "object": object_id,
                "capture": each.capture_id,
                "degrees": round(each.degrees, 3),
                "allowed": allowed,
                "before": each.before,
                "after": each.after,
            },
        )


def drift_page(drifts: Sequence[Drift], allowed: float) -> str:
    """Markdown of what moved, and what to do about it."""
    lines = [f"- {plain(str(each))}" for each in drifts]
    first = drifts[0]
    remedy = (
        f"Allowed are {allowed:g} degrees (95th percentile). See what changed with"
        f" `glint diff {first.object_id} {first.before} {first.after}`; take it back with"
        f" `glint rollback {first.object_id} {first.before}`."
    )
    return "\n".join(["# The surface has moved", "", *lines, "", remedy, ""])
