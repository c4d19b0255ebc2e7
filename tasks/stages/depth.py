"""Depth: the normals integrated inside the mask."""

import numpy as np

from glint.tasks.algorithms.geometry.perspective import areal_focal_length
from glint.tasks.algorithms.integration.bilateral import integrate
from glint.tasks.algorithms.integration.contour_margin import with_margin
from glint.tasks.algorithms.integration.search_limits import SearchLimits
from glint.tasks.algorithms.labelling.results import OUTSIDE
from glint.tasks.engine.parameters import DepthParameters
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.stages.capture_geometry import load_geometry

DEPTH_PROVENANCE = "outside", "integrated", "extrapolated"
"""Names of the codes of where a depth comes from: from the normals, or beside the contour from the depth inside it."""
INTEGRATED, EXTRAPOLATED = 1, 2
NORMAL_WEIGHT_POWER = 0.5
"""Power of the confidence in the weight of a normal: with less, the shapes of doubtful normals count; with more, a cut
through them is preferred to one along a lip (measured on stored captures, docs/evaluation/depth.md)."""


def depth(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Integrate the normals to depth towards the camera, in millimetres where the scale is known, else in pixels.

    Under perspective the object's distance is that at which a pixel covers `pixel_size`; it cannot be known otherwise.
    """
    parameters: DepthParameters = inputs.parameters
    labels, geometry = inputs.load("labels"), load_geometry(inputs)
    mask = inputs.load("mask").read("mask")
    result = integrate(
        labels.read("normals"),
        mask,
        confidence=labels.read("confidence") ** NORMAL_WEIGHT_POWER if parameters.use_confidence else None,
        method=parameters.method,
        camera=geometry.region_camera,
        body=labels.read("body_depth") if "body_depth" in labels.arrays else None,
        limits=SearchLimits(sharpness=parameters.sharpness, max_rounds=parameters.rounds),
    )
    pixel_size, camera = geometry.pixel_size or 1.0, geometry.camera
    distance = None if camera is None else pixel_size * areal_focal_length(camera)
    height = result.depth if distance is None else result.height(distance) / np.float32(pixel_size)
    # Normals beside the contour are those of the contour, not of pixel centres: the heights inside say more.
    towards_camera, extrapolated = with_margin(height, mask)
    provenance = np.where(mask, np.where(extrapolated, EXTRAPOLATED, INTEGRATED), OUTSIDE).astype(np.uint8)
    return StageOutput(
        arrays={"depth": (towards_camera * pixel_size).astype(np.float32), "provenance": provenance},
        record={
            "provenance": list(DEPTH_PROVENANCE),
            "unit": geometry.unit,
            "pixel_size": geometry.pixel_size,
            "distance": distance,
            "components": int(result.components.max()),
            "energy": result.energy,
            "converged": result.converged,
            "follows_body": result.follows_body,
        },
        counts={"components": int(result.components.max()), "iterations": result.rounds},
    )
