"""What has been published stays published, whatever follows."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from glint.flows.pipeline import object as object_flow
from glint.flows.pipeline.object import compared
from glint.flows.reporting.events import CaptureWarning
from glint.storage.errors import damaged
from glint.tasks.engine.capture_context import CaptureContext


def test_a_damaged_version_before_is_a_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*arguments: Any) -> None:
        raise damaged("v1 of duck", "a chunk is lost", "duck")

    events = list[CaptureWarning]()
    monkeypatch.setattr(object_flow, "drifts", fail)
    monkeypatch.setattr(object_flow, "run_context", lambda: SimpleNamespace(emit=events.append))
    repository = SimpleNamespace(version_names=lambda: ["v1", "v2"])
    context = cast(CaptureContext, SimpleNamespace(object_id="duck", repository=repository))
    assert compared(context, "v2", 1.0) == []
    assert "v2 is published but was not compared with v1: v1 of duck is damaged" in str(events[0])
