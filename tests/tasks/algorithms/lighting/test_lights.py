from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.geometry.vectors import angles, half_vectors_of
from glint.tasks.algorithms.lighting.highlights import measure_highlights, static_background, without_blur
from glint.tasks.algorithms.lighting.lights import (
    ACCEPTED,
    AMBIGUOUS,
    BEHIND,
    NO_LIGHT,
    OUTSIDE_SPHERE,
    REASONS,
    TWO_LIGHTS,
    classify_frames,
    find_lights,
    inter_sphere_angles,
    light_size,
    merge_spheres,
)
from glint.tasks.algorithms.lighting.spheres import Sphere
from tests.tasks.algorithms.lighting.chrome_sphere import (
    light_direction,
    pooled,
    reflected_directions,
    sphere_frame,
)

SPHERE = Sphere(43.3, 41.8, 36.0)
SHAPE = (86, 88)
LIGHTS = [light_direction(37.0 * k, 8.0 + 3.2 * k) for k in range(24)]
BLURRED_LIGHTS = [light_direction(37.0 * k, 40.0 + 1.8 * k) for k in range(24)]


def sphere_frames(lights: list[np.ndarray], *, window: bool = False) -> np.ndarray:
    return np.stack([sphere_frame(SPHERE, [light], SHAPE, window=window, seed=k) for k, light in enumerate(lights)])


@pytest.mark.parametrize("window", [False, True])
def test_half_vectors_are_found_to_a_fraction_of_a_degree(window: bool) -> None:
    lights = find_lights(sphere_frames(LIGHTS, window=window), SPHERE)
    errors = angles(lights.half_vectors, half_vectors_of(np.array(LIGHTS)))
    assert lights.accepted.sum() >= len(LIGHTS) - 1
    assert np.nanmedian(errors) < 0.1
    assert np.nanmax(errors) < 0.6
    assert lights.half_vectors.dtype == np.float32 and lights.reason.dtype == np.uint8


def test_blocks_give_the_same_lights_as_the_whole() -> None:
    frames = sphere_frames(LIGHTS)
    static = static_background(frames, SPHERE)
    blocks = [measure_highlights(frames[start : start + 7], SPHERE, static) for start in range(0, len(frames), 7)]
    in_blocks = classify_frames(blocks, static, SPHERE)
    np.testing.assert_array_equal(in_blocks.half_vectors, find_lights(frames, SPHERE).half_vectors)


@pytest.mark.long
def test_sixteen_bits_give_the_same_lights() -> None:
    frames = sphere_frames(LIGHTS)
    wide = find_lights(frames.astype(np.uint16) * 257, SPHERE)
    assert np.nanmax(angles(wide.half_vectors, find_lights(frames, SPHERE).half_vectors)) < 0.01


@pytest.mark.parametrize("frames", [3, 5])
def test_noise_of_a_dark_sphere_in_sixteen_bits_is_no_light(frames: int) -> None:
    noise = np.random.default_rng(0).normal(400.0, 60.0, (frames, *SHAPE)).astype(np.uint16)
    with pytest.raises(UnusableCapture, match=r"the brightest spot is [01] levels of 255 above"):
        find_lights(noise, SPHERE)


def test_every_rejected_frame_has_its_reason() -> None:
    frames = [sphere_frame(SPHERE, [light], SHAPE, seed=k) for k, light in enumerate(LIGHTS)]
    frames[3] = sphere_frame(SPHERE, [], SHAPE, seed=3)
    frames[5] = sphere_frame(SPHERE, [light_direction(200.0, 115.0)], SHAPE, seed=5)
    frames[7] = sphere_frame(SPHERE, [light_direction(20.0, 40.0), light_direction(190.0, 50.0)], SHAPE, seed=7)
    frames[9] = np.full(SHAPE, 255, np.uint8)
    frames[11] = np.zeros(SHAPE, np.uint8)
    lights = find_lights(np.stack(frames), SPHERE)
    assert lights.reason[[3, 5, 7, 9, 11]].tolist() == [NO_LIGHT, BEHIND, TWO_LIGHTS, AMBIGUOUS, NO_LIGHT]
    assert np.isnan(lights.half_vectors[[3, 5, 7, 9, 11]]).all()
    assert (np.delete(lights.reason, [3, 5, 7, 9, 11]) == ACCEPTED).all()
    assert len(REASONS) == 8 and REASONS[ACCEPTED] == "accepted"


@pytest.mark.parametrize(("polar", "reason"), [(86.0, ACCEPTED), (94.0, BEHIND)])
def test_a_light_is_before_the_object_up_to_a_right_angle(polar: float, reason: int) -> None:
    frames = sphere_frames([*LIGHTS, light_direction(200.0, polar)])
    assert find_lights(frames, SPHERE).reason[-1] == reason


@pytest.mark.parametrize(
    ("radius_deg", "reason"), [(4.0, AMBIGUOUS), (5.5, ACCEPTED), (12.0, ACCEPTED), (15.5, AMBIGUOUS)]
)
def test_a_highlight_has_a_third_to_three_times_the_usual_area(radius_deg: float, reason: int) -> None:
    unusual = sphere_frame(SPHERE, [light_direction(200.0, 30.0)], SHAPE, light_radius_deg=radius_deg)
    assert find_lights(np.stack([*sphere_frames(LIGHTS), unusual]), SPHERE).reason[-1] == reason


@pytest.mark.parametrize(("window_x", "reason"), [(35, AMBIGUOUS), (47, ACCEPTED)])
def test_a_highlight_half_of_which_a_window_hides_is_ambiguous(window_x: int, reason: int) -> None:
    frames = sphere_frames([*LIGHTS, light_direction(200.0, 40.0)])
    for frame in frames:
        cv2.circle(frame, (window_x, 46), 4, 250, -1)
    lights = find_lights(frames, SPHERE)
    assert lights.reason[-1] == reason
    assert 1.0 / 3.0 < lights.area[-1] / np.median(lights.area) < 3.0


@pytest.mark.parametrize(("radius_deg", "reason"), [(30.0, ACCEPTED), (48.0, AMBIGUOUS)])
def test_what_fills_a_quarter_of_the_disc_of_lights_is_no_highlight(radius_deg: float, reason: int) -> None:
    frames = [
        sphere_frame(SPHERE, [light_direction(120.0 * k, 70.0)], SHAPE, light_radius_deg=radius_deg) for k in range(3)
    ]
    assert (find_lights(np.stack(frames * 4), SPHERE).reason == reason).all()


def test_two_small_reflections_are_no_two_lights() -> None:
    lights = [light_direction(20.0, 40.0), light_direction(190.0, 50.0)]
    small = sphere_frame(SPHERE, lights, SHAPE, light_radius_deg=3.5)
    assert find_lights(np.stack([*sphere_frames(LIGHTS), small]), SPHERE).reason[-1] == AMBIGUOUS


def test_a_light_far_behind_the_object_shows_at_the_contour_alone() -> None:
    frames = sphere_frames([*LIGHTS, light_direction(200.0, 162.0)])
    assert find_lights(frames, SPHERE).reason[-1] == OUTSIDE_SPHERE


@pytest.mark.parametrize(
    ("contrast", "noise", "is_light"), [(11, 0.0, False), (13, 0.0, True), (20, 3.0, False), (20, 1.5, True)]
)
def test_a_light_is_twelve_levels_and_eight_times_the_noise_above_the_background(
    contrast: int, noise: float, is_light: bool
) -> None:
    background = 25.0 + np.random.default_rng(0).normal(0.0, noise, (len(LIGHTS), *SHAPE)).clip(-noise, noise)
    frames = np.where(sphere_frames(LIGHTS) > 150, 25.0 + contrast, background).round().astype(np.uint8)
    if is_light:
        assert find_lights(frames, SPHERE).accepted.mean() > 0.8
    else:
        with pytest.raises(UnusableCapture, match="no moving light"):
            find_lights(frames, SPHERE)


def test_dim_second_reflections_are_no_second_light() -> None:
    frames = sphere_frames(LIGHTS)
    for frame in frames:
        cv2.circle(frame, (46, 60), 5, 110, -1)
    lights = find_lights(frames, SPHERE)
    assert (lights.reason == TWO_LIGHTS).sum() == 0
    assert lights.accepted.mean() > 0.8


@pytest.mark.long
def test_a_glare_streak_does_not_pull_the_light() -> None:
    sphere = Sphere(220.0, 221.0, 200.0)
    directions = [light_direction(60.0 * k, 15.0 + 3 * k) for k in range(6)]
    frames = np.stack([sphere_frame(sphere, [light], (442, 440), seed=k) for k, light in enumerate(directions)])
    for frame, light in zip(frames, directions, strict=True):
        h = half_vectors_of(light)
        x, y = int(220 + 200 * h[0]), int(221 - 200 * h[1])
        streak = cv2.line(np.zeros_like(frame), (x, y), (x + 30, y + 90), 215, 7)
        np.maximum(frame, streak, out=frame)
    errors = angles(find_lights(frames, sphere).lights, np.array(directions))
    assert np.nanmax(errors) < 0.5


def test_one_frame_works() -> None:
    lights = find_lights(sphere_frames(LIGHTS[:1]), SPHERE)
    assert lights.accepted.all()
    assert angles(lights.half_vectors[0], half_vectors_of(LIGHTS[0])) < 0.3


@pytest.mark.parametrize("value", [0, 7, 255])
def test_frames_without_any_light_are_unusable(value: int) -> None:
    with pytest.raises(UnusableCapture, match="no moving light"):
        find_lights(np.full((5, *SHAPE), value, np.uint8), SPHERE)


def test_a_static_window_is_no_light() -> None:
    frames = np.stack([sphere_frame(SPHERE, [], SHAPE, window=True, seed=k) for k in range(20)])
    with pytest.raises(UnusableCapture):
        find_lights(frames, SPHERE)


def test_a_sphere_outside_its_frames_is_unusable() -> None:
    with pytest.raises(UnusableCapture, match="outside"):
        find_lights(sphere_frames(LIGHTS[:3]), Sphere(500.0, 500.0, 36.0))


def test_wrong_shapes_are_programming_errors() -> None:
    with pytest.raises(ValueError, match="sample"):
        static_background(np.zeros((0, 4, 4), np.uint8), SPHERE)
    static = static_background(sphere_frames(LIGHTS[:2]), SPHERE)
    with pytest.raises(ValueError, match="static background"):
        measure_highlights(np.zeros((2, 3, 3), np.uint8), SPHERE, static)


def test_several_spheres_are_averaged_with_their_inter_sphere_angle() -> None:
    first = find_lights(sphere_frames(LIGHTS), SPHERE)
    off = Sphere(SPHERE.x + 0.02 * SPHERE.radius, SPHERE.y, SPHERE.radius)
    second = find_lights(sphere_frames(LIGHTS), off)
    merged = merge_spheres([first, second], [SPHERE, SPHERE])
    median, worst = inter_sphere_angles(merged)
    assert 0.3 < median < 1.0 and worst < 2.0
    assert merged.accepted.sum() == (first.accepted | second.accepted).sum()
    assert np.nanmax(angles(merged.half_vectors, first.half_vectors)) < 1.5
    shared = first.accepted & second.accepted
    assert np.array_equal(merged.area[shared], np.maximum(first.area, second.area)[shared])
    assert merge_spheres([first], [SPHERE]) is first
    with pytest.raises(ValueError):
        merge_spheres([], [])


def test_a_sphere_that_is_badly_known_hardly_counts_beside_a_good_one() -> None:
    off = replace(SPHERE, x=SPHERE.x + 0.06 * SPHERE.radius, centre_sd=0.06 * SPHERE.radius)
    good, bad = (find_lights(sphere_frames(LIGHTS), sphere) for sphere in (SPHERE, off))
    merged = merge_spheres([bad, good], [off, SPHERE])
    assert inter_sphere_angles(merged)[0] == inter_sphere_angles(merge_spheres([bad, good], [SPHERE, SPHERE]))[0]
    assert np.nanmax(angles(merged.half_vectors, good.half_vectors)) < 0.3
    assert np.nanmedian(angles(bad.half_vectors, good.half_vectors)) > 3.0


def test_spheres_that_contradict_each_other_reject_the_frame() -> None:
    first = find_lights(sphere_frames(LIGHTS), SPHERE)
    second = find_lights(sphere_frames(LIGHTS[::-1]), SPHERE)
    merged = merge_spheres([first, second], [SPHERE, SPHERE])
    assert (merged.reason == AMBIGUOUS).sum() > len(LIGHTS) // 2
    assert np.isnan(merged.half_vectors[merged.reason == AMBIGUOUS]).all()


@pytest.mark.parametrize("good_spheres", [2, 3])
def test_spheres_that_agree_outvote_one_that_does_not(good_spheres: int) -> None:
    good = find_lights(sphere_frames(LIGHTS), SPHERE)
    bad = find_lights(sphere_frames(LIGHTS), replace(SPHERE, x=SPHERE.x + 0.2 * SPHERE.radius))
    shared = good.accepted & bad.accepted
    assert np.median(angles(good.half_vectors[shared], bad.half_vectors[shared])) > 8.0
    merged = merge_spheres([bad] + [good] * good_spheres, [SPHERE] * (1 + good_spheres))
    assert np.array_equal(merged.accepted, good.accepted), "neither vetoed nor taken from the bad one alone"
    assert np.nanmax(angles(merged.half_vectors, good.half_vectors)) < 0.01
    assert inter_sphere_angles(merged)[1] < 0.01
    pairs = merge_spheres([bad] * good_spheres + [good] * good_spheres, [SPHERE] * 2 * good_spheres)
    assert (pairs.reason[shared] == AMBIGUOUS).mean() > 0.9, "two opinions of equal weight"


def test_a_sphere_that_errs_in_a_few_frames_is_outvoted_there_alone() -> None:
    good = find_lights(sphere_frames(LIGHTS), SPHERE)
    few = np.flatnonzero(good.accepted)[::10]
    vectors = good.half_vectors.copy()
    vectors[few] = np.roll(vectors[few], 1, axis=0)
    worse = replace(good, half_vectors=vectors)
    unseen = find_lights(sphere_frames(LIGHTS), SPHERE)
    reason = unseen.reason.copy()
    reason[-len(reason) // 2 :] = BEHIND
    unseen = replace(unseen, reason=reason)
    merged = merge_spheres([good, worse, unseen], [SPHERE] * 3)
    is_shared = unseen.accepted[few]
    assert merged.accepted[few[is_shared]].all() and merged.accepted.sum() > 0.9 * good.accepted.sum()
    assert np.nanmax(angles(merged.half_vectors, good.half_vectors)) < 2.5


@pytest.mark.shared
@pytest.mark.parametrize(
    ("capture", "x", "y", "radius"),
    [
        ("hemisphere/front", 334.0, 121.5, 38.0),
        ("cylinder/front", 262.5, 180.5, 45.0),
        ("duck/front", 322.5, 115.5, 40.0),
    ],
)
def test_lights_of_a_shared_capture(shared_data: Path, capture: str, x: float, y: float, radius: float) -> None:
    folder = shared_data / "captures" / capture
    left, top = int(x - radius) - 4, int(y - radius) - 4
    side = int(2 * radius) + 10
    video, frames = cv2.VideoCapture(str(folder / "video.mp4")), []
    for _ in range(400):
        frame = video.read()[1]
        frames.append(cv2.cvtColor(frame[top : top + side, left : left + side], cv2.COLOR_BGR2GRAY))
    truth = half_vectors_of(np.load(folder / "truth" / "lights.npy")[:400])
    lights = find_lights(np.stack(frames), Sphere(x, y, radius).in_crop(left, top))
    errors = angles(lights.half_vectors, truth)
    assert lights.accepted.mean() > 0.98
    assert np.nanmedian(errors) < 0.3
    assert np.nanpercentile(errors, 95) < 0.5


def blurred_frames(blur: float, light_radius_deg: float) -> np.ndarray:
    """Frames of lights far brighter than what clips, seen through blurring optics."""
    frames = []
    for k, light in enumerate(BLURRED_LIGHTS):
        directions, on_sphere = reflected_directions(SPHERE, SHAPE, 5)
        lit = on_sphere & (directions @ light > np.cos(np.radians(light_radius_deg)))
        sharp = pooled(np.where(on_sphere, 25.0, 60.0) + np.where(lit, 6000.0, 0.0), 5)
        noise = np.random.default_rng(k).normal(0.0, 1.5, SHAPE)
        frames.append(cv2.GaussianBlur(sharp, (0, 0), blur) + noise if blur else sharp + noise)
    return np.clip(np.rint(frames), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("blur", "light_radius_deg"), [(0.0, 8.0), (0.0, 3.0), (1.0, 8.0), (1.0, 3.0), (1.5, 4.0)])
def test_blur_does_not_tilt_half_vectors(blur: float, light_radius_deg: float) -> None:
    """Neither does the sphere's distortion, whatever share of a highlight is blur."""
    lights = find_lights(blurred_frames(blur, light_radius_deg), SPHERE)
    truth = half_vectors_of(np.array(BLURRED_LIGHTS))
    oblique = lights.accepted & (truth[:, 2] < np.cos(np.radians(25.0)))
    tilt = [np.degrees(np.arccos(half[oblique, 2])) for half in (lights.half_vectors, truth)]
    assert oblique.sum() >= 15 and abs(np.mean(tilt[0] - tilt[1])) < 0.05


def test_a_few_frames_tell_nothing_of_blur() -> None:
    half = half_vectors_of(np.array(LIGHTS[15:20]))
    spread = np.tile([4.0, 0.0, 4.0], (5, 1))
    assert np.array_equal(without_blur(half, np.full(5, 50.0), spread, 36.0), half)


def test_a_highlight_without_blur_keeps_its_half_vector() -> None:
    """The light's image is an ellipse of the axes that the sphere's distortion gives a disc."""
    truth = half_vectors_of(np.array(LIGHTS))
    cosine, sine = truth[:, 2], np.hypot(truth[:, 0], truth[:, 1])
    x, y = truth[:, 0] / sine, -truth[:, 1] / sine
    along, across = ((3.0 * factor) ** 2 / 4.0 + 1.0 / 12.0 for factor in (cosine, 1.0 / cosine))
    spread = np.column_stack([along * x * x + across * y * y, (along - across) * x * y, along * y * y + across * x * x])
    area = np.full(len(truth), np.pi * 9.0)
    np.testing.assert_allclose(without_blur(truth, area, spread, 36.0), truth, atol=1e-6)
    turned = without_blur(truth, area, np.tile([2.3, 0.0, 2.3], (len(truth), 1)), 36.0)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0)
    assert (turned[:, 2] >= truth[:, 2]).all() and (turned[10:20, 2] > truth[10:20, 2] + 4e-4).all()


def test_the_size_of_a_light_follows_from_its_images() -> None:
    lights = find_lights(sphere_frames(LIGHTS), SPHERE)
    by_area = np.degrees(2.0 * np.sqrt(np.median(lights.area[lights.accepted]) / np.pi) / SPHERE.radius)
    assert lights.angular_radius(SPHERE.radius) == pytest.approx(by_area)
    # The same picture on a sphere of twice the pixels shows a light of half the angle.
    assert lights.angular_radius(2.0 * SPHERE.radius) == pytest.approx(by_area / 2.0)
    assert [light_size(radius) for radius in (None, 5.0, 9.9, 16.9)] == pytest.approx([1.0, 1.0, 1.0, 2.0])
