"""Views looked for without their pose: each view of a stored model in turn, on a rough model of the others.

    python -m tests.benchmarks.finding CATALOGUE --store STORE [--object ID] [--anywhere]   (`glint run` was there)

Tells for each view how far the best fit is from the pose in the model, whether it would be believed, what it costs, and
the same of the next. Turntables are searched by angle, unless --anywhere says that nothing is known of them.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.tasks.algorithms.multiview.pose_search import Fit, best_angles, best_rotations, doubt
from glint.tasks.algorithms.multiview.reconstruction import Model, rough_model
from glint.tasks.algorithms.multiview.view import View, turned
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.references import load_catalogue
from glint.tasks.evaluation.models import merged_views
from glint.tasks.stages.model import STAGE


def fits_of(view: View, model: Model, on_turntable: bool) -> list[Fit]:
    """Poses at which a view fits, as degrees of a turntable from where it is, or as rotations."""
    if not on_turntable:
        return best_rotations(view.placed(np.eye(3), np.zeros(3)), model)
    return best_angles(view, model, lambda angle: (view.rotation @ turned(angle), view.translation))


def main() -> None:
    """Print a line per view."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogue", type=Path)
    parser.add_argument("--store", required=True)
    parser.add_argument("--object")
    parser.add_argument("--anywhere", action="store_true")
    said = parser.parse_args()
    catalogue = load_catalogue(said.catalogue)
    entry = catalogue.object(said.object) if said.object else catalogue.objects[0]
    works = [Workspace.of(catalogue, entry.id, each.id, said.store) for each in entry.captures]
    table = works[0].repository.load(WHOLE_OBJECT, STAGE).record["turntable"] is not None
    views, _ = merged_views(works)
    for number, view in enumerate(views):
        model = rough_model([*views[:number], *views[number + 1 :]])
        start = time.perf_counter()
        fits = fits_of(view, model, table and not said.anywhere)
        seconds = time.perf_counter() - start
        true = Fit(view.rotation, view.translation, 0.0, 0.0, 0.0)
        each = [
            f"{fit.apart(true):5.1f} degrees: outline {fit.outline:.2f}, normals {fit.normals:.1f}, cost {fit.cost:.1f}"
            for fit in fits[:2]
        ]
        print(
            f"{view.name}  {'doubted ' if doubt(fits) else 'believed'}  {'; '.join(each)}  ({seconds:.1f} s)",
            flush=True,
        )


if __name__ == "__main__":
    main()
