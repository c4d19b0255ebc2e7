"""The context of a simulated capture with some of its entries changed; its stages performed in this process."""

from pathlib import Path
from typing import Any

from glint.storage.catalogue.loading import load
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.engine.stage import StageRecord, perform, stage_keys
from glint.tasks.pipeline import BY_NAME, STAGES


def make_context(
    catalogue: Path, store: Path, parameters: dict[str, Any] | None = None, /, **changed: Any
) -> CaptureContext:
    """Return the context of the catalogue's first capture, with some keys of its entry changed."""
    item = load(catalogue).objects[0]
    capture = item.captures[0]
    entry = type(capture).model_validate(capture.model_dump(mode="json") | changed)
    return CaptureContext(str(store), item.id, entry, Parameters.model_validate(parameters or {}), "test")


def perform_all(work: CaptureContext, last: str = "surface") -> list[StageRecord]:
    """Perform the stages up to the last one, in order."""
    keys = stage_keys(work, STAGES)
    names = [stage.name for stage in STAGES]
    return [perform(work, BY_NAME[name], keys[name]) for name in names[: names.index(last) + 1]]
