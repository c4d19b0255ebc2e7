"""What tells glass from chrome: a chrome sphere's highlight has one size wherever the light is."""

from itertools import cycle

import numpy as np

from glint.tasks.algorithms.lighting.sphere_tests import reason_against_chrome
from glint.tasks.algorithms.lighting.spheres import Sphere
from tests.tasks.algorithms.lighting.chrome_sphere import light_direction, sphere_frame

SPHERE, SHAPE, COUNT = Sphere(50.3, 48.7, 40.0), (100, 104), 32


def swept(*, radii_deg: tuple[float, ...], window: bool = False) -> np.ndarray:
    """Draw frames (T, H, W) of a sphere whose light moves over the hemisphere and has these sizes in turn."""
    return np.stack(
        [
            sphere_frame(
                SPHERE,
                [light_direction(137.5 * number, 75.0 * np.sqrt((number + 0.5) / COUNT))],
                SHAPE,
                window=window,
                light_radius_deg=radii_deg[number % len(radii_deg)],
                seed=number,
            )
            for number in range(COUNT)
        ]
    )


def test_a_highlight_of_one_size_is_that_of_a_chrome_sphere() -> None:
    assert reason_against_chrome(swept(radii_deg=(6.0,)), SPHERE) is None


def test_a_highlight_that_a_window_hides_in_part_is_no_other_size() -> None:
    assert reason_against_chrome(swept(radii_deg=(6.0,), window=True), SPHERE) is None


def test_a_highlight_that_grows_is_that_of_glass() -> None:
    reason = reason_against_chrome(swept(radii_deg=(6.0, 6.0, 6.0, 12.0)), SPHERE)
    assert reason == "its highlight has another size in 8 of 32 frames, as that of glass has"


def with_glints(frames: np.ndarray, *, azimuths: tuple[float, ...], interval: int = 6) -> np.ndarray:
    """Return frames of which one in `interval` has the light behind the sphere, which mirrors one small highlight.

    azimuths: degrees, in turn, of the direction in which the sphere mirrors it, level with its centre.
    """
    for number, azimuth in zip(range(0, COUNT, interval), cycle(azimuths), strict=False):
        glint = light_direction(azimuth, 80.0)
        frames[number] = sphere_frame(SPHERE, [glint], SHAPE, light_radius_deg=2.0, seed=number)
    return frames


def test_small_highlights_mirrored_from_the_object_beside_are_no_other_size() -> None:
    assert reason_against_chrome(with_glints(swept(radii_deg=(6.0,)), azimuths=(150.0, 180.0, 200.0)), SPHERE) is None


def test_small_highlights_on_all_sides_are_those_of_glass() -> None:
    reason = reason_against_chrome(with_glints(swept(radii_deg=(6.0,)), azimuths=(0.0, 90.0, 180.0, 270.0)), SPHERE)
    assert reason == "its highlight has another size in 6 of 32 frames, as that of glass has"


def test_small_highlights_in_many_frames_are_those_of_glass() -> None:
    reason = reason_against_chrome(
        with_glints(swept(radii_deg=(6.0,)), azimuths=(150.0, 180.0, 200.0), interval=4), SPHERE
    )
    assert reason == "its highlight has another size in 8 of 32 frames, as that of glass has"


def with_second_highlights(frames: np.ndarray, *, azimuths: tuple[float, ...]) -> np.ndarray:
    """Return frames of which every sixth shows a second highlight, a little smaller; azimuths: see `with_glints`."""
    for number, azimuth in zip(range(0, COUNT, 6), cycle(azimuths), strict=False):
        second = sphere_frame(SPHERE, [light_direction(azimuth, 80.0)], SHAPE, light_radius_deg=5.0, seed=number)
        frames[number] = np.maximum(frames[number], second)
    return frames


def test_second_highlights_mirrored_from_the_object_beside_are_no_lights() -> None:
    frames = with_second_highlights(swept(radii_deg=(6.0,)), azimuths=(150.0, 180.0, 200.0))
    assert reason_against_chrome(frames, SPHERE) is None


def test_second_highlights_on_all_sides_are_those_of_glass() -> None:
    frames = with_second_highlights(swept(radii_deg=(6.0,)), azimuths=(0.0, 90.0, 180.0, 270.0))
    reason = reason_against_chrome(frames, SPHERE)
    assert reason is not None and reason.endswith("of 32 frames show two lights on it, as glass does")


def test_one_frame_of_another_size_proves_nothing() -> None:
    frames = swept(radii_deg=(6.0,))
    frames[:1] = swept(radii_deg=(12.0,))[:1]
    assert reason_against_chrome(frames, SPHERE) is None
