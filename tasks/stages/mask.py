"""Mask: the object's pixels, given or estimated, and where they are doubtful."""

import numpy as np

from glint.storage.inputs.masks_and_truth import read_mask
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.mask_checks.mask_doubt import Objection, covered_spheres, doubt_of, mask_objections
from glint.tasks.algorithms.masks.mask import beside_spheres
from glint.tasks.algorithms.masks.mask_regions import object_sizes
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import CaptureGeometry, load_geometry
from glint.tasks.stages.levels import load_levels

UNSUPPORTED_COST_DEG = 5.0
"""Error of the normals beside a contour that nothing supports: that of a contour off by a tenth of the inradius."""
CUT_COST_DEG = 15.0
"""Error of the normals beside a contour that is the frame's edge, or beyond which the object goes on: there the surface
does not turn from the camera."""
SHAPE_COST_DEG = 3.0
"""Error of the normals beside a neck or a ragged piece, of a sphere that the mask covers, and of several objects that
are taken for one."""
REMEDY = "correct it by hand: `glint check` writes mask.png, frame.png and brightest.png, and draws the doubt in red"


def mask(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Read or estimate the mask of the region, and compare it with background and peak level.

    Raises:
        InputError: the given mask cannot be used.
    """
    geometry, address = load_geometry(inputs), inputs.file("mask")
    region, (width, height) = geometry.region, geometry.frame_size
    if address is not None:
        pixels = read_mask(address, (height, width), region)
    else:
        pixels = inputs.load("survey").read("mask")
    objections = _objections(inputs, geometry, pixels, estimated=address is None)
    return StageOutput(
        arrays={"mask": pixels, "doubt": doubt_of(pixels, objections)},
        record={"region": region.model_dump(), "estimated": address is None},
        counts={"object pixels": int(pixels.sum())},
        warnings=[
            *(_warning(objection, pixels, geometry, address is None) for objection in objections),
            *_several_objects(pixels, geometry, address is None),
        ],
    )


def _objections(inputs: StageInputs, geometry: CaptureGeometry, pixels: np.ndarray, estimated: bool) -> list[Objection]:
    region, (width, height) = geometry.region, geometry.frame_size
    background, peak = load_levels(inputs)
    scale = np.float32(1.0 if background.dtype == np.uint8 else 1.0 / 257.0)
    # Where a person cut a region out, an object may go on beyond it that no mask tells to end there.
    is_cut_out = estimated and inputs.field("region") is not None
    edges = np.zeros(pixels.shape, bool)
    edges[0] |= is_cut_out or region.y == 0
    edges[:, 0] |= is_cut_out or region.x == 0
    edges[-1] |= is_cut_out or region.y + region.height == height
    edges[:, -1] |= is_cut_out or region.x + region.width == width
    spheres = [sphere.in_crop(region.x, region.y) for sphere in geometry.spheres]
    return covered_spheres(pixels, spheres) + mask_objections(
        pixels,
        background * scale,
        peak * scale,
        free=beside_spheres(pixels.shape, spheres),
        estimated=estimated,
        edges=edges,
    )


def _warning(objection: Objection, pixels: np.ndarray, geometry: CaptureGeometry, estimated: bool) -> StageWarning:
    """Return an objection in words, with its place in pixels of the full frame."""
    name = "the estimated mask" if estimated else "the mask"
    x, y = objection.x + geometry.region.x, objection.y + geometry.region.y
    place = f"on its {_side(objection, pixels)}, about x {x:.0f}, y {y:.0f}"
    if objection.kind in ("too large", "too small"):
        amount = f" by {abs(objection.offset):.0f} pixels" if objection.offset else f" {place}"
        beside = "inside" if objection.kind == "too large" else "outside"
        evidence = f"the strongest edges and highlights lie {beside} its contour"
        cost = float(np.degrees(np.arctan(max(abs(objection.offset), 2.0) / max(inradius_of(pixels), 1.0))))
        return StageWarning(f"{name} is {objection.kind}{amount}: {evidence}; {REMEDY}", "mask", round(cost, 1))
    share = f"{objection.share:.0%} of its contour"
    text, cost = {
        "corners": (
            "it covers all four corners of the picture, as an inverted mask does: the object is white, all else black",
            CUT_COST_DEG,
        ),
        "cut": (f"{share} lies along the edge of frame or region {place}: the object goes on beyond it", CUT_COST_DEG),
        "continued": (f"highlights go on beyond {share} {place}, as if it lacked a part of the object", CUT_COST_DEG),
        # Which of the two is wrong, the lights tell: a circle that is no sphere costs far more.
        "sphere": (f"it covers {objection.share:.0%} of the circle of the chrome sphere {place}", SHAPE_COST_DEG),
        "neck": (f"a neck joins its parts {place}", SHAPE_COST_DEG),
        "ragged": (f"its contour is ragged {place}", SHAPE_COST_DEG),
        "unsupported": (f"no highlight was recorded near {share}, most {place}", UNSUPPORTED_COST_DEG),
    }[objection.kind]
    return StageWarning(f"{name} is doubtful: {text}; {REMEDY}", "mask", cost)


def _several_objects(pixels: np.ndarray, geometry: CaptureGeometry, estimated: bool) -> list[StageWarning]:
    """Warn of a mask of several objects: symmetry, surroundings and depth are sought as those of one."""
    spheres = [sphere.in_crop(geometry.region.x, geometry.region.y) for sphere in geometry.spheres]
    sizes = object_sizes(pixels, beside_spheres(pixels.shape, spheres))
    if len(sizes) < 2:
        return []
    name = "the estimated mask" if estimated else "the mask"
    texts = [f"{size:,}" for size in sizes]
    counted = f"{', '.join(texts[:-1])} and {texts[-1]} pixels"
    message = (
        f"{name} has {len(sizes)} separate parts of similar size, {counted}, as of {len(sizes)} objects: make each"
        " an object of its own, with the same video and a mask of it alone; if it is one object, join the parts"
    )
    return [StageWarning(message, "mask", SHAPE_COST_DEG)]


def _side(objection: Objection, pixels: np.ndarray) -> str:
    """Return the side of the object on which an objection's piece lies."""
    rows, columns = np.nonzero(pixels)
    right = (objection.x - columns.mean()) / max(float(np.ptp(columns)), 1.0)
    down = (objection.y - rows.mean()) / max(float(np.ptp(rows)), 1.0)
    if abs(right) > abs(down):
        return "right" if right > 0 else "left"
    return "lower side" if down > 0 else "upper side"
