import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from glint.tasks.algorithms.frames.shake import is_shown_throughout, knocked_places, shake_amplitude
from glint.tasks.algorithms.frames.stabilization import (
    MIN_REGISTERED,
    TranslationEstimator,
    downsample,
    register,
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


@pytest.mark.parametrize("is_scattered", [False, True])
def test_strong_structure_in_a_part_of_a_plain_image_is_enough(is_scattered: bool) -> None:
    """Neither one patch nor many small ones beside a plain table are clipped to what is usual in the whole image."""
    generator = np.random.default_rng(14)
    rows, columns = np.indices((240, 320)) // 32
    has_pattern = generator.random((8, 10))[rows, columns] < 0.25 if is_scattered else (columns < 3)
    table = (90.0 + 300.0 * has_pattern * gaussian_filter(generator.normal(size=(240, 320)), 1)).astype(np.float32)
    shifts = generator.normal(0.0, 2.0, (16, 2))
    moved = np.stack([translate(table, shift) for shift in shifts])
    frames = (moved + generator.normal(0.0, 1.0, moved.shape)).clip(0.0, 255.0).round().astype(np.uint8)
    _, found = register(frames)
    assert np.abs(found - found[0] - (shifts - shifts[0])).max() < 0.15


def test_nothing_is_known_of_an_image_without_structure() -> None:
    estimator = TranslationEstimator(np.full((50, 60), 40.0, np.float32))
    assert estimator.estimate(np.full((50, 60), 40, np.uint8)) is None


def shadowed_frames(shifts: np.ndarray, texture: float = 1.0) -> np.ndarray:
    """Return frames (T, 240, 320) uint8 of a cloth over which the sharp shadows of two spheres and a caustic drift.

    The shadows cover a sixth of the image and move by a pixel or two in a frame; texture: contrast of the cloth.
    """
    generator = np.random.default_rng(5)
    rows, columns = np.mgrid[:240, :320]
    cloth = 70 + texture * 130 * gaussian_filter(generator.normal(size=(240, 320)), 2)
    caustic = 50 * (gaussian_filter(generator.normal(size=(90, 90)), 1.5) * 5).clip(0, 2)
    frames = []
    for number, shift in enumerate(shifts):
        image = cloth * (0.7 + 0.3 * np.sin(number / 5))
        for x, y, radius in ((90 + 1.7 * number, 90, 38), (210 + 1.7 * number, 150, 34)):
            image = np.where(np.hypot(columns - x, rows - y) < radius, 0.35 * image, image)
        left = int(20 + 1.5 * number)
        image[140:230, left : left + 90] += caustic[:, : 320 - left]
        image = translate(image.astype(np.float32), shift) + generator.normal(0, 1.5, image.shape)
        frames.append(image.clip(0, 255).astype(np.uint8))
    return np.array(frames)


@pytest.mark.parametrize("texture", [1.0, 0.25, 0.0])
def test_shadows_and_caustics_are_no_shake(texture: float) -> None:
    """Nor are they on a cloth of weak structure, nor on a black one, where what moves is all that there is."""
    _, found = register(shadowed_frames(np.zeros((24, 2)), texture))
    known = np.isfinite(found[:, 0])
    assert not is_shown_throughout(known) or np.abs(found[known]).max() < 0.2


@pytest.mark.parametrize(
    ("pattern", "expected"), [("x..x..x", True), ("..xxxx.", False), ("x......", False), (".......", False)]
)
def test_a_place_is_shown_throughout_or_in_a_part_of_the_frames(pattern: str, expected: bool) -> None:
    assert is_shown_throughout(np.array([letter == "x" for letter in pattern])) is expected


def test_a_shake_is_measured_under_moving_shadows() -> None:
    shifts = np.random.default_rng(6).normal(0, 1.5, (24, 2))
    _, found = register(shadowed_frames(shifts))
    assert np.abs(found - found[0] - (shifts - shifts[0])).max() < 0.3


def test_frames_that_agree_with_no_single_one_are_registered_by_the_median_of_those_that_do() -> None:
    shifts = np.cumsum(np.random.default_rng(9).normal(0, 0.8, (25, 2)), axis=0)
    noise = np.random.default_rng(10).normal(0, 4, (25, 240, 320))
    frames = (shadowed_frames(shifts, 0.5) + noise).clip(0, 255).astype(np.uint8)
    for reference in (np.median(frames, axis=0).astype(np.float32), frames[12].astype(np.float32)):
        estimator = TranslationEstimator(reference)
        assert np.mean([estimator.estimate(frame) is not None for frame in frames]) < MIN_REGISTERED
    _, found = register(frames)
    assert np.abs(found - found[0] - (shifts - shifts[0])).max() < 0.2


def test_the_background_decides_where_it_has_structure() -> None:
    """Shading that moves over the object alone is no shake."""
    frames = shadowed_frames(np.zeros((9, 2)))
    relief = 200 * gaussian_filter(np.random.default_rng(7).normal(size=(240, 160)), 2)
    for number, frame in enumerate(frames):
        frame[:, 80:240] = (90 + translate(relief.astype(np.float32), np.array([0.5 * number, 0.0]))).clip(0, 255)
    excluded = np.zeros((240, 320), bool)
    excluded[:, 80:240] = True
    assert TranslationEstimator(frames[0], excluded).on_background
    assert np.abs(register(frames, excluded)[1]).max() < 0.2


@pytest.mark.parametrize("change", [2, 12, 21])
def test_a_knock_is_a_step_between_two_places(change: int) -> None:
    shifts = np.zeros((24, 2))
    shifts[change:] = 2.4, -1.3
    places = knocked_places(register(shadowed_frames(shifts))[1])
    assert places is not None
    assert np.allclose(places[1] - places[0], (2.4, -1.3), atol=0.15)


def test_a_hand_held_camera_stands_nowhere() -> None:
    walk = np.cumsum(np.random.default_rng(8).normal(0, 0.7, (24, 2)), axis=0)
    assert knocked_places(walk) is None


def test_deep_frames_are_registered_by_the_structure_of_shallow_ones() -> None:
    """In levels of 16 bits the noise of a plain table would be structure, on which no two frames agree."""
    generator = np.random.default_rng(12)
    pattern = 200.0 * gaussian_filter(generator.normal(size=(240, 320)), 2)
    is_plain = (np.indices((240, 320)) // 64 % 2).any(axis=0)
    table = np.where(is_plain, 90.0, 90.0 + pattern).astype(np.float32)
    shifts = generator.normal(0.0, 1.0, (16, 2))
    moved = np.stack([translate(table, shift) for shift in shifts])
    levels = (moved + generator.normal(0.0, 1.0, moved.shape)).clip(0.0, 255.0)
    shallow, deep = levels.round().astype(np.uint8), (257.0 * levels).round().astype(np.uint16)
    for frames in (shallow, deep):
        _, found = register(np.stack([downsample(frame, 1) for frame in frames]))
        assert np.abs(found - found[0] - (shifts - shifts[0])).max() < 0.05
    assert np.abs(downsample(deep[0], 2) - downsample(shallow[0], 2)).max() < 1.0
