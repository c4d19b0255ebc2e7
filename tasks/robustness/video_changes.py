"""Videos made worse by a known amount: order of the frames, exposure, gamma, blur, shake, bit rate."""

from collections.abc import Callable, Iterator, Sequence

import cv2
import numpy as np

from glint.storage.catalogue.loading import Sphere
from glint.tasks.robustness.perturbation import VideoChange

SHUFFLED_FRAMES = 8
"""Consecutive frames that are put out of order among themselves, as by a network that delivers them."""
DRIFT_PERIODS = 1.4
"""Periods of a drifting exposure over the video."""
SHAKE_PERIODS = (5.0, 7.0)
"""Periods of the camera's shake over the video, along x and y."""


def dropped(share: float) -> Callable[[int, np.random.Generator], np.ndarray]:
    """Return the order (T,) of the frames that are left when a share of them is lost at random."""
    return lambda count, generator: np.sort(generator.choice(count, round((1.0 - share) * count), replace=False))


def doubled(share: float) -> Callable[[int, np.random.Generator], np.ndarray]:
    """Return the order (T,) in which a share of the frames comes twice."""
    return lambda count, generator: np.sort(
        np.concatenate([np.arange(count), generator.choice(count, round(share * count), replace=False)])
    )


def out_of_order(count: int, generator: np.random.Generator) -> np.ndarray:
    """Return the order (T,) in which each SHUFFLED_FRAMES consecutive frames are shuffled."""
    blocks = [np.arange(start, min(start + SHUFFLED_FRAMES, count)) for start in range(0, count, SHUFFLED_FRAMES)]
    return np.concatenate([generator.permutation(block) for block in blocks])


def gain(factor: float, drift: float = 0.0) -> VideoChange:
    """Return the change that multiplies luma by a factor, which drifts by so much of itself to both sides."""

    def brightened(frame: np.ndarray, share: float, generator: np.random.Generator) -> np.ndarray:
        level = factor * (1.0 + drift * np.sin(2.0 * np.pi * DRIFT_PERIODS * share))
        return np.clip(frame * level + 0.5, 0, 255).astype(np.uint8)

    return VideoChange(pixels=brightened)


def gamma(exponent: float) -> VideoChange:
    """Return the change that raises luma, 0 to 1, to a power."""
    curve = np.rint(255.0 * (np.arange(256) / 255.0) ** exponent).astype(np.uint8)
    return VideoChange(pixels=lambda frame, share, generator: cv2.LUT(frame, curve))


def blur(sigma: float) -> VideoChange:
    """Return the change that blurs frames by a Gaussian of this standard deviation in pixels."""
    return VideoChange(pixels=lambda frame, share, generator: cv2.GaussianBlur(frame, (0, 0), sigma))


def shake(pixels: float) -> VideoChange:
    """Return the change that moves frames to and fro by so many pixels, along x and y."""

    def moved(frame: np.ndarray, share: float, generator: np.random.Generator) -> np.ndarray:
        x, y = (pixels * float(np.sin(2.0 * np.pi * periods * share)) for periods in SHAKE_PERIODS)
        return shifted(frame, x, y)

    return VideoChange(pixels=moved)


def knock(pixels: float, start: float = 0.5) -> VideoChange:
    """Return the change that displaces the camera by so many pixels from a share of the video on."""
    x, y = 0.8 * pixels, 0.6 * pixels
    return VideoChange(pixels=lambda frame, share, generator: shifted(frame, x, y) if share >= start else frame)


def shifted(frame: np.ndarray, x: float, y: float) -> np.ndarray:
    """Return a frame (H, W) moved by x pixels to the right and y down."""
    matrix = np.array([[1.0, 0.0, x], [0.0, 1.0, y]])
    return np.asarray(cv2.warpAffine(frame, matrix, frame.shape[::-1], borderMode=cv2.BORDER_REPLICATE))


def changed_frames(
    frames: Sequence[np.ndarray], change: VideoChange, spheres: Sequence[Sphere], generator: np.random.Generator
) -> Iterator[np.ndarray]:
    """Yield the luma (H, W) uint8 of the frames of a changed video; spheres: in pixels of the full frame."""
    order = np.arange(len(frames)) if change.order is None else change.order(len(frames), generator)
    sources = order if change.sphere_order is None else change.sphere_order(len(frames), generator)
    for number, source in zip(order, sources, strict=True):
        frame = frames[number]
        if source != number:
            frame = frame.copy()
            for rows, columns in map(_sphere_box, spheres):
                frame[rows, columns] = frames[source][rows, columns]
        yield frame if change.pixels is None else change.pixels(frame, number / len(frames), generator)


def _sphere_box(sphere: Sphere) -> tuple[slice, slice]:
    """Return the rows and columns of a sphere's bounding box."""
    reach = sphere.radius + 2.0
    return tuple(slice(max(int(centre - reach), 0), int(centre + reach) + 1) for centre in (sphere.y, sphere.x))  # type: ignore[return-value]
