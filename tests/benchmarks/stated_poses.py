"""Models whose poses or scales are stated wrongly: what becomes of them, and what is said.

    python -m tests.benchmarks.stated_poses CATALOGUE --store STORE [--object ID] [--every 2] [--cases right,reversed]
        [--evidence]

`glint run` was there; views stand on a turntable, and the object has a truth_model. One pass, from the labels stored
for each view. A confident vertex (0.95 or more) is right within 5 degrees of the normal of the nearest true point.
With --evidence only what 4 to 6 views say of their poses is printed, each held against a model of the others.
"""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.evaluation.mesh_metrics import score_model
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.algorithms.multiview.mesh import Model
from glint.tasks.algorithms.multiview.reconstruction import REFINEMENT_ROUNDS, reconstruct_surface
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.pose_alternatives import silhouette_alternatives
from glint.tasks.algorithms.registration.pose_evidence import best_turns, left_out_misfits, log_ratio
from glint.tasks.algorithms.registration.registered_views import RegisteredViews, refine, register_on_turntable
from glint.tasks.algorithms.registration.turntable import relative_turns
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.references import load_catalogue
from glint.tasks.evaluation.models import load_true_mesh
from glint.tasks.model.corrections import correction_warnings
from glint.tasks.model.pose_doubts import pose_doubts, with_doubts
from glint.tasks.model.view_registration import view_of

CONFIDENT, RIGHT_DEG = 0.95, 5.0
SAMPLES = 200_000

Stated = tuple[list[View], np.ndarray]
Case = Callable[[list[View], np.ndarray], Stated]


def turned(number: int, degrees: float) -> Case:
    """One view's angle stated wrongly."""
    return lambda views, stated: (views, stated + degrees * (np.arange(len(views)) == number))


def rescaled(number: int, factor: float) -> Case:
    """One view's pixel size stated wrongly."""
    return lambda views, stated: (
        [replace(v, pixel_size=v.pixel_size * (factor if k == number else 1.0)) for k, v in enumerate(views)],
        stated,
    )


def exchanged(views: list[View], stated: np.ndarray) -> Stated:
    """Exchange the angles of the first view and of the one opposite, or nearly."""
    other = int(np.abs((stated - stated[0]) % 360.0 - 180.0).argmin())
    result = stated.copy()
    result[[0, other]] = stated[[other, 0]]
    return views, result


CASES: dict[str, Case] = {
    "right": lambda views, stated: (views, stated),
    "reversed": lambda views, stated: (views, -stated),
    "first+10": turned(0, 10.0),
    "second+10": turned(1, 10.0),
    "second+20": turned(1, 20.0),
    "second+25": turned(1, 25.0),
    "third+20": turned(2, 20.0),
    "third+45": turned(2, 45.0),
    "exchanged": exchanged,
    "scale+1%": rescaled(2, 1.01),
    "scale+2%": rescaled(2, 1.02),
    "scale-3%": rescaled(2, 0.97),
    "scale+5%": rescaled(2, 1.05),
}


def merged(views: list[View], stated: np.ndarray, right: np.ndarray) -> tuple[Model, list[str]]:
    """Return the model of one pass with its doubts, and what is told; right (V,): the true angles, degrees."""
    registered = register_on_turntable(views, stated.tolist())
    surface = reconstruct_surface(registered.views, rounds=1)
    for _ in range(REFINEMENT_ROUNDS - 1):
        registered = refine(registered, surface)
        surface = reconstruct_surface(registered.views, surface, rounds=1)
    doubts = pose_doubts(registered, surface)
    messages = [f"{view.name} left out" for view in registered.rejected]
    messages += [warning.message for warning in [*correction_warnings(registered), *doubts.warnings]]
    model = with_doubts(surface, registered.views, registered.views, doubts)
    return model, [_angles_off(registered, views, right), *messages]


def _angles_off(registered: RegisteredViews, views: list[View], right: np.ndarray) -> str:
    """Return how many degrees the solved angles are off, but for a turn of all."""
    assert registered.turntable is not None
    names = [view.name for view in registered.views]
    true = right[[view.name in names for view in views]]
    off = np.abs(relative_turns(true, registered.turntable.angles))
    return f"angles off by {off.mean():.2f} degrees, at most {off.max():.2f}"


def evidence(views: list[View], stated: np.ndarray) -> str:
    """Return the sum of the logarithms of the ratios of misfits, and the largest best turn."""
    registered = register_on_turntable(views, stated.tolist())
    posed, table = list(registered.views), registered.turntable
    assert table is not None
    ((_, turned_back),) = silhouette_alternatives(posed, table)
    ratio = log_ratio(left_out_misfits(posed), left_out_misfits(turned_back))
    return f"sum of log ratios {ratio:+.2f}, largest turn {np.abs(best_turns(posed, True)).max():.1f} degrees"


def described(model: Model, truth: trimesh.Trimesh) -> str:
    """Return scores, and the confident share with the share of it that is right."""
    score = score_model(model.vertices, model.triangles, truth)
    points, faces = trimesh.sample.sample_surface(truth, SAMPLES, seed=0)
    nearest = cKDTree(points).query(model.vertices)[1]
    is_right = angles(truth.face_normals[faces[nearest]], model.normals) <= RIGHT_DEG
    confident = model.confidence >= CONFIDENT
    share = f"{is_right[confident].mean():.1%}" if confident.any() else "-"
    return (
        f"F {score.f_scores[0]:.3f} / {score.f_scores[1]:.3f}, chamfer {score.chamfer:.2%},"
        f" confident {confident.mean():.1%}, right {share}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogue", type=Path)
    parser.add_argument("--store", required=True)
    parser.add_argument("--object")
    parser.add_argument("--every", type=int, default=1, help="take every such view only")
    parser.add_argument("--cases", default=",".join(CASES))
    parser.add_argument("--evidence", action="store_true")
    options = parser.parse_args()
    catalogue = load_catalogue(options.catalogue)
    entry = catalogue.object(options.object or catalogue.objects[0].id)
    chosen = entry.captures[:: options.every]
    views = [view_of(CaptureContext.of(catalogue, entry.id, capture.id, options.store)) for capture in chosen]
    stated = np.array([capture.pose.turntable if capture.pose is not None else None for capture in chosen], float)
    truth = load_true_mesh(str(entry.truth_model))
    for name in options.cases.split(","):
        try:
            if options.evidence:
                print(f"{entry.id}, {len(views)} views, {name}: {evidence(*CASES[name](views, stated))}", flush=True)
                continue
            model, messages = merged(*CASES[name](views, stated), stated)
        except UnusableCapture as error:
            print(f"{entry.id}, {len(views)} views, {name}: refused: {error}", flush=True)
            continue
        print(f"{entry.id}, {len(views)} views, {name}: {described(model, truth)}", flush=True)
        for message in messages:
            print(f"    {message}", flush=True)


if __name__ == "__main__":
    main()
