"""Careless captures for `glint evaluate --degraded`: each shape once for everything that can be wrong with it."""

from pathlib import Path

from glint.flows.reporting.events import ProgressThrottle, Sink
from glint.storage.catalogue.loading import Catalogue, load, write
from glint.tasks.simulation.simulate import DEGRADED, CaptureOptions, simulate

SHAPES = ("hemisphere", "fish", "wine-glass")
SCALE, FRAMES, SEED = 0.6, 1500, 3


def simulate_degraded(out: Path, quick: bool, display: Sink) -> Path:
    """A catalogue of all of them, objects named SHAPE-DEFECT; those that are there already are kept."""
    objects = []
    for defect, options in DEGRADED.items():
        folder = out / defect
        scale, frames = (0.4, 500) if quick else (SCALE, FRAMES)
        chosen = CaptureOptions(**({"scale": scale, "frames": frames, "seed": SEED} | options))
        for shape in SHAPES:
            if not (folder / shape / "front" / "meta.json").exists():
                simulate(shape, folder, chosen, ProgressThrottle(display.emit, f"{shape}-{defect}", "simulate"))
        made = load(folder / "catalogue.yaml").objects
        objects += [each.model_copy(update={"id": f"{each.id}-{defect}"}) for each in made if each.id in SHAPES]
    ordered = sorted(objects, key=lambda each: [each.id.startswith(shape) for shape in SHAPES], reverse=True)
    catalogue = Catalogue.model_validate({"schema": 1, "name": "degraded", "objects": tuple(ordered)})
    write(catalogue, out / "catalogue.yaml")
    return out / "catalogue.yaml"
