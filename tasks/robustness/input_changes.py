"""Spheres, masks and known lights of a capture made wrong by a known amount: pure functions of its inputs."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy import ndimage

from glint.storage.catalogue.loading import Sphere
from glint.tasks.robustness.perturbation import CaptureInputs

Change = Callable[[CaptureInputs], CaptureInputs | None]
LightsChange = Callable[[np.ndarray, np.random.Generator], np.ndarray]

CENTRE_OFFSET_DIRECTION = (0.8, 0.6)
"""Unit vector, x and y down, along which the centres of spheres are displaced: no axis of the image."""
LEAK_SHARE = 0.5
"""Length of a mask's leak relative to the mask's longer side."""
SEED = 11
"""Seed of what is drawn at random, so that a perturbation is the same in every run."""


def sphere_radius(factor: float) -> Change:
    """Return the change that multiplies the radii of all given spheres."""
    return lambda inputs: _with_spheres(inputs, lambda sphere: {"radius": sphere.radius * factor})


def sphere_centre(share: float) -> Change:
    """Return the change that displaces the centres of all given spheres by a share of their radius."""
    x, y = CENTRE_OFFSET_DIRECTION
    return lambda inputs: _with_spheres(
        inputs,
        lambda sphere: {"x": sphere.x + share * sphere.radius * x, "y": sphere.y + share * sphere.radius * y},
    )


def without_spheres(inputs: CaptureInputs) -> CaptureInputs | None:
    """Leave out the given spheres, so that they are to be found."""
    return replace(inputs, entry=inputs.entry.model_copy(update={"spheres": ()})) if inputs.entry.spheres else None


def without_mask(inputs: CaptureInputs) -> CaptureInputs | None:
    """Leave out the given mask, so that it is estimated within the region."""
    entry = inputs.entry.model_copy(update={"mask": None})
    return None if inputs.mask is None else replace(inputs, entry=entry, mask=None)


def without_camera(inputs: CaptureInputs) -> CaptureInputs | None:
    """Leave out the matrix of a near camera."""
    entry = inputs.entry.model_copy(update={"camera": None})
    return None if inputs.entry.camera is None else replace(inputs, entry=entry)


def mask_grown(pixels: int) -> Change:
    """Return the change that dilates a given mask by so many pixels, or erodes it (negative)."""

    def grown(mask: np.ndarray) -> np.ndarray:
        if pixels > 0:
            return np.asarray(ndimage.binary_dilation(mask, iterations=pixels))
        return np.asarray(ndimage.binary_erosion(mask, iterations=-pixels))

    return lambda inputs: _with_mask(inputs, grown)


def mask_shifted(pixels: int) -> Change:
    """Return the change that displaces a given mask by so many pixels, to the right and up."""

    def shifted(mask: np.ndarray) -> np.ndarray:
        return np.asarray(ndimage.shift(mask.astype(np.uint8), (-0.6 * pixels, 0.8 * pixels), order=0) > 0)

    return lambda inputs: _with_mask(inputs, shifted)


def mask_leaking(inputs: CaptureInputs) -> CaptureInputs | None:
    """Add a tongue of background to a given mask, as by a shadow: along its diagonal, a fifth of its length wide."""

    def leaking(mask: np.ndarray) -> np.ndarray:
        rows, columns = np.nonzero(mask)
        side = max(np.ptp(rows), np.ptp(columns))
        centre = np.array([np.mean(rows), np.mean(columns)])
        # The tongue starts inside, and leaves the mask towards the lower right.
        start = centre + 0.3 * np.array([np.ptp(rows), np.ptp(columns)])
        along = np.array([0.6, 0.8])
        offset = np.moveaxis(np.indices(mask.shape), 0, -1) - start
        distance = offset @ along
        across = np.abs(offset @ np.array([-along[1], along[0]]))
        tongue = (distance > 0) & (distance < LEAK_SHARE * side) & (across < 0.1 * side)
        return np.asarray(mask | tongue)

    return _with_mask(inputs, leaking)


def known_lights(change: LightsChange) -> Change:
    """Return the change that gives the true lights (T, 3), themselves changed, in place of the spheres.

    Where the light is off it is given as behind the object, since an `.lp` file holds directions alone.
    """

    def changed(inputs: CaptureInputs) -> CaptureInputs | None:
        if inputs.lights is None:
            return None
        lights = np.where(np.isfinite(inputs.lights), inputs.lights, np.array([0.0, 0.0, -1.0], np.float32))
        entry = inputs.entry.model_copy(update={"spheres": ()})
        return replace(inputs, entry=entry, lights=change(lights, np.random.default_rng(SEED)))

    return changed


def unchanged(lights: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Return the lights (T, 3) as they are."""
    return lights


def shifted_rows(rows: int, start: float = 0.0) -> LightsChange:
    """Return the change of lights (T, 3) whose rows come early from a share of the video on; the last is repeated."""

    def shifted(lights: np.ndarray, generator: np.random.Generator) -> np.ndarray:
        numbers = np.arange(len(lights))
        numbers[int(start * len(lights)) :] += rows
        return lights[np.minimum(numbers, len(lights) - 1)]

    return shifted


def mirrored(*factors: float) -> LightsChange:
    """Return the change of lights (T, 3) that multiplies x, y and z by these factors."""
    return lambda lights, generator: lights * np.array(factors, np.float32)


def rotated_in_image(degrees: float) -> LightsChange:
    """Return the change of lights (T, 3) that turns them about the camera axis."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    matrix = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]], np.float32)
    return lambda lights, generator: lights @ matrix.T


def exchanged(share: float) -> LightsChange:
    """Return the change of lights (T, 3) that exchanges a share of the rows among themselves."""

    def swapped(lights: np.ndarray, generator: np.random.Generator) -> np.ndarray:
        return lights[exchanged_order(share)(len(lights), generator)]

    return swapped


def exchanged_order(share: float) -> Callable[[int, np.random.Generator], np.ndarray]:
    """Return the order (T,) of frames in which a share of them is exchanged among themselves."""

    def order(count: int, generator: np.random.Generator) -> np.ndarray:
        numbers = np.arange(count)
        chosen = np.sort(generator.choice(count, round(share * count), replace=False))
        numbers[chosen] = generator.permutation(chosen)
        return numbers

    return order


def _with_spheres(inputs: CaptureInputs, update: Callable[[Sphere], dict[str, float]]) -> CaptureInputs | None:
    if not inputs.entry.spheres:
        return None
    spheres = tuple(sphere.model_copy(update=update(sphere)) for sphere in inputs.entry.spheres)
    return replace(inputs, entry=inputs.entry.model_copy(update={"spheres": spheres}))


def _with_mask(inputs: CaptureInputs, change: Callable[[np.ndarray], np.ndarray]) -> CaptureInputs | None:
    return None if inputs.mask is None else replace(inputs, mask=change(inputs.mask))
