"""Estimated masks against the true ones: overlap, distance of the contours, warnings; and masks that are wrong.

    python -m tests.benchmarks.masks [--quick] [--seed S] [--folder DIR]
        [--vessels ROUNDS | --tables FIRST-LAST | CATALOGUE ..]

Without a catalogue it simulates the presets in full size and length (--quick: half the size, 500 frames) and takes the
shared captures too, where they are there. --vessels simulates glasses and mugs instead, so many of each shape, whose
options (camera, light, noise, size) follow from the seed; their mean overlap comes last. --tables takes the scenes of
`table_scenes`, objects and spheres on tables with their shadows and caustics. Captures are surveyed without mask and
region, with the spheres given.
"""

import argparse
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy import ndimage

from glint.storage.catalogue.loading import Capture
from glint.storage.inputs.masks_and_truth import read_mask
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.mask_checks.mask_doubt import mask_objections
from glint.tasks.algorithms.masks.mask import beside_spheres
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.engine.references import load_catalogue
from glint.tasks.engine.stage import perform, stage_keys
from glint.tasks.pipeline import STAGES, stages_until
from glint.tasks.simulation.simulate import PRESETS, CaptureOptions, simulate
from glint.tasks.stages.capture_geometry import load_geometry
from glint.tasks.stages.levels import load_levels
from tests.benchmarks.random_captures import random_capture
from tests.benchmarks.table_scenes import SHAPES, table_captures

SHARED = Path(__file__).parents[2].parent / "shared" / "data" / "captures"
WRONG_BY_PX = 3
GLASSES = ("wine-glass", "water-glass", "goblet", "tumbler", "coupe", "mug", "tankard", "cut-bowl")


def bare(context: CaptureContext) -> CaptureContext:
    """Return the same capture with nothing but its video, spheres and camera."""
    entry = context.capture.model_dump(mode="json", exclude_none=True)
    kept = {key: entry[key] for key in ("id", "frames", "spheres", "camera") if key in entry}
    return CaptureContext(context.store, context.object_id, type(context.capture).model_validate(kept), Parameters())


def contour_error(mask: np.ndarray, truth: np.ndarray) -> float:
    """Return the mean distance in pixels of the contour of `mask` from that of `truth`."""
    distance = ndimage.distance_transform_edt(~(truth ^ ndimage.binary_erosion(truth)))
    return float(distance[mask ^ ndimage.binary_erosion(mask)].mean())


def truth_of(capture: Capture, size: tuple[int, int]) -> np.ndarray:
    """Return the true mask in the full frame."""
    assert capture.mask is not None
    pixels, truth = read_mask(capture.mask, size, capture.region), np.zeros(size, bool)
    if capture.region is None:
        return pixels
    truth[capture.region.rows, capture.region.columns] = pixels
    return truth


def measure(context: CaptureContext) -> tuple[str, float]:
    """Return a line of the table (the mask, whether the true one and wrong ones are objected to), and the overlap."""
    work = bare(context)
    keys = stage_keys(work, STAGES)
    records = [perform(work, stage, keys[stage.name]) for stage in stages_until("mask")]
    geometry = load_geometry(work)
    width, height = geometry.frame_size
    truth, mask = truth_of(context.capture, (height, width)), np.zeros((height, width), bool)
    window = geometry.region.rows, geometry.region.columns
    mask[window] = work.load("mask").read("mask")
    overlap = float((mask & truth).sum() / (mask | truth).sum())
    warned = "yes" if any(warning.cause == "mask" for warning in records[-1].warnings) else "no"
    given = " | ".join(
        "yes" if objections(work, wrong[window]) else "no"
        for wrong in (
            truth,
            ndimage.distance_transform_edt(~truth) <= WRONG_BY_PX,
            ndimage.distance_transform_edt(truth) > WRONG_BY_PX,
        )
    )
    return f"| {context.name} | {overlap:.3f} | {contour_error(mask, truth):.2f} | {warned} | {given} |", overlap


def objections(work: CaptureContext, mask: np.ndarray) -> bool:
    """Return whether a given mask (H, W) of the region is objected to."""
    background, peak = load_levels(work)
    region = load_geometry(work).region
    spheres = [sphere.in_crop(region.x, region.y) for sphere in load_geometry(work).spheres]
    free = beside_spheres(mask.shape, spheres)
    edges = np.zeros(mask.shape, bool)
    return bool(mask_objections(mask, background, peak, free=free, estimated=False, edges=edges))


def catalogues(folder: Path, quick: bool, seed: int, given: list[Path]) -> Iterator[Path]:
    """Yield the catalogues to measure."""
    if given:
        yield from given
        return
    options = CaptureOptions(seed=seed, scale=0.5, frames=500) if quick else CaptureOptions(seed=seed)
    for shape in PRESETS:
        simulate(shape, folder, options)
    yield folder / "catalogue.yaml"
    yield from (path for name in ("single-views.yaml", "field.yaml") if (path := SHARED / name).exists())


def captures(folder: Path, options: argparse.Namespace) -> Iterator[CaptureContext]:
    """Yield the captures of the catalogues."""
    for path in catalogues(folder / "captures", options.quick, options.seed, options.catalogues):
        catalogue = load_catalogue(path)
        for item in catalogue.objects:
            for capture in item.captures:
                yield CaptureContext.of(catalogue, item.id, capture.id, str(folder / "store"))


def vessels(folder: Path, options: argparse.Namespace) -> Iterator[CaptureContext]:
    """Yield captures of vessels with random options."""
    for number, shape in enumerate(GLASSES * options.vessels):
        capture = random_capture(shape, options.seed + number, folder / f"{number}", is_given=True)
        yield CaptureContext(str(folder / "store"), f"{shape}-{options.seed + number}", capture, Parameters())


def tables(folder: Path, options: argparse.Namespace) -> Iterator[CaptureContext]:
    """Yield captures of objects on tables."""
    for number, _, capture in table_captures(options.tables, folder):
        name = f"{SHAPES[number % len(SHAPES)]}-{number}"
        yield CaptureContext(str(folder / "store"), name, capture, Parameters())


def main() -> None:
    """Print a row per capture as it is measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("catalogues", nargs="*", type=Path, metavar="CATALOGUE")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--vessels", type=int, default=0, metavar="ROUNDS")
    parser.add_argument("--tables", metavar="FIRST-LAST")
    parser.add_argument("--folder", type=Path, help="folder for captures and store; a temporary one by default")
    options = parser.parse_args()
    print("| capture | IoU | contour, mean px | warned | true mask | 3 px larger | 3 px smaller |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        overlaps = []
        source = tables if options.tables else vessels if options.vessels else captures
        for work in source(folder, options):
            try:
                line, overlap = measure(work)
            except UnusableCapture as error:
                line, overlap = f"| {work.name} | refused: {error.message} | | | | | |", 0.0
            print(line, flush=True)
            overlaps.append(overlap)
        print(f"\nmean overlap {np.mean(overlaps):.3f}, least {min(overlaps):.3f}")


if __name__ == "__main__":
    main()
