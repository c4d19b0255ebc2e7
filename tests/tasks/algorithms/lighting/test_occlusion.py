import numpy as np
import pytest

from glint.tasks.algorithms.lighting.lights import (
    ACCEPTED,
    COVERED,
    NO_LIGHT,
    find_lights,
    without_frames,
)
from glint.tasks.algorithms.lighting.occlusion import (
    clipped_pixels,
    is_light_before_object,
    is_sphere_covered,
    may_show_light,
)
from glint.tasks.algorithms.lighting.spheres import Sphere
from tests.tasks.algorithms.lighting.chrome_sphere import light_direction, sphere_frame

SPHERE, SHAPE = Sphere(40.0, 40.0, 30.0), (80, 80)


def sphere_frames(window: bool = True) -> np.ndarray:
    """Return 12 frames (12, 80, 80) of a sphere; in the frames 3 and 4 an arm lies over its left half."""
    frames = np.stack(
        [sphere_frame(SPHERE, [light_direction(30.0 * k, 20.0)], SHAPE, window=window, seed=k) for k in range(12)]
    )
    frames[3:5, :, :34] = 12
    return frames


def covered(frames: np.ndarray) -> list[int]:
    background = np.median(frames, axis=0)
    return np.flatnonzero(is_sphere_covered(frames, background, 255.0, SPHERE)).tolist()


def test_an_arm_over_the_window_covers_the_sphere() -> None:
    assert covered(sphere_frames()) == [3, 4]


def test_an_exposure_that_drifts_covers_nothing() -> None:
    frames = sphere_frames()[[0, 1, 2, 5, 6, 7]]
    drifting = (frames * np.linspace(0.75, 1.0, 6)[:, None, None]).astype(np.uint8)
    assert covered(drifting) == []


def test_a_sphere_without_static_reflections_shows_no_arm() -> None:
    assert covered(sphere_frames(window=False)) == []


@pytest.mark.parametrize(
    ("sphere_level", "level", "pixels", "dimmed", "hidden", "expected"),
    [
        (50, 105, 8, 0.5, 8, True),
        (50, 95, 8, 0.5, 8, False),  # Not twice as bright as the sphere.
        (10, 42, 8, 0.5, 8, True),
        (10, 36, 8, 0.5, 8, False),  # Less than 15% of saturation: its absence is noise.
        (50, 200, 7, 0.5, 7, False),
        (50, 200, 8, 0.62, 8, False),  # The exposure drifts.
        (50, 200, 8, 0.58, 8, True),
        (50, 200, 8, 0.5, 4, False),
        (50, 200, 8, 0.5, 5, True),
    ],
)
def test_a_reflection_covers_the_sphere_where_most_of_it_is_gone(
    sphere_level: int, level: int, pixels: int, dimmed: float, hidden: int, expected: bool
) -> None:
    background = np.full(SHAPE, sphere_level, np.float32)
    background[40, 30 : 30 + pixels] = level
    frame = background.copy()
    frame[40, 30 : 30 + hidden] *= dimmed
    assert is_sphere_covered(frame[None], background, 255.0, SPHERE).tolist() == [expected]


def test_only_accepted_frames_get_another_reason() -> None:
    lights = find_lights(sphere_frames(), SPHERE)
    lights.reason[3] = NO_LIGHT
    rejected = np.isin(np.arange(12), (3, 4))
    result = without_frames(lights, rejected, COVERED)
    assert result.reason[3:5].tolist() == [NO_LIGHT, COVERED]
    assert np.isnan(result.half_vectors[4]).all() and np.isnan(result.lights[4]).all()
    assert (result.reason[:3] == ACCEPTED).all()


def object_frames() -> np.ndarray:
    """Return 20 frames (20, 60, 80) of a dark region with highlights; in the frames 7 and 8 a lamp reaches into it."""
    generator = np.random.default_rng(0)
    frames = generator.integers(20, 40, (20, 60, 80)).astype(np.uint8)
    rows, columns = np.mgrid[:60, :80]
    for number, frame in enumerate(frames):
        frame[np.hypot(columns - 25 - number, rows - 30) < 4] = 255
        if number in (7, 8):
            frame[np.hypot(columns - 60 - number, rows - 5) < 18] = 255
    return frames


def test_a_light_before_the_object_reaches_beyond_it() -> None:
    frames = object_frames()
    assert np.flatnonzero(is_light_before_object(frames, np.median(frames, axis=0))).tolist() == [7, 8]


@pytest.mark.parametrize(
    ("row", "pixels", "level", "background_level", "expected"),
    [
        (2, 41, 230, 127, True),
        (2, 40, 230, 127, False),  # 5% of the border's 804 pixels.
        (3, 41, 230, 127, False),  # Beside the border.
        (2, 41, 229, 127, False),
        (2, 41, 230, 128, False),  # As bright as a window.
    ],
)
def test_a_light_shows_on_a_twentieth_of_the_border(
    row: int, pixels: int, level: int, background_level: int, expected: bool
) -> None:
    background = np.full((60, 80), 30, np.uint8)
    background[row] = background_level
    frame = background.copy()
    frame[row, 20 : 20 + pixels] = level
    assert is_light_before_object(frame[None], background).tolist() == [expected]
    # The row of a window is no border that could show a light.
    window = 80 if background_level > 127 else 0
    counts = np.array([clipped_pixels(frame)])
    assert may_show_light(counts, background).tolist() == [counts[0, 1] > 0.05 * (804 - window)]


def test_a_window_at_the_border_is_no_light() -> None:
    frames = object_frames()[:6]
    frames[:, :20, :30] = 255
    assert not is_light_before_object(frames, np.median(frames, axis=0)).any()


def test_the_disc_of_a_light_inside_the_region_is_noticed_and_flashes_are_not() -> None:
    frames = np.random.default_rng(0).integers(20, 40, (20, 120, 160)).astype(np.uint8)
    rows, columns = np.mgrid[:120, :160]
    for number in (3, 4, 5):
        frames[number, np.hypot(columns - 60 - number, rows - 50) < 14] = 255
    # A round highlight of a dome, and a wall that flashes from top to bottom.
    frames[9, np.hypot(columns - 80, rows - 60) < 8] = 255
    frames[12, 20:100, 70:90] = 255
    assert np.flatnonzero(is_light_before_object(frames, np.median(frames, axis=0))).tolist() == [3, 4, 5]


def test_counts_of_clipped_pixels_leave_few_frames_to_be_looked_at() -> None:
    frames = object_frames()
    background = np.median(frames, axis=0).astype(np.uint8)
    counts = np.array([clipped_pixels(frame) for frame in frames])
    assert counts[0].tolist() == [45, 0], "a highlight inside the region"
    assert np.flatnonzero(may_show_light(counts, background)).tolist() == [7, 8]


def test_no_frame_in_which_a_light_shows_is_left_out_by_its_counts() -> None:
    generator = np.random.default_rng(1)
    rows, columns = np.mgrid[:60, :80]
    frames = np.full((200, 60, 80), 30, np.uint16)
    for frame in frames:
        x, y, radius = generator.uniform((-10, -10, 2), (90, 70, 20))
        frame[np.hypot(columns - x, rows - y) < radius] = 65535
    frames[:, :10, :3] = 65535
    background = np.median(frames, axis=0).astype(np.uint16)
    shows = is_light_before_object(frames, background)
    may = may_show_light(np.array([clipped_pixels(frame) for frame in frames]), background)
    assert 10 < shows.sum() <= may.sum() < 190 and not (shows & ~may).any()
