"""Report surfaces that changed more between versions than a run allows: console, dashboard, and a Prefect event."""

from collections.abc import Sequence

from prefect.artifacts import create_markdown_artifact
from prefect.events import emit_event

from glint.flows.pipeline.context import run_context
from glint.flows.reporting.artifacts import artifact_key
from glint.flows.reporting.events import CaptureWarning
from glint.tasks.figures.markdown import plain
from glint.tasks.version_diff import Drift

DRIFT_EVENT = "glint.drift"
"""Name of the event; its resource is `glint.object.OBJECT`, its payload names the capture and the change in degrees."""


def report_drifts(drifts: Sequence[Drift], allowed: float) -> None:
    """Report changes of more than `allowed` degrees; automations of Prefect can react to the event."""
    if not drifts:
        return
    object_id = drifts[0].object_id
    create_markdown_artifact(drift_page(drifts, allowed), key=artifact_key(f"drift {object_id}"))
    for drift in drifts:
        run_context().emit(CaptureWarning(f"{drift.object_id}/{drift.capture_id}", str(drift)))
        emit_event(
            DRIFT_EVENT,
            resource={"prefect.resource.id": f"glint.object.{object_id}", "prefect.resource.name": object_id},
            payload={
                "object": object_id,
                "capture": drift.capture_id,
                "degrees": round(drift.degrees, 3),
                "allowed": allowed,
                "before": drift.before,
                "after": drift.after,
            },
        )


def drift_page(drifts: Sequence[Drift], allowed: float) -> str:
    """Return a markdown page of the changes and what to do about them."""
    lines = [f"- {plain(str(drift))}" for drift in drifts]
    first = drifts[0]
    remedy = (
        f"Allowed are {allowed:g} degrees (95th percentile). See what changed with"
        f" `glint diff {first.object_id} {first.before} {first.after}`; take it back with"
        f" `glint rollback {first.object_id} {first.before}`."
    )
    return "\n".join(["# The surface changed between versions", "", *lines, "", remedy, ""])
