"""Opaque objects of every finish under few and many lights: shading, error, share confident, share of these right.

    python -m tests.benchmarks.opaque_objects [SHAPE ...]

The objects: `tests/opaque_objects.py`. A matte finish must have a shading above MAX_SHADING, or be refused; of the
pixels at confidence 0.95, nine tenths must be within 5 degrees.
"""

import argparse
from dataclasses import replace

import numpy as np

from glint.tasks.algorithms.candidates.clusters import cluster_pixels, inverse_density_weights
from glint.tasks.algorithms.candidates.shading import object_shading, with_object_shading, without_shading
from glint.tasks.algorithms.candidates.thresholds import highlight_levels
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of
from glint.tasks.algorithms.labelling.reconstruction import reconstruct_normals
from tests.opaque_objects import FINISHES, light_directions, photograph, shape

LIGHTS = {"12 in 40": (12, 40.0), "42 in 30": (42, 30.0), "64 in 80": (64, 80.0), "400 in 84": (400, 84.0)}


def main() -> None:
    """Print a line per shape, lights and finish."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shapes", nargs="*", metavar="SHAPE", default=["sphere", "vase", "pebble"])
    forms = parser.parse_args().shapes
    print("shape   lights    finish         shading observed median confident right")
    for form in forms:
        truth = shape(form)
        mask = np.isfinite(truth[..., 0])
        for lights, (count, widest) in LIGHTS.items():
            directions = light_directions(count, widest)
            half_vectors = half_vectors_of(directions).astype(np.float32)
            for name, finish in FINISHES.items():
                frames = photograph(truth, finish, directions)
                background = np.median(frames, axis=0).astype(np.uint8)
                line = f"{form:7s} {lights:9s} {name:14s} "
                try:
                    levels = highlight_levels(background, frames.max(axis=0), mask, half_vectors)
                except UnusableCapture as refusal:
                    print(line, refusal)
                    continue
                clusters = cluster_pixels(frames, levels, half_vectors, inverse_density_weights(half_vectors))
                mean = object_shading(clusters.shading)
                clusters = without_shading(replace(clusters, shading=with_object_shading(clusters.shading)))
                observed = (np.isfinite(clusters.normals[..., 0]).any(axis=0) & mask).sum() / mask.sum()
                result = reconstruct_normals(clusters, mask)
                error = angles(result.normals, truth)
                confident = mask & (result.confidence >= 0.95)
                right = (error[confident] < 5).mean() if confident.any() else np.nan
                fails = "FAILS" if confident.sum() > 0.05 * mask.sum() and right < 0.9 else ""
                print(
                    f"{line}{mean:7.2f} {observed:8.0%} {np.nanmedian(error):6.1f} {confident.sum() / mask.sum():9.1%}"
                    f" {right:5.0%} {fails}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
