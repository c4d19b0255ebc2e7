"""Mean absolute depth error in millimetres of the integration on DiLiGenT's ground-truth normals, per object.

    python -m tests.benchmarks.integration_diligent FOLDER    (holding bear/, buddha/ .. with normal_map.png ..)

The integrated distance is aligned with the true one in two ways: by the scale alone (the median of their ratios; under
perspective nothing else is free), and by scale and offset (least absolute deviations). `bar` is 1.1 x the better of the
published method and masked least squares on the same normals.
"""

import argparse
import time
from pathlib import Path

import cv2
import numpy as np

from glint.tasks.algorithms.integration.bilateral import Method, integrate
from tests.pictures import read_picture

BAR = {"bear": 0.334, "buddha": 0.563, "cow": 0.058, "pot1": 0.635, "pot2": 0.159}
METHODS: tuple[Method, ...] = ("bilateral", "least-squares")


def load(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return normals (H, W, 3), mask (H, W), camera (3, 3) and true distance (H, W) in millimetres of one object."""
    picture = read_picture(folder / "normal_map.png")[..., ::-1] / 65535 * 2 - 1
    mask = read_picture(folder / "mask.png", cv2.IMREAD_GRAYSCALE) > 0
    normals = picture / np.linalg.norm(picture, axis=-1, keepdims=True)
    return normals, mask, np.loadtxt(folder / "K.txt"), np.load(folder / "depth_gt.npz")["depth_gt"].astype(float)


def scale_error(depth: np.ndarray, truth: np.ndarray) -> float:
    """Return the mean absolute error after scaling by the median ratio."""
    return float(np.abs(depth * np.median(truth / depth) - truth).mean())


def affine_error(depth: np.ndarray, truth: np.ndarray) -> float:
    """Return the mean absolute error after scale and offset of least absolute deviations."""
    design = np.stack([depth, np.ones_like(depth)], axis=1)
    return float(np.abs(design @ least_absolute(design, truth, 1e-4) - truth).mean())


def least_absolute(design: np.ndarray, target: np.ndarray, least: float) -> np.ndarray:
    """Return the coefficients (M,) of a design (N, M) that deviate least from a target (N,), in absolute values.

    least: deviation up to which a value has full weight (reweighted least squares).
    """
    weight = np.ones_like(target)
    for _ in range(60):
        fit = np.linalg.lstsq(design * weight[:, None], target * weight, rcond=None)[0]
        weight = 1 / np.sqrt(np.maximum(np.abs(target - design @ fit), least))
    return np.asarray(fit)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    print(f"{'object':8} {'method':14} {'scale':>7} {'affine':>7} {'bar':>7} {'rounds':>6} {'seconds':>7}")
    for name, best in BAR.items():
        normals, mask, camera, truth = load(folder / name)
        known = mask & np.isfinite(truth)
        for method in METHODS:
            start = time.perf_counter()
            result = integrate(normals, mask, method=method, camera=camera)
            seconds = time.perf_counter() - start
            depth = result.depth[known].astype(float)
            errors = f"{scale_error(depth, truth[known]):7.3f} {affine_error(depth, truth[known]):7.3f}"
            print(f"{name:8} {method:14} {errors} {1.1 * best:7.3f} {result.rounds:6d} {seconds:7.2f}")


if __name__ == "__main__":
    main()
