import numpy as np
from scipy.ndimage import gaussian_filter

from glint.tasks.algorithms.frames.stabilization import Steadier, aligned, moved, wander


def scene(seed: int = 0) -> np.ndarray:
    """A textured picture (H, W) float32 in levels."""
    noise = np.random.default_rng(seed).normal(size=(120, 150))
    return (90 + 400 * gaussian_filter(noise, 3)).clip(0, 220).astype(np.float32)


def film(shifts: np.ndarray) -> np.ndarray:
    """Frames (T, H, W) uint8 of the scene under a lamp that wanders and glints, shifted by (right, down) pixels."""
    generator = np.random.default_rng(1)
    rows, columns = np.mgrid[:120, :150]
    frames = []
    for shift in shifts:
        x, y = generator.uniform(20, 130), generator.uniform(20, 100)
        lamp = 1 + 0.3 * np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / 60**2)
        picture = scene() * lamp
        picture[np.hypot(columns - x, rows - y) < 6] = 255
        picture = moved(picture.astype(np.float32), shift) + generator.normal(0, 2, picture.shape)
        frames.append(picture.clip(0, 255).astype(np.uint8))
    return np.array(frames)


def test_a_shift_is_measured_to_a_fraction_of_a_pixel() -> None:
    shifts = np.random.default_rng(3).normal(0, 2, (12, 2))
    steadier = Steadier(scene())
    found = np.array([steadier.shift(frame) for frame in film(shifts)])
    assert np.abs(found - shifts).max() < 0.2


def test_shaken_frames_are_aligned_to_each_other() -> None:
    shifts = np.random.default_rng(4).normal(0, 2, (15, 2))
    reference, found = aligned(film(shifts))
    assert np.abs(found - found[0] - (shifts - shifts[0])).max() < 0.25
    inner = np.s_[10:-10, 10:-10]
    assert np.abs(reference - moved(scene(), shifts[0] - found[0]))[inner].mean() < 12.0


def test_wander_tells_a_steady_camera_from_a_shaken_one() -> None:
    assert wander(aligned(film(np.zeros((15, 2))))[1]) < 0.2
    assert wander(aligned(film(np.random.default_rng(4).normal(0, 1, (15, 2))))[1]) > 1.5


def test_a_picture_without_structure_is_not_moved() -> None:
    steadier = Steadier(np.full((50, 60), 40.0, np.float32))
    assert np.allclose(steadier.shift(np.full((50, 60), 40, np.uint8)), 0.0)
