import numpy as np
from scipy.ndimage import gaussian_filter

from glint.tasks.algorithms.frames.stabilization import (
    TranslationEstimator,
    register,
    shake_amplitude,
    translate,
)


def scene(seed: int = 0) -> np.ndarray:
    """Return a textured image (H, W) float32 in levels."""
    noise = np.random.default_rng(seed).normal(size=(120, 150))
    return (90 + 400 * gaussian_filter(noise, 3)).clip(0, 220).astype(np.float32)


def shaken_frames(shifts: np.ndarray) -> np.ndarray:
    """Return frames (T, H, W) uint8 of the scene under a moving light with a highlight, shifted by (right, down)."""
    generator = np.random.default_rng(1)
    rows, columns = np.mgrid[:120, :150]
    frames = []
    for shift in shifts:
        x, y = generator.uniform(20, 130), generator.uniform(20, 100)
        light = 1 + 0.3 * np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / 60**2)
        image = scene() * light
        image[np.hypot(columns - x, rows - y) < 6] = 255
        image = translate(image.astype(np.float32), shift) + generator.normal(0, 2, image.shape)
        frames.append(image.clip(0, 255).astype(np.uint8))
    return np.array(frames)


def test_a_shift_is_measured_to_a_fraction_of_a_pixel() -> None:
    shifts = np.random.default_rng(3).normal(0, 2, (12, 2))
    estimator = TranslationEstimator(scene())
    found = np.array([estimator.estimate(frame) for frame in shaken_frames(shifts)])
    assert np.abs(found - shifts).max() < 0.2


def test_shaken_frames_are_registered_to_one_another() -> None:
    shifts = np.random.default_rng(4).normal(0, 2, (15, 2))
    reference, found = register(shaken_frames(shifts))
    assert np.abs(found - found[0] - (shifts - shifts[0])).max() < 0.25
    inner = np.s_[10:-10, 10:-10]
    assert np.abs(reference - translate(scene(), shifts[0] - found[0]))[inner].mean() < 12.0


def test_shake_amplitude_separates_a_tripod_from_a_shaken_camera() -> None:
    assert shake_amplitude(register(shaken_frames(np.zeros((15, 2))))[1]) < 0.2
    assert shake_amplitude(register(shaken_frames(np.random.default_rng(4).normal(0, 1, (15, 2))))[1]) > 1.5


def test_an_image_without_structure_is_not_translated() -> None:
    estimator = TranslationEstimator(np.full((50, 60), 40.0, np.float32))
    assert np.allclose(estimator.estimate(np.full((50, 60), 40, np.uint8)), 0.0)
