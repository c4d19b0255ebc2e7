"""How far DiLiGenT's normals are turned against its depth, and the integration's errors with and without that turn.

    python -m tests.benchmarks.integration_turned FOLDER [--published FOLDER]    (see `integration_diligent`)

Errors are mean absolute ones in millimetres after scaling by the median ratio. `turn` is the rotation of all normals,
about the axes right, up and towards the camera, after which they explain the true depth's rises best; `surface` is the
error that a true surface has which is turned by as much: no integration of the normals as they are can know better.
`turned back` are the errors on normals after that rotation. The truth serves the diagnosis alone.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np

from glint.tasks.algorithms.geometry.perspective import focal_length
from glint.tasks.algorithms.integration.contour_margin import least_cosines
from glint.tasks.algorithms.integration.edges import grid_edges
from glint.tasks.algorithms.integration.expected_rises import ExpectedRises, expected_rises
from tests.benchmarks.integration_diligent import BAR, least_absolute, load, scale_error
from tests.benchmarks.integration_scenes import Scene
from tests.benchmarks.integration_synthetic import Solver, ours, published

SMALL_TURN = 1e-3
"""Turn in radians from which the derivatives of the rises are taken."""
MARGIN_PX = 4
"""Distance to the contour up to which edges do not count."""
LARGEST_MISFIT = 4.0
"""Standard deviations of the rise from which an edge counts as a step of the true surface."""
LEAST_DEVIATION = 0.05
"""Standard deviations up to which a misfit has full weight."""
LARGEST_CHANGE_MM = 2.0
"""Limit of the change of depth where the line of sight grazes the surface."""


def turned(normals: np.ndarray, turn: np.ndarray) -> np.ndarray:
    """Return normals (..., 3) rotated by a rotation vector (3,) in radians."""
    return np.asarray(normals @ cv2.Rodrigues(np.asarray(turn, float))[0].T)


def turn_of(normals: np.ndarray, mask: np.ndarray, camera: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Return the rotation vector (3,) of the normals that fits the true depth's rises best (least absolute misfits)."""
    expected = _rises(normals, mask, camera)
    level = -focal_length(camera) * np.log(np.where(np.isfinite(truth), truth, 1.0))
    rise = np.stack([np.roll(level, -1, axis) - level for axis in range(2)])
    changes = [
        (_rises(turned(normals, SMALL_TURN * axis), mask, camera).mean - expected.mean) / SMALL_TURN
        for axis in np.eye(3)
    ]
    precision = np.sqrt(expected.precision)
    misfit = precision * (rise - expected.mean)
    inner = cv2.erode((mask & np.isfinite(truth)).astype(np.uint8), np.ones((2 * MARGIN_PX + 1,) * 2)) > 0
    counted = (precision > 0.0) & inner & (np.abs(misfit) < LARGEST_MISFIT)
    design, target = (precision * np.stack(changes))[:, counted].T, misfit[counted]
    return least_absolute(design, target, LEAST_DEVIATION)


def turned_depth(
    normals: np.ndarray, known: np.ndarray, camera: np.ndarray, truth: np.ndarray, turn: np.ndarray
) -> np.ndarray:
    """Return, to first order, the depth (N,) at known pixels (H, W) of the true surface turned about its centre."""
    rows, columns = np.nonzero(known)
    depth = truth[known]
    rays = np.stack([columns, rows, np.ones(len(rows))], axis=-1) @ np.linalg.inv(camera).T * [1.0, -1.0, -1.0]
    points = depth[:, None] * rays
    centred = points - points.mean(axis=0)
    shift, facing = turned(centred, turn) - centred, normals[known]
    change = (shift * facing).sum(axis=-1) / np.minimum((rays * facing).sum(axis=-1), -1e-3)
    return np.asarray(depth + np.clip(change, -LARGEST_CHANGE_MM, LARGEST_CHANGE_MM))


def _rises(normals: np.ndarray, mask: np.ndarray, camera: np.ndarray) -> ExpectedRises:
    facing = np.where(mask[..., None], normals, [0.0, 0.0, 1.0])
    return expected_rises(grid_edges(facing, mask, mask.astype(float), camera, least_cosines(mask)))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--published", metavar="FOLDER")
    options = parser.parse_args()
    solvers: dict[str, Solver] = {"glint": ours("bilateral")}
    if options.published:
        solvers["published"] = published(options.published)
    heads = [f"{name} {state}" for state in ("as given", "turned back") for name in solvers]
    print(f"{'object':8} {'turn, degrees':>22} {'surface':>8}" + "".join(f" {head:>21}" for head in heads))
    for name in BAR:
        normals, mask, camera, truth = load(options.folder / name)
        known = mask & np.isfinite(truth)
        turn = turn_of(normals, mask, camera, truth)
        surface = scale_error(turned_depth(normals, known, camera, truth, -turn), truth[known])
        line = f"{name:8} " + "".join(f" {angle:6.2f}°" for angle in np.degrees(turn)) + f" {surface:7.3f}"
        for given in (normals, turned(normals, turn)):
            scene = Scene(given, mask, camera, truth, known)
            for solve in solvers.values():
                line += f" {scale_error(np.asarray(solve(scene))[known].astype(float), truth[known]):21.3f}"
        print(line, flush=True)


if __name__ == "__main__":
    main()
