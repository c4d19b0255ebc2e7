"""Clustering against one pass over the same frames that only thresholds and counts, and the stages after it.

    python -m tests.benchmarks.clustering_speed [--frames N] [--width W] [--height H]

Frames are in memory and synthetic: highlights of the size that a light has on glass, as many as a capture shows. Prints
the ratio of `cluster_pixels` to a single-threaded numba pass that counts values above a threshold, and the seconds of
graph cut, initial normals and integration at the size of the paper's JUG.
"""

import argparse
from time import perf_counter

import numpy as np
from numba import njit

from glint.tasks.algorithms.candidates.clusters import Clusters, cluster_pixels, inverse_density_weights
from glint.tasks.algorithms.candidates.disc_centres import DiscModel
from glint.tasks.algorithms.candidates.lit_frames import HighlightLevels
from glint.tasks.algorithms.geometry.vectors import half_vectors_of, unit
from glint.tasks.algorithms.integration.bilateral import integrate
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from glint.tasks.algorithms.lighting.lights import USUAL_LIGHT_DEG
from glint.tasks.algorithms.prior.silhouette import initial_normals
from glint.tasks.algorithms.simulation.light_path import light_path


@njit(cache=True, nogil=True)
def count_lit(frames: np.ndarray, bar: int) -> np.ndarray:
    """Frames (T, N) above a bar, counted per pixel."""
    counts = np.zeros(frames.shape[1], np.int32)
    for t in range(frames.shape[0]):
        for i in range(frames.shape[1]):
            counts[i] += frames[t, i] > bar
    return counts


def scene(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Mask (H, W) and normals (2, H, W, 3) of a bulging body: its surface, and a distorted sheet behind it."""
    rows, columns = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    mask = rows**2 + columns**2 < 0.96
    flat = np.stack([columns, -rows], axis=-1) * (1 + 0.1 * np.sin(9 * rows))[..., None]
    flat /= np.maximum(np.linalg.norm(flat, axis=-1, keepdims=True) / 0.98, 1.0)
    true = np.concatenate([flat, np.sqrt(1 - (flat**2).sum(axis=-1, keepdims=True))], axis=-1)
    return mask, np.stack([true, unit(true * (-1.3, -0.8, 1.2))])


def footage(normals: np.ndarray, half_vectors: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Frames (T, H, W) uint8 in which both sheets glint within 2.1 degrees of the half vector."""
    near = np.float32(np.cos(np.radians(2.1)))
    frames = np.full((len(half_vectors), *mask.shape), 30, np.uint8)
    for frame, half_vector in zip(frames, half_vectors, strict=True):
        if np.isfinite(half_vector[0]):
            frame[((normals @ half_vector) > near).any(axis=0) & mask] = 255
    return frames


def best(function, *arguments, repeat: int = 3, **named):  # type: ignore[no-untyped-def]
    """Return the result and the least of some times in seconds."""
    times = []
    for _ in range(repeat):
        started = perf_counter()
        result = function(*arguments, **named)
        times.append(perf_counter() - started)
    return result, min(times)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=4000)
    parser.add_argument("--width", type=int, default=251)
    parser.add_argument("--height", type=int, default=221)
    arguments = parser.parse_args()
    half_vectors = half_vectors_of(light_path(arguments.frames, np.random.default_rng(0))).astype(np.float32)
    mask, normals = scene(arguments.height, arguments.width)
    frames = footage(normals.astype(np.float32), half_vectors, mask)
    highlights = HighlightLevels(np.where(mask, 220, 255).astype(np.uint8), saturation=255.0)
    shares = inverse_density_weights(half_vectors)
    flat = frames.reshape(len(frames), -1)
    _, counting = best(count_lit, flat, 225)
    discs = DiscModel.of_light(USUAL_LIGHT_DEG, half_vectors, shares)
    clusters, clustering = best(cluster_pixels, frames, highlights, half_vectors, shares, discs=discs)
    lit = clusters.observations[mask].mean()
    print(
        f"{arguments.frames} frames of {arguments.width} x {arguments.height}: count {counting:.3f} s, cluster"
        f" {clustering:.3f} s, ratio {clustering / counting:.1f}; {lit:.1f} lit frames a pixel"
    )
    mask, normals = scene(419, 279)
    observable = np.where(normals[..., 2:] > np.cos(np.pi / 4), normals, np.nan).astype(np.float32)
    layers = np.concatenate([observable, np.full_like(observable[:1], np.nan)])
    known = np.isfinite(layers[..., 0])
    shading = np.full(known.shape, np.nan, np.float32)
    jug = Clusters(layers, known * 1.0, known * 0.0, known * 1, known.sum(axis=0), layers[0], shading)
    _, initial = best(initial_normals, mask)
    labelled, cut = best(reconstruct_normals, jug, mask)
    _, integration = best(integrate, labelled.normals, mask, confidence=labelled.confidence)
    print(
        f"279 x 419: initial normals {initial:.2f} s, labels {cut:.2f} s, integration {integration:.2f} s,"
        f" together {initial + cut + integration:.2f} s"
    )


if __name__ == "__main__":
    main()
