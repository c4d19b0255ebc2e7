"""A bottle with flat sides: a block and a narrower one along the same axis, as its neck."""

from dataclasses import replace

import numpy as np

from tests.tasks.algorithms.prisms.block import Block

BODY = Block(slope=30.0, lean=6.0, radius=44.0, half_height=40.0)
NECK_RADIUS, NECK_TOP = 14.0, 62.0


def render_bottle(body: Block = BODY) -> tuple[np.ndarray, np.ndarray]:
    """Return normals (H, W, 3) in the camera frame and z (H, W), NaN beside the bottle."""
    neck = replace(body, radius=NECK_RADIUS, half_height=NECK_TOP, lean=0.0)
    (outer, front, _), (inner, upper, _) = body.render(), neck.render()
    # What the neck would show below the body is hidden behind it.
    is_neck = np.nan_to_num(upper, nan=-np.inf) > np.nan_to_num(front, nan=-np.inf)
    return np.where(is_neck[..., None], inner, outer), np.where(is_neck, upper, front)
