"""The weight between the own and the neighbours' terms of the paper's graph cut, for both readings of its edges.

    python -m tests.benchmarks.dual_layer_weights SHARED_CAPTURES [--weights 0.03 0.1 0.3 1]

Prints the mean squared normal error over data / whole region and the seconds of initial normals and of the cut, on
each capture, beside silhouette only and winner takes all; then the seconds of the cut at the paper's largest size. True
light directions are used, so that only the labelling is judged.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import get_args

import cv2
import numpy as np

from glint.tasks.algorithms.candidates.clusters import Clusters, cluster_pixels, inverse_density_weights
from glint.tasks.algorithms.candidates.thresholds import highlight_levels
from glint.tasks.algorithms.evaluation.metrics import normal_errors
from glint.tasks.algorithms.geometry.vectors import half_vectors_of, unit
from glint.tasks.algorithms.prior.silhouette import initial_normals
from glint.tasks.algorithms.published.dual_layer import (
    Connectivity,
    label_dual_layer,
    node_terms,
    reconstruct_dual_layer,
)
from tests.pictures import read_picture

CAPTURES = ("hemisphere", "cylinder", "duck")
REGION_ORIGIN = 16
JUG = (419, 279)
"""Rows and columns of the paper's largest object."""


@dataclass(frozen=True, slots=True)
class Scene:
    """Clusters of a capture, its mask (H, W) and its true normals (H, W, 3)."""

    name: str
    clusters: Clusters
    mask: np.ndarray
    truth: np.ndarray


def load(captures: Path, name: str) -> Scene:
    """Decode a capture and cluster it under its true lights."""
    folder = captures / name / "front"
    mask = read_picture(folder / "mask.png", cv2.IMREAD_GRAYSCALE) > 0
    frames = read_region(folder / "video.mp4", mask.shape)
    half_vectors = half_vectors_of(np.load(folder / "truth" / "lights.npy")).astype(np.float32)
    half_vectors[half_vectors[:, 2] < np.cos(np.pi / 4)] = np.nan
    static = np.median(frames[:: max(1, len(frames) // 64)], axis=0).astype(np.uint8)
    levels = highlight_levels(static, frames.max(axis=0), mask, half_vectors)
    clusters = cluster_pixels(frames, levels, half_vectors, inverse_density_weights(half_vectors))
    return Scene(name, clusters, mask, np.load(folder / "truth" / "normals.npy"))


def read_region(video: Path, shape: tuple[int, int]) -> np.ndarray:
    """Luma of the region over all frames (T, H, W) uint8."""
    capture, frames = cv2.VideoCapture(str(video)), list[np.ndarray]()
    rows, columns = (slice(REGION_ORIGIN, REGION_ORIGIN + size) for size in shape)
    while True:
        good, frame = capture.read()
        if not good:
            return np.array(frames)
        frames.append(cv2.cvtColor(frame[rows, columns], cv2.COLOR_BGR2GRAY))


def score(scene: Scene, normals: np.ndarray) -> str:
    """Errors over data / whole region."""
    data = scene.mask & (scene.clusters.observations > 0)
    return "/".join(f"{normal_errors(normals, scene.truth, region).squared:.4f}" for region in (data, scene.mask))


def largest_seconds(connectivity: Connectivity, weight: float) -> float:
    """Seconds of nodes and cut on a full rectangle of the paper's largest size, all pixels seeing two directions."""
    generator = np.random.default_rng(0)
    rows, columns = np.mgrid[: JUG[0], : JUG[1]]
    flat = np.stack([columns / JUG[1] - 0.5, 0.5 - rows / JUG[0], np.ones(JUG)], axis=-1)
    initial = unit(flat)
    noise = generator.normal(0.0, 0.15, (2, *JUG, 3))
    normals = unit(np.stack([flat, flat * (-1, -1, 1)]) + noise * (1, 1, 0))
    mask, free = np.ones(JUG, bool), np.zeros((2, *JUG), np.int8)
    started = perf_counter()
    label_dual_layer(node_terms(normals, initial, mask, free), mask, connectivity=connectivity, weight=weight)
    return perf_counter() - started


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path)
    parser.add_argument("--weights", type=float, nargs="+", default=[0.03, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0])
    arguments = parser.parse_args()
    scenes = [load(arguments.captures, name) for name in CAPTURES]
    initials, timings = [], []
    for scene in scenes:
        started = perf_counter()
        initials.append(initial_normals(scene.mask).normals)
        timings.append(perf_counter() - started)
    print(f"{'data/whole, seconds':22s}" + "".join(f"{scene.name:>22s}" for scene in scenes))
    cells = [
        f"{score(scene, initial)} {seconds:6.2f}"
        for scene, initial, seconds in zip(scenes, initials, timings, strict=True)
    ]
    print(f"{'silhouette only':22s}" + "".join(f"{cell:>22s}" for cell in cells))
    cells = [
        score(scene, np.where(np.isfinite(scene.clusters.winner), scene.clusters.winner, initial)) + 7 * " "
        for scene, initial in zip(scenes, initials, strict=True)
    ]
    print(f"{'winner takes all':22s}" + "".join(f"{cell:>22s}" for cell in cells))
    for connectivity in get_args(Connectivity):
        for weight in arguments.weights:
            cells = []
            for scene, initial in zip(scenes, initials, strict=True):
                started = perf_counter()
                result = reconstruct_dual_layer(
                    scene.clusters, scene.mask, initial, connectivity=connectivity, weight=weight
                )
                cells.append(f"{score(scene, result.normals)} {perf_counter() - started:6.2f}")
            print(f"{connectivity + f' {weight:g}':22s}" + "".join(f"{cell:>22s}" for cell in cells), flush=True)
    for connectivity in get_args(Connectivity):
        print(f"cut of {JUG[1]} x {JUG[0]} pixels, {connectivity}: {largest_seconds(connectivity, 0.1):.2f} s")


if __name__ == "__main__":
    main()
