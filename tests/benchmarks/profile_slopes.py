"""Slopes of profiles: by the contour, by accepted normals, and by all candidates of whole circles; and their rivals.

    python -m tests.benchmarks.profile_slopes [SHAPE ...] [--seed 440000] [--count 24] [--folder DIR]

The captures are those of `random_captures` under parallel rays, of shapes of revolution, with spheres and masks given.
Of each it prints the mean angle in degrees, each capped at 15, from the normals of the wall to the true ones: of the
largest surface inside the silhouette, of that with slopes fitted to accepted normals, and of that with the slopes that
candidates show. At last it prints the share of the confident pixels that is right by the rivalry of their circle, and
the share of all confident pixels that they are; the confidence leaves rivals out of account.
"""

import argparse
from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from glint.tasks.algorithms.geometry.vectors import angles, pixel_positions
from glint.tasks.algorithms.labelling.explanations import explain
from glint.tasks.algorithms.labelling.reconstruction import conclude, settle
from glint.tasks.algorithms.labelling.results import CONFIDENT
from glint.tasks.algorithms.revolution.profile_slopes import ShownSlopes, with_shown_slopes
from glint.tasks.algorithms.revolution.surface_fit import SilhouetteSymmetry, fitted_surface
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.clusters import load_clusters
from tests.benchmarks.random_captures import Measured, measure, random_captures
from tests.benchmarks.simulated_captures import shapes_parser

SHAPES = ("cylinder", "wine-glass", "water-glass", "goblet", "tumbler", "coupe", "flask", "hemisphere")
"""Shapes of revolution without a handle or a relief."""
MAX_ERROR_DEG, RIGHT_DEG = 15.0, 5.0
"""Angle at which an error is capped, and up to which a normal is right."""
RIVALRIES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.5, np.inf)
"""Bounds of the rivalries that are told apart."""


class Wall(NamedTuple):
    """Fitted surface of a capture, x and y (N,), camera frame, of its wall's pixels, and their true normals (N, 3)."""

    surface: SurfaceOfRevolution
    x: np.ndarray
    y: np.ndarray
    normals: np.ndarray

    def error(self, surface: SurfaceOfRevolution) -> float:
        """Return the mean angle in degrees from the wall's normals to the true ones, each capped."""
        angle = np.nan_to_num(angles(surface.normals(self.x, self.y), self.normals), nan=MAX_ERROR_DEG)
        return float(np.minimum(angle, MAX_ERROR_DEG).mean())


def captures_of_revolution(arguments: argparse.Namespace) -> Iterator[tuple[str, Measured]]:
    """Yield name and results of each capture under parallel rays."""
    arguments.shapes = arguments.shapes or SHAPES
    for name, capture, store in random_captures(arguments, is_given=True):
        measured = measure(capture, store)
        if load_geometry(measured.work).region_camera is None:
            yield name, measured


def main() -> None:
    """Print a line per capture, then the means, and the shares by rivalry."""
    arguments = shapes_parser(__doc__, seed=440000, count=24).parse_args()
    errors, rivalry, is_right = [], [], []
    for name, measured in captures_of_revolution(arguments):
        clusters, mask = load_clusters(measured.work), measured.mask
        state = settle(clusters, mask)
        fitted = fitted_surface(SilhouetteSymmetry(mask), state.known_values, np.inf)
        if fitted is None:
            print(f"{name}: no axis of symmetry", flush=True)
            continue
        surface = fitted[1]
        x, y = pixel_positions(mask)
        is_wall = np.isfinite(surface.normals(x, y)[:, 0]) & ~surface.is_end(x, y)
        wall = Wall(surface, x[is_wall], y[is_wall], measured.truth[mask][is_wall])
        accepted = np.isfinite(state.known_values[mask][:, 0])
        by_accepted = surface.with_fitted_slopes(x[accepted], y[accepted], state.known_values[mask][accepted])
        by_candidates = with_shown_slopes(surface, ShownSlopes.on(surface, x, y, clusters.normals[:, mask]))
        errors.append([wall.error(profile) for profile in (surface, by_accepted, by_candidates)])
        print(f"{name}: " + " -> ".join(f"{error:.2f}" for error in errors[-1]) + " degrees", flush=True)
        state = explain(state)
        if state.body_fit is not None:
            confident = conclude(state).confidence >= CONFIDENT * state.body_fit.confidence
            rivalry.append(state.body_fit.rivalry[confident])
            is_right.append(measured.error[confident] < RIGHT_DEG)
    contour, by_accepted_mean, by_candidates_mean = np.mean(errors, axis=0)
    print(
        f"mean: {contour:.2f} (contour) -> {by_accepted_mean:.2f} (accepted) -> {by_candidates_mean:.2f} (candidates)"
    )
    print_shares(np.concatenate(rivalry), np.concatenate(is_right))


def print_shares(rivalry: np.ndarray, is_right: np.ndarray) -> None:
    """Print which share is right by rivalry, both (N,)."""
    for least, most in pairwise(RIVALRIES):
        inside = (rivalry >= least) & (rivalry < most)
        if inside.any():
            print(f"rivalry {least:.1f} to {most:.1f}: {is_right[inside].mean():.1%} right of {inside.mean():.2%}")


if __name__ == "__main__":
    main()
