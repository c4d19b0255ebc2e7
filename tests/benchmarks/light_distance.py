"""Near lights, near cameras with two spheres, and shake: what each source of evidence measures, against the truth.

    python -m tests.benchmarks.light_distance [DATA]

First two spheres computed from the mirror law: relative error of a light's distance, one that stays and one that varies
by a fifth, with one distance for all frames and with one that follows them. Then simulated captures with one sphere:
distance by the background against the truth (near cameras: `near_camera`). Then the shared captures, up to the lights,
with all spheres that the catalogue gives and with the first alone, without marks. Then false shake on the shared
photographs and captures. Takes about ten minutes. DATA: the folder of shared data.
"""

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from glint.storage.catalogue.loading import Capture, Catalogue, load
from glint.storage.footage.source import open_footage
from glint.tasks.algorithms.frames.shake import shake_amplitude
from glint.tasks.algorithms.frames.stabilization import register
from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.near_light.focal_length_of_parallax import focal_length_of_parallax
from glint.tasks.algorithms.near_light.positions import SphereLights
from glint.tasks.algorithms.near_light.triangulation import fit_parallax, triangulate
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.simulation.simulate import CaptureOptions, simulate
from glint.tasks.stages.stabilization import reduced_frames
from tests.tasks.algorithms.near_light.two_spheres import (
    LEFT,
    MIDDLE,
    RIGHT,
    light_positions,
    sphere_normals,
    sphere_normals_in_perspective,
)
from tests.tasks.make_context import perform_all

CATALOGUES = ("single-views.yaml", "field-marked.yaml", "turntable.yaml")
PHOTOGRAPHS = (
    "psbox/LightProbe-1/Image_*.JPG",
    "psbox/LightProbe-2/Image_*.JPG",
    "psbox/Objects/Image_*.png",
    "uw_chrome/chrome/chrome.[0-9]*.png",
    "uw_chrome/owl/owl.[0-9]*.png",
    "uw_chrome/gray/gray.[0-9]*.png",
    "gold_ring/*.jpg",
    "bottle/img_*.png",
)
FRAMES = 800


def two_spheres() -> None:
    """Print the error of the distance, and of a focal length, by the noise of the spheres' normals."""
    print("\nTwo spheres: median relative error of the distance; found over true focal length, near and distant light")
    for noise in (0.001, 0.004, 0.01):
        line = f"noise {np.degrees(noise):.2f} degrees:"
        for name, share in (("one distance", 0.0), ("varying", 0.2)):
            distance = 1000.0 * (1.0 + share * np.sin(np.arange(FRAMES) / 60))
            positions = light_positions(distance, FRAMES)
            generator = np.random.default_rng(1)
            shown = [
                unit(sphere_normals(positions, sphere) + generator.normal(0, noise, (FRAMES, 3))) for sphere in PAIR
            ]
            sites = [
                SphereLights.of(normals, sphere, MIDDLE, None) for normals, sphere in zip(shown, PAIR, strict=True)
            ]
            constant, varying = fit_parallax(sites), triangulate(sites)
            assert constant is not None and varying is not None
            errors = [np.median(np.abs(fit.inverse_distance * distance - 1)) for fit in (constant, varying)]
            line += f" {name}: {errors[0]:.3f} for all frames, {errors[1]:.3f} by frame (varies: {varying.varies});"
        for fixed in (1000.0, 1e6):
            positions = light_positions(fixed, FRAMES)
            exact = [sphere_normals_in_perspective(positions, sphere, MIDDLE, 900.0) for sphere in PAIR]
            shown = [unit(normals + generator.normal(0, noise, normals.shape)) for normals in exact]
            focal = focal_length_of_parallax(shown, PAIR, MIDDLE)
            line += f" {'none' if focal is None else format(focal / 900.0, '.2f')}"
        print(line, flush=True)


PAIR = (LEFT, RIGHT)


def simulated(folder: Path) -> None:
    """Print the distance that the background shows of simulated captures with a single sphere, by how strongly they are
    compressed, how much the exposure drifts, and how far the table leans away from the camera."""
    print("\nSimulated, one sphere: distance found (true) in pixels, error of the lights")
    careful = CaptureOptions(frames=600, scale=0.5, seed=7, crf=18)
    variants = {
        "crf 18": careful,
        "crf 24": replace(careful, crf=24, exposure_drift=0.1),
        "crf 30": replace(careful, crf=30, exposure_drift=0.2),
        "table at 40 degrees": replace(careful, table_tilt=40.0),
        "table at 65 degrees": replace(careful, table_tilt=65.0),
    }
    for distance in (None, 20.0, 10.0, 5.0, 3.0):
        for name, variant in variants.items():
            options = replace(variant, light_distance=distance)
            path = simulate("fish", folder / f"{name}-{distance}", options).catalogue
            capture = load(path).objects[0].captures[0]
            with open_footage(capture.frames) as footage:
                true = np.inf if distance is None else distance * footage.width
            print(f"{distance} frame widths, {true:.0f} pixels, {name}:", lights_of(capture, folder), flush=True)


def shared(captures: Path, folder: Path) -> None:
    """Print the same of the shared captures, with all spheres and with the first alone."""
    print("\nShared captures: distance, source, error of the lights")
    for name in CATALOGUES:
        for label, capture in captures_of(load(captures / name)):
            for count in range(len(capture.spheres), 0, -1):
                entry = capture.model_copy(update={"spheres": capture.spheres[:count], "markup": None})
                print(f"{label}, {count} spheres:", lights_of(entry, folder), flush=True)


def captures_of(catalogue: Catalogue) -> Iterator[tuple[str, Capture]]:
    """Yield the captures with spheres and truth, and their names."""
    for item in catalogue.objects:
        for capture in item.captures[:2]:
            if capture.spheres and capture.truth:
                yield f"{item.id}/{capture.id}", capture


def lights_of(capture: Capture, folder: Path) -> str:
    """Measure the lights of a capture and describe them."""
    with tempfile.TemporaryDirectory(dir=folder) as store:
        work = CaptureContext(store, "object", capture, Parameters(), "benchmark")
        records = perform_all(work, "lights")
        saved = work.load("lights")
        near, deviation = saved.record["near_light"], np.degrees(saved.read("half_vector_sd"))
        truth = np.load(Path(str(capture.truth)) / "lights.npy")
        error = angles(saved.read("lights"), truth[: len(saved.read("lights"))])
        warnings = [warning.message[:40] for warning in records[-1].warnings if warning.cause in ("light", "camera")]
    distance = "distant" if near is None else f"{near['distance']:.0f} px by the {near['source']}"
    return (
        f"{distance}, lights off by {np.nanmedian(error):.2f} degrees, half vectors uncertain by"
        f" {deviation.min():.2f} to {deviation.max():.2f} degrees, {warnings}"
    )


def shake(data: Path) -> None:
    """Print how far the cameras of tripod recordings seem to have moved."""
    print("\nTripods: shake in pixels")
    videos = sorted((data / "captures").glob("*/*/video.mp4"))
    for address in [*(str(data / "real" / pattern) for pattern in PHOTOGRAPHS), *map(str, videos)]:
        with open_footage(address) as footage:
            frames, reduction = reduced_frames(footage)
        print(f"{address[len(str(data)) + 1 :]}: {reduction * shake_amplitude(register(frames)[1]):.2f}", flush=True)


def main(data: Path) -> None:
    """Run all parts; those on shared data only where it is."""
    two_spheres()
    with tempfile.TemporaryDirectory() as folder:
        simulated(Path(folder))
        if data.is_dir():
            shared(data / "captures", Path(folder))
            shake(data)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", nargs="?", type=Path, default=Path(__file__).parents[2].parent / "shared" / "data")
    main(parser.parse_args().data)
