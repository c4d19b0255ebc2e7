"""Light and half vector of every frame from the highlight on a mirror ball (paper, section 3: orientation consistency).

The normal of the ball where it shows the lamp is the half vector H of the lamp L and the view V = (0, 0, 1), and it is
what a highlighted object pixel receives as candidate normal. A long video passes through in blocks: `static_level` of
a sample of its frames, `measure_highlights` of each block, `decide_lights` over all of them; `find_lights` is the
three in a row.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of, lights_of, unit
from glint.tasks.algorithms.lighting.highlights import REMEDY, Highlights, StaticLevel, measure_highlights, static_level
from glint.tasks.algorithms.lighting.spheres import Sphere

REASONS = ("accepted", "no light", "behind the object", "two lights", "clipped or ambiguous", "outside the sphere")
"""Words of the codes in `Lights.reason`."""
ACCEPTED, NO_LIGHT, BEHIND, TWO_LIGHTS, AMBIGUOUS, OUTSIDE = range(len(REASONS))

BEHIND_NZ = float(np.cos(np.radians(45.0)))
"""n_z of the ball's normal below which the light is more than 90 degrees from the view vector."""


@dataclass(frozen=True, slots=True)
class Lights:
    """half_vectors and lights (T, 3) float32 in the camera frame, NaN where rejected; reason (T,) uint8 into REASONS.

    `extent` (T,) float32 is the area in pixels of each accepted highlight; `disagreement` (T,) float32 the largest
    angle in degrees between any one sphere's half vector and the combined one (NaN with a single sphere).
    """

    half_vectors: np.ndarray
    lights: np.ndarray
    reason: np.ndarray
    extent: np.ndarray
    disagreement: np.ndarray

    @property
    def accepted(self) -> np.ndarray:
        """(T,) bool: frames with a light."""
        return self.reason == ACCEPTED


def decide_lights(
    highlights: Sequence[Highlights], static: StaticLevel, sphere: Sphere, *, second: float = 0.5, odd: float = 3.0
) -> Lights:
    """One light per frame or the reason why there is none, from the blobs of all blocks in order.

    Two blobs before the object are two lights where the second has at least `second` of the first one's area; an
    area that differs from the capture's median by more than `odd` times is ambiguous (the lamp's area is constant).
    """
    light = np.concatenate([block.light for block in highlights])
    extent = np.concatenate([block.extent for block in highlights])
    blind = np.concatenate([block.blind for block in highlights])
    contrast = static.white - float(np.median(static.level))
    if contrast < max(12.0, 8.0 * static.noise) or not (extent > 0).any():
        raise UnusableCapture(
            f"no moving light on the sphere at ({sphere.x:.1f}, {sphere.y:.1f}) in any of {len(light)} frames "
            f"(the brightest spot is {max(contrast, 0.0):.0f} levels above the static picture)",
            REMEDY,
        )
    half = half_vectors_of(light.astype(np.float64))
    front = (half[..., 2] >= BEHIND_NZ) & (extent > 0)
    reason = np.full(len(light), ACCEPTED, np.uint8)
    usual = float(np.median(extent[:, 0][front[:, 0]])) if front[:, 0].any() else 0.0
    inner_area = 0.5 * np.pi * sphere.radius**2
    unusual = (extent[:, 0] > odd * usual) | (extent[:, 0] < usual / odd)
    reason[unusual | (blind[:, 0] > 0.25)] = AMBIGUOUS
    reason[front[:, 1] & (extent[:, 1] >= second * np.maximum(extent[:, 0], usual))] = TWO_LIGHTS
    reason[~front[:, 0]] = BEHIND
    reason[~front[:, 0] & (half[:, 0, 2] < 0.2)] = OUTSIDE
    reason[extent[:, 0] > 0.25 * inner_area] = AMBIGUOUS
    reason[extent[:, 0] <= 0] = NO_LIGHT
    return _lights(half[:, 0], reason, extent[:, 0])


def find_lights(
    frames: np.ndarray, sphere: Sphere, *, block: int = 1024, sample: int = 200, **parameters: Any
) -> Lights:
    """Lights of frames (T, h, w) uint8 or uint16 cropped around a sphere given in the crop's pixels.

    Parameters are those of `static_level`, `measure_highlights` and `decide_lights` by name.
    Raises UnusableCapture where no frame shows a light.
    """
    steps = np.unique(np.linspace(0, len(frames) - 1, min(sample, len(frames))).round().astype(int))
    static = static_level(frames[steps], sphere, **_only(parameters, "percentile", "camera"))
    measuring = _only(parameters, "seed", "low", "high", "reach", "camera")
    blocks = [
        measure_highlights(frames[start : start + block], sphere, static, **measuring)
        for start in range(0, len(frames), block)
    ]
    return decide_lights(blocks, static, sphere, **_only(parameters, "second", "odd"))


def _lights(half: np.ndarray, reason: np.ndarray, extent: np.ndarray, disagreement: np.ndarray | None = None) -> Lights:
    half = np.where((reason == ACCEPTED)[:, None], half, np.nan)
    lights = lights_of(half)
    if disagreement is None:
        disagreement = np.full(len(half), np.nan, np.float32)
    return Lights(
        half.astype(np.float32),
        lights.astype(np.float32),
        reason.astype(np.uint8),
        extent.astype(np.float32),
        disagreement,
    )


def _only(parameters: dict[str, Any], *names: str) -> dict[str, Any]:
    return {name: parameters[name] for name in names if name in parameters}


def disagreement_of(lights: Lights) -> tuple[float, float]:
    """Median and 95th percentile in degrees of the spheres' disagreement; NaN where no frame has two spheres."""
    known = lights.disagreement[np.isfinite(lights.disagreement)]
    return (float(np.median(known)), float(np.percentile(known, 95.0))) if known.size else (np.nan, np.nan)


def combine_lights(per_sphere: Sequence[Lights], *, tolerance: float = 5.0) -> Lights:
    """Lights of several spheres as one: the mean half vector of those that accept the frame.

    A frame whose spheres lie further than `tolerance` degrees from their mean is ambiguous; a frame that no sphere
    accepts keeps the first sphere's reason.
    """
    if not per_sphere:
        raise ValueError("no lights to combine")
    if len({len(lights.reason) for lights in per_sphere}) != 1:
        raise ValueError(f"frames differ: {[len(lights.reason) for lights in per_sphere]}")
    if len(per_sphere) == 1:
        return per_sphere[0]
    stack = np.stack([lights.half_vectors for lights in per_sphere]).astype(np.float64)
    accepted = np.stack([lights.accepted for lights in per_sphere])
    mean = unit(np.where(accepted[..., None], stack, 0.0).sum(axis=0))
    apart = np.where(accepted, angles(np.where(accepted[..., None], stack, mean), mean), 0.0).max(axis=0)
    several = accepted.sum(axis=0) > 1
    reason = np.where(accepted.any(axis=0), ACCEPTED, per_sphere[0].reason)
    reason[several & (apart > tolerance)] = AMBIGUOUS
    extent = np.where(accepted, [lights.extent for lights in per_sphere], 0.0).max(axis=0)
    return _lights(mean, reason, extent, np.where(several, apart, np.nan).astype(np.float32))
