"""Views looked for without their pose: each view of a stored model in turn, on a coarse model of the others.

    python -m tests.benchmarks.finding CATALOGUE --store STORE [--object ID] [--anywhere]   (`glint run` was there)

Tells for each view how far the best fit is from the pose in the model, whether it would be believed, what it costs, and
the same of the next. Turntables are searched by angle, unless --anywhere says that nothing is known of them.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.reconstruction import coarse_model
from glint.tasks.algorithms.multiview.view import View, rotation_about_y
from glint.tasks.algorithms.registration.pose_fit import PoseFit
from glint.tasks.algorithms.registration.pose_search import ambiguity, search_angles, search_rotations
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.references import load_catalogue
from glint.tasks.evaluation.models import load_registered_views
from glint.tasks.model.model_key import STAGE


def fits_of(view: View, model: Model, on_turntable: bool) -> list[PoseFit]:
    """Poses at which a view fits, as degrees of a turntable from where it is, or as rotations."""
    if not on_turntable:
        return search_rotations(view.with_pose(np.eye(3), np.zeros(3)), model)
    return search_angles(view, model, lambda angle: (view.rotation @ rotation_about_y(angle), view.translation))


def main() -> None:
    """Print a line per view."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogue", type=Path)
    parser.add_argument("--store", required=True)
    parser.add_argument("--object")
    parser.add_argument("--anywhere", action="store_true")
    options = parser.parse_args()
    catalogue = load_catalogue(options.catalogue)
    entry = catalogue.object(options.object) if options.object else catalogue.objects[0]
    works = [CaptureContext.of(catalogue, entry.id, capture.id, options.store) for capture in entry.captures]
    table = works[0].repository.load(WHOLE_OBJECT, STAGE).record["turntable"] is not None
    views, _ = load_registered_views(works)
    for number, view in enumerate(views):
        model = coarse_model([*views[:number], *views[number + 1 :]])
        start = time.perf_counter()
        fits = fits_of(view, model, table and not options.anywhere)
        seconds = time.perf_counter() - start
        true = PoseFit(view.rotation, view.translation, 0.0, 0.0, 0.0)
        lines = [
            f"{fit.angle_to(true):5.1f} degrees: silhouette {fit.silhouette_px:.2f}, normals {fit.normals_deg:.1f},"
            f" cost {fit.cost:.1f}"
            for fit in fits[:2]
        ]
        print(
            f"{view.name}  {'doubted ' if ambiguity(fits) else 'believed'}  {'; '.join(lines)}  ({seconds:.1f} s)",
            flush=True,
        )


if __name__ == "__main__":
    main()
