"""Depth: the normals integrated inside the mask."""

import numpy as np

from glint.tasks.algorithms.integration.bilateral import integrate
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.stage import Outcome, Progress
from glint.tasks.stages.frames import camera_within, region_of


def depth(work: Workspace, progress: Progress) -> Outcome:
    """Depth towards the camera, in millimetres where the scale is known, else in pixels.

    Under perspective the object's distance is that at which a pixel covers `pixel_size`; it cannot be known otherwise.
    """
    labels, survey, region = work.load("labels"), work.load("survey").record, region_of(work)
    parameters, camera = work.parameters.depth, work.camera_matrix
    found = integrate(
        labels.read("normals"),
        work.load("mask").read("mask"),
        confidence=labels.read("confidence") if parameters.confident else None,
        method=parameters.method,
        camera=camera_within(work, region),
        sharpness=parameters.sharpness,
        max_iterations=parameters.rounds,
    )
    pixel_size = survey["pixel_size"] or 1.0
    distance = None if camera is None else pixel_size * float(np.sqrt(camera[0, 0] * camera[1, 1]))
    towards = found.depth * np.float32(pixel_size) if distance is None else found.height(distance)
    return Outcome(
        arrays={"depth": towards.astype(np.float32)},
        record={
            "unit": survey["unit"],
            "pixel_size": survey["pixel_size"],
            "distance": distance,
            "components": int(found.components.max()),
            "energy": found.energy,
        },
        counts={"components": int(found.components.max()), "iterations": found.iterations},
    )
