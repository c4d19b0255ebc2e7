"""The labelling laboratory: what each ingredient of the labelling is worth on captures with known truth.

    python -m tests.benchmarks.labelling_ablation SHARED_CAPTURES [--turntable] [--pictures DIR] [--cache DIR]

Prints, for the default and with each ingredient switched off, the mean squared normal error over data / whole region of
every capture, and for the default also precision and recall of labels and the calibration of confidence. True light
directions are used, so that only the labelling is judged.
"""

import argparse
import json
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
from numba import njit

from tasks.algorithms.geometry import angles, half_vectors_of
from tasks.algorithms.markup import Marks
from tasks.algorithms.rounds import Reconstruction, reconstruct_normals

REGION_ORIGIN = 16
BRIGHT = 225
ABLATIONS: dict[str, dict[str, Any]] = {
    "default": {},
    "no shape evidence": {"shape_weight": 0.0},
    "no ties between neighbours": {"strength": 0.0},
    "every accepted normal pulls": {"believed": 0.0},
    "one round": {"rounds": 1},
    "no tension": {"tension_length": 100.0},
    "spread that does not grow": {"growth": 0.0},
    "rim as weak as a normal": {"rim_weight": 0.1},
    "two clusters": {"layers": 2},
    "one cluster": {"layers": 1},
}


@dataclass(frozen=True, slots=True)
class Scene:
    """A capture reduced to what the labelling needs: nodes (K, H, W, 3), observations, mask, truth (H, W, 3), marks."""

    name: str
    nodes: np.ndarray
    observations: np.ndarray
    mask: np.ndarray
    truth: np.ndarray
    marks: Marks | None


@njit(cache=True)
def _strongest(values: np.ndarray, lights: np.ndarray, share: np.ndarray, layers: int) -> np.ndarray:
    """The `layers` heaviest groups of half vectors within 2.2 degrees of each other, per pixel: (layers, N, 3)."""
    near, gone = np.cos(np.radians(2.2)), np.cos(np.radians(3.5))
    result = np.full((layers, len(values), 3), np.nan, np.float32)
    for pixel in range(len(values)):
        left = np.nonzero(values[pixel] >= BRIGHT)[0]
        for layer in range(layers):
            if len(left) == 0:
                break
            here = lights[left]
            together = here @ here.T > near
            middle = here[(together * share[left]).sum(axis=1).argmax()]
            for _ in range(6):
                inside = here @ middle > near
                total = (here * (share[left] * inside).reshape(-1, 1)).sum(axis=0)
                middle = (total / np.sqrt((total**2).sum())).astype(np.float32)
            result[layer, pixel] = middle
            left = left[here @ middle <= gone]
    return result


def load_scene(folder: Path, name: str, cache: Path | None, layers: int = 3) -> Scene:
    """Decode a capture folder, group its highlights, read its truth and marks."""
    mask = cv2.imread(str(folder / "mask.png"), cv2.IMREAD_GRAYSCALE) > 0
    truth = np.load(folder / "truth" / "normals.npy")
    half_vectors = half_vectors_of(np.load(folder / "truth" / "lights.npy")).astype(np.float32)
    stored = cache / f"{name}.npz" if cache else None
    if stored is not None and stored.exists():
        found = np.load(stored)
        nodes, observations = found["nodes"], found["observations"]
    else:
        values = _pixels(folder / "video.mp4", mask)
        seen = half_vectors[:, 2] > np.cos(np.pi / 4)
        lights = np.ascontiguousarray(half_vectors[seen])
        share = (1.0 / (lights @ lights.T > np.cos(np.radians(1.0))).sum(axis=1)).astype(np.float32)
        nodes = np.full((layers, *mask.shape, 3), np.nan, np.float32)
        nodes[:, mask] = _strongest(np.ascontiguousarray(values[:, seen]), lights, share, layers)
        observations = np.zeros(mask.shape, np.int32)
        observations[mask] = (values >= BRIGHT).sum(axis=1)
        if stored is not None:
            np.savez(stored, nodes=nodes, observations=observations)
    markup = folder / "markup.json"
    marks = _marks(json.loads(markup.read_text()), half_vectors) if markup.exists() else None
    return Scene(name, nodes, observations, mask, truth, marks)


def _pixels(video: Path, mask: np.ndarray) -> np.ndarray:
    """Luma of the mask's pixels over all frames (N, T) uint8."""
    capture, frames = cv2.VideoCapture(str(video)), []
    rows = slice(REGION_ORIGIN, REGION_ORIGIN + mask.shape[0])
    columns = slice(REGION_ORIGIN, REGION_ORIGIN + mask.shape[1])
    while True:
        good, frame = capture.read()
        if not good:
            return np.array(frames).T
        frames.append(cv2.cvtColor(frame[rows, columns], cv2.COLOR_BGR2GRAY)[mask])


def _marks(entries: list[dict[str, Any]], half_vectors: np.ndarray) -> Marks:
    """The markup file's highlights in region pixels."""
    pixels = [[round(entry["y"]) - REGION_ORIGIN, round(entry["x"]) - REGION_ORIGIN] for entry in entries]
    kind = [int(entry["kind"] == "true") for entry in entries]
    return Marks(np.array(pixels), half_vectors[[entry["frame"] for entry in entries]], np.array(kind))


def reconstruct(scene: Scene, layers: int = 3, marks: Marks | None = None, **parameters: Any) -> Reconstruction:
    """Labelling of a scene with some of its layers."""
    return reconstruct_normals(SimpleNamespace(normals=scene.nodes[:layers]), scene.mask, marks=marks, **parameters)


def errors(scene: Scene, normals: np.ndarray) -> tuple[float, float]:
    """Mean squared normal error over the data region and over the whole mask."""
    judged = scene.mask & np.isfinite(scene.truth[..., 0])
    squared = ((normals - scene.truth) ** 2).sum(axis=-1)
    return float(squared[judged & (scene.observations > 0)].mean()), float(squared[judged].mean())


def describe(scene: Scene) -> None:
    """Print the default's labels and the reliability of its confidence."""
    started = perf_counter()
    result = reconstruct(scene)
    seconds = perf_counter() - started
    right = angles(scene.nodes, scene.truth) < 5
    labels = result.labels > 0
    recall = (labels & right).any(axis=0).sum() / right.any(axis=0).sum()
    print(
        f"{scene.name}: precision {(labels & right).sum() / max(labels.sum(), 1):.3f}, recall {recall:.3f}, "
        f"silhouette only {errors(scene, result.initial)[0]:.4f}/{errors(scene, result.initial)[1]:.4f}, "
        f"{len(result.rounds)} rounds, {seconds:.2f} s"
    )
    judged = scene.mask & np.isfinite(scene.truth[..., 0])
    near = angles(result.normals, scene.truth) < 5
    limits = [0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 1.01]
    for low, high in pairwise(limits):
        bin_ = judged & (result.confidence >= low) & (result.confidence < high)
        if bin_.any():
            share = bin_.sum() / judged.sum()
            print(
                f"    confidence {low:.2f}-{min(high, 1):.2f}: {share:5.1%} of the mask, {near[bin_].mean():.3f} right"
            )


def picture(scene: Scene, folder: Path) -> None:
    """Write truth, result, silhouette only; error up to 45 degrees, provenance (wrong labels red), confidence."""
    result = reconstruct(scene)
    error = angles(result.normals, scene.truth)
    colours = np.array([[0, 0, 0], [0, 160, 0], [255, 255, 0], [0, 200, 255], [110, 60, 0]], np.uint8)
    sources = colours[result.provenance]
    sources[(result.provenance == 1) & (error > 8)] = (0, 0, 255)

    def colour(normals: np.ndarray) -> np.ndarray:
        return np.nan_to_num((normals + 1) * 127.5).astype(np.uint8)[..., ::-1]

    def heat(values: np.ndarray) -> np.ndarray:
        image = cv2.applyColorMap(np.nan_to_num(np.clip(values, 0, 1) * 255).astype(np.uint8), cv2.COLORMAP_INFERNO)
        return np.where(scene.mask[..., None], image, 0)

    upper = [colour(scene.truth), colour(result.normals), colour(result.initial)]
    lower = [heat(error / 45), sources, heat(result.confidence)]
    folder.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(folder / f"{scene.name}.png"), np.vstack([np.hstack(upper), np.hstack(lower)]))


def main() -> None:
    """Run the laboratory on a folder of captures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path)
    parser.add_argument("--turntable", action="store_true", help="also the eight views of the turntable")
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--cache", type=Path, help="folder that keeps the grouped highlights")
    arguments = parser.parse_args()
    if arguments.cache:
        arguments.cache.mkdir(parents=True, exist_ok=True)
    folders = {name: arguments.captures / name / "front" for name in ("hemisphere", "cylinder", "duck")}
    if arguments.turntable:
        folders |= {path.name: path for path in sorted((arguments.captures / "duck-turntable").glob("view-*"))}
    scenes = [load_scene(folder, name, arguments.cache) for name, folder in folders.items()]
    for scene in scenes:
        describe(scene)
        if arguments.pictures:
            picture(scene, arguments.pictures)
    print(f"\n{'data/whole':28s}" + "".join(f"{scene.name:>15s}" for scene in scenes))
    for title, parameters in ABLATIONS.items():
        row = [errors(scene, reconstruct(scene, **parameters).normals) for scene in scenes]
        print(f"{title:28s}" + "".join(f"    {data:.4f}/{whole:.4f}"[-15:] for data, whole in row), flush=True)
    marked = [errors(scene, reconstruct(scene, marks=scene.marks).normals) if scene.marks else None for scene in scenes]
    row = [f"    {pair[0]:.4f}/{pair[1]:.4f}"[-15:] if pair else f"{'-':>15s}" for pair in marked]
    print(f"{'with marks':28s}" + "".join(row))


if __name__ == "__main__":
    main()
