"""Light and half vector of every frame, from the highlight on a chrome sphere.

Source: orientation consistency (section 3 of Yeung et al. 2009). The sphere's normal where it shows the light is the
half vector H of the light L and the view V = (0, 0, 1), and an object pixel that shows a highlight in the same frame
has it as a candidate normal. A long video is processed in blocks: `static_background` of a sample of its frames,
`measure_highlights` of each block, `classify_frames` over all of them. `find_lights` runs the three in a row.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of, lights_of, unit
from glint.tasks.algorithms.lighting.highlights import (
    LIGHT_REMEDY,
    Highlights,
    StaticBackground,
    measure_highlights,
    static_background,
    without_blur,
)
from glint.tasks.algorithms.lighting.pyramid import spread
from glint.tasks.algorithms.lighting.spheres import MIN_OBSERVABLE_NZ, Sphere, precision_weights

REASONS = (
    "accepted",
    "no light",
    "behind the object",
    "two lights",
    "clipped or ambiguous",
    "outside the sphere",
    "sphere covered",
    "overexposed, or light before the object",
)
"""Names of the codes in `Lights.reason`."""
ACCEPTED, NO_LIGHT, BEHIND, TWO_LIGHTS, AMBIGUOUS, OUTSIDE_SPHERE, COVERED, BEFORE_OBJECT = range(len(REASONS))

BLOCK_FRAMES, BACKGROUND_FRAMES = 1024, 200
"""Frames measured at once, and frames from which the static background is estimated."""
MIN_ON_SPHERE_NZ = 0.2
"""n_z below which a highlight lies so near the contour that it is none of the sphere's."""
MIN_CONTRAST, MIN_CONTRAST_NOISE_RATIO = 12.0, 8.0
"""Contrast of the highlight, in levels of 8 bits and in noise levels, below which there is no moving light."""
MAX_OCCLUDED_FRACTION = 0.25
"""Share of a highlight that static reflections or the crop's edge may hide before its centre is ambiguous."""
MAX_AREA_FRACTION = 0.25
"""Share of the disc of lights before the object beyond which a highlight's area is ambiguous."""
USUAL_LIGHT_DEG, SIZE_STEP_DEG = 9.9, 7.0
"""Angular radius that the spheres show of a light for which discs and rings of half vectors were chosen, and how much
more of one of twice the size: as it is fainter, less of it is bright (`python -m tests.benchmarks.light_sizes`)."""


@dataclass(frozen=True, slots=True)
class Lights:
    """Lights of T frames.

    half_vectors, lights: (T, 3) float32, unit, camera frame, NaN where rejected. reason: (T,) uint8, index into
    `REASONS`. area: (T,) float32, pixels of each highlight. inter_sphere_angle: (T,) float32, largest angle in degrees
    between one sphere's half vector and the middle of all spheres'; NaN with a single sphere.
    """

    half_vectors: np.ndarray
    lights: np.ndarray
    reason: np.ndarray
    area: np.ndarray
    inter_sphere_angle: np.ndarray

    @property
    def accepted(self) -> np.ndarray:
        """Frames with a light, (T,) bool."""
        return self.reason == ACCEPTED

    def angular_radius(self, sphere_radius: float) -> float:
        """Return the light's angular radius in degrees, blur included, by its image in a sphere of this radius in
        pixels; 0 without accepted frames.

        Every pixel reflects a solid angle of 4 / radius^2 steradians (see `measure_highlights`).
        """
        area = float(np.median(self.area[self.accepted])) if self.accepted.any() else 0.0
        return float(np.degrees(2.0 * np.sqrt(area / np.pi) / sphere_radius))


def light_size(angular_radius: float | None) -> float:
    """Return a light's size relative to a usual one's, at least 1; 1 for one of unknown radius.

    angular_radius: of `Lights.angular_radius`, degrees.
    """
    return 1.0 if angular_radius is None else 1.0 + max(angular_radius - USUAL_LIGHT_DEG, 0.0) / SIZE_STEP_DEG


def classify_frames(
    highlights: Sequence[Highlights],
    static: StaticBackground,
    sphere: Sphere,
    *,
    second_light_ratio: float = 0.5,
    area_ratio: float = 3.0,
) -> Lights:
    """Return one light per frame, or the reason why there is none.

    Args:
        highlights: of all blocks of the capture, in order.
        static: the background that they were measured with.
        sphere: in the frames' pixels.
        second_light_ratio: two blobs before the object are two lights if the second has at least this share of the
            first one's area.
        area_ratio: a highlight whose area differs from the capture's median by a larger factor is ambiguous, since the
            light's area is constant.

    Raises:
        UnusableCapture: no frame shows a moving light.
    """
    direction = np.concatenate([block.directions for block in highlights])
    area = np.concatenate([block.area for block in highlights])
    occluded = np.concatenate([block.occluded_fraction for block in highlights])
    contrast = (static.saturation - float(np.median(static.background))) / static.level_of_8_bits
    noise = static.noise / static.level_of_8_bits
    if contrast < max(MIN_CONTRAST, MIN_CONTRAST_NOISE_RATIO * noise) or not (area > 0).any():
        raise UnusableCapture(
            f"no moving light in any of {len(direction)} frames (the brightest spot is {max(contrast, 0.0):.0f} levels"
            " of 255 above the static background)",
            LIGHT_REMEDY,
        )
    half = half_vectors_of(direction.astype(np.float64))
    spread = np.concatenate([block.spread[:, 0] for block in highlights])
    half[:, 0] = without_blur(half[:, 0], area[:, 0], spread, sphere.radius)
    front = (half[..., 2] >= MIN_OBSERVABLE_NZ) & (area > 0)
    usual = float(np.median(area[:, 0][front[:, 0]])) if front[:, 0].any() else 0.0
    # Lights before the object lie within r sin 45 of the sphere's centre.
    front_disc_area = 0.5 * np.pi * sphere.radius**2
    unusual = (area[:, 0] > area_ratio * usual) | (area[:, 0] < usual / area_ratio)
    # Later assignments take precedence: the plainest reason is reported.
    reason = np.full(len(direction), ACCEPTED, np.uint8)
    reason[unusual | (occluded[:, 0] > MAX_OCCLUDED_FRACTION)] = AMBIGUOUS
    reason[front[:, 1] & (area[:, 1] >= second_light_ratio * np.maximum(area[:, 0], usual))] = TWO_LIGHTS
    reason[~front[:, 0]] = BEHIND
    reason[~front[:, 0] & (half[:, 0, 2] < MIN_ON_SPHERE_NZ)] = OUTSIDE_SPHERE
    reason[area[:, 0] > MAX_AREA_FRACTION * front_disc_area] = AMBIGUOUS
    reason[area[:, 0] <= 0] = NO_LIGHT
    return _lights(half[:, 0], reason, area[:, 0])


def without_frames(lights: Lights, rejected: np.ndarray, reason: int) -> Lights:
    """Return lights whose accepted frames (T,) bool are rejected for another reason, an index into `REASONS`."""
    codes = np.where(rejected & lights.accepted, reason, lights.reason)
    return _lights(
        lights.half_vectors, codes, lights.area, np.where(codes == ACCEPTED, lights.inter_sphere_angle, np.nan)
    )


def find_lights(frames: np.ndarray, sphere: Sphere, *, camera: np.ndarray | None = None) -> Lights:
    """Find the lights of frames (T, h, w) uint8 or uint16, cropped around a sphere given in the crop's pixels.

    camera: see `measure_highlights`.

    Raises:
        UnusableCapture: no frame shows a light.
    """
    static = static_background(spread(frames, BACKGROUND_FRAMES), sphere, camera=camera)
    blocks = [
        measure_highlights(frames[start : start + BLOCK_FRAMES], sphere, static, camera=camera)
        for start in range(0, len(frames), BLOCK_FRAMES)
    ]
    return classify_frames(blocks, static, sphere)


def inter_sphere_angles(lights: Lights) -> tuple[float, float]:
    """Return median and 95th percentile in degrees of the inter-sphere angle; NaN if no frame has two spheres."""
    known = lights.inter_sphere_angle[np.isfinite(lights.inter_sphere_angle)]
    return (float(np.median(known)), float(np.percentile(known, 95.0))) if known.size else (np.nan, np.nan)


def merge_spheres(per_sphere: Sequence[Lights], spheres: Sequence[Sphere], *, tolerance: float = 5.0) -> Lights:
    """Merge the lights of several spheres: the mean half vector of those that accept a frame, by `precision_weights`.

    Where a half vector lies further than `tolerance` degrees from the middle of all, those that most spheres agree on
    count; without a majority the frame is ambiguous. A sphere that is outvoted in most of the frames that it shares
    counts in none. A frame that no sphere accepts keeps the first sphere's reason. The area is that of the largest
    highlight.

    Raises:
        ValueError: no lights, or different numbers of frames.
    """
    if not per_sphere:
        raise ValueError("no lights to merge")
    if len({len(lights.reason) for lights in per_sphere}) != 1:
        raise ValueError(f"numbers of frames differ: {[len(lights.reason) for lights in per_sphere]}")
    if len(per_sphere) == 1:
        return per_sphere[0]
    stack = np.stack([lights.half_vectors for lights in per_sphere]).astype(np.float64)
    accepted = np.stack([lights.accepted for lights in per_sphere])
    accepted = accepted & ~_is_outvoted(stack, accepted, tolerance)[:, None]
    counted, deviation = _majority(stack, accepted, tolerance)
    weights = precision_weights(spheres, np.where(counted, stack[..., 2], 1.0))
    mean = unit((weights[..., None] * np.where(counted[..., None], stack, 0.0)).sum(axis=0))
    several = accepted.sum(axis=0) > 1
    reason = np.where(accepted.any(axis=0), ACCEPTED, per_sphere[0].reason)
    reason[several & ((deviation > tolerance) | (2 * counted.sum(axis=0) <= accepted.sum(axis=0)))] = AMBIGUOUS
    area = np.where(accepted, [lights.area for lights in per_sphere], 0.0).max(axis=0)
    return _lights(mean, reason, area, np.where(several, deviation, np.nan).astype(np.float32))


def _is_outvoted(stack: np.ndarray, accepted: np.ndarray, tolerance: float) -> np.ndarray:
    """Return whether spheres (S,) bool are outvoted in most of their frames; stack (S, T, 3), accepted (S, T) bool."""
    counted, _ = _majority(stack, accepted, tolerance)
    voted = accepted & (2 * counted.sum(axis=0) > accepted.sum(axis=0)) & (accepted.sum(axis=0) > 2)
    return np.asarray(2 * (voted & ~counted).sum(axis=1) > voted.sum(axis=1))


def _majority(stack: np.ndarray, accepted: np.ndarray, tolerance: float) -> tuple[np.ndarray, np.ndarray]:
    """Leave out of each frame the spheres that lie furthest from the middle, until the others agree or are two.

    Returns:
        The spheres that are left, (S, T) bool, and the largest angle in degrees to their middle, (T,).
    """
    counted = accepted.copy()
    frames = np.arange(accepted.shape[1])
    while True:
        middle = unit(np.where(counted[..., None], stack, 0.0).sum(axis=0))
        deviations = np.where(counted, angles(np.where(counted[..., None], stack, middle), middle), 0.0)
        largest = deviations.max(axis=0)
        is_divided = (largest > tolerance) & (counted.sum(axis=0) > 2)
        if not is_divided.any():
            return counted, largest
        counted[deviations.argmax(axis=0)[is_divided], frames[is_divided]] = False


def _lights(
    half: np.ndarray, reason: np.ndarray, area: np.ndarray, inter_sphere_angle: np.ndarray | None = None
) -> Lights:
    """Return lights of half vectors (T, 3), which become NaN where the frame is rejected."""
    half = np.where((reason == ACCEPTED)[:, None], half, np.nan)
    lights = lights_of(half)
    if inter_sphere_angle is None:
        inter_sphere_angle = np.full(len(half), np.nan, np.float32)
    return Lights(
        half.astype(np.float32),
        lights.astype(np.float32),
        reason.astype(np.uint8),
        area.astype(np.float32),
        inter_sphere_angle,
    )
