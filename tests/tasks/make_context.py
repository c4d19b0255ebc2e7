"""A capture on the bench: the simulated one with some of its entries changed, and its stages performed here."""

from pathlib import Path
from typing import Any

from glint.storage.catalogue.loading import load
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.parameters import Parameters
from glint.tasks.engine.stage import Record, perform, stage_keys
from glint.tasks.pipeline import BY_NAME, STAGES


def bench(catalogue: Path, store: Path, parameters: dict[str, Any] | None = None, **changed: Any) -> Workspace:
    """The workspace of the catalogue's first capture with some keys changed."""
    capture = load(catalogue).objects[0].captures[0]
    said = capture.model_dump(mode="json") | changed
    return Workspace(
        str(store), "glass", type(capture).model_validate(said), Parameters.model_validate(parameters or {}), "test"
    )


def perform_all(work: Workspace, last: str = "surface") -> list[Record]:
    """Perform the stages up to the last one, in order."""
    keys = stage_keys(work, STAGES)
    names = [stage.name for stage in STAGES]
    return [perform(work, BY_NAME[name], keys[name]) for name in names[: names.index(last) + 1]]
