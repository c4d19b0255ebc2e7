"""Estimated masks of frames whose object is known."""

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.frames.frame_sample import MAX_SAMPLE_EDGE_PX, FrameSample
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.algorithms.masks import mask as mask_module
from glint.tasks.algorithms.masks import outline
from glint.tasks.algorithms.masks.contour_edges import rim_offset, signed_distance
from glint.tasks.algorithms.masks.mask import estimate_mask
from tests.tasks.algorithms.masks.glass_on_table import CENTRE, OUTER, GlassScene, draw_glass
from tests.tasks.algorithms.overlap import overlap


@pytest.fixture(scope="module")
def ring() -> GlassScene:
    return draw_glass()


def test_the_object_is_separated_from_table_shadow_hole_and_sphere(ring: GlassScene) -> None:
    mask = estimate_mask(ring.frames, spheres=[Sphere(*ring.sphere)])
    assert overlap(mask, ring.mask) > 0.95
    assert not mask[80:100, 80:100].any() and not mask[:, 190:].any()


def test_a_disc_without_hole_is_filled() -> None:
    scene = draw_glass(inner=0.0, seed=1)
    mask = estimate_mask(scene.frames, spheres=[Sphere(*scene.sphere)])
    assert overlap(mask, scene.mask) > 0.95 and mask[80:100, 80:100].all()


def test_a_lamp_that_passes_through_the_picture_is_no_object() -> None:
    scene = draw_glass(width=400, inner=0.0, lamp=330.0, seed=2)
    mask = estimate_mask(scene.frames, spheres=[Sphere(*scene.sphere)])
    assert not mask[:, 290:].any() and overlap(mask, scene.mask) > 0.95


def test_the_object_lies_where_it_is_allowed(ring: GlassScene) -> None:
    within = np.zeros(ring.mask.shape, bool)
    within[:, 60:200] = True
    mask = estimate_mask(ring.frames, spheres=[Sphere(*ring.sphere)], within=within)
    assert not mask[~within].any() and overlap(mask, ring.mask & within) > 0.8


def test_the_estimate_is_reproducible(ring: GlassScene) -> None:
    first, second = (estimate_mask(ring.frames[::4], spheres=[Sphere(*ring.sphere)]) for _ in range(2))
    assert np.array_equal(first, second)


def test_large_frames_are_reduced_and_the_mask_is_enlarged(ring: GlassScene) -> None:
    factor = 4
    height, width = (factor * edge for edge in ring.mask.shape)
    assert width > MAX_SAMPLE_EDGE_PX
    sample = FrameSample(height, width, 100)
    for frame in ring.frames[::4]:
        sample.add(cv2.resize(frame, (width, height)).astype(np.uint16) * 257)
    x, y, radius = (factor * value for value in ring.sphere)
    mask = sample.estimate_mask([Sphere(x, y, radius)])
    expected = cv2.resize(ring.mask.astype(np.uint8), (width, height)) > 0
    assert mask.shape == (height, width) and overlap(mask, expected) > 0.93


@pytest.mark.parametrize(("inner", "expected"), [(0.0, 0.98), (26.0, 0.93)])
def test_the_blur_of_highlights_does_not_widen_the_mask(inner: float, expected: float) -> None:
    scene = draw_glass(inner=inner, blur=1.0, seed=3)
    assert overlap(estimate_mask(scene.frames, spheres=[Sphere(*scene.sphere)]), scene.mask) > expected


@pytest.mark.parametrize("wall", [3.0, 8.0])
def test_the_clear_wall_of_a_glass_is_a_part_of_it(wall: float) -> None:
    scene = draw_glass(inner=0.0, wall=wall, seed=4)
    assert overlap(estimate_mask(scene.frames, spheres=[Sphere(*scene.sphere)]), scene.mask) > 0.95


def test_a_wall_that_turns_the_pattern_of_the_table_is_a_part_of_the_object(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = draw_glass(inner=0.0, wall=10.0, streaks=True, seed=4)

    def estimated() -> float:
        return overlap(estimate_mask(scene.frames, spheres=[Sphere(*scene.sphere)]), scene.mask)

    assert estimated() > 0.95
    monkeypatch.setattr(outline, "TEXTURE_WEIGHT", 0.0)
    assert estimated() < 0.9


@pytest.mark.parametrize(("gap", "depth"), [(2, 0.4), (2, 0.8), (8, 0.8)])
def test_a_line_on_the_table_beside_the_object_is_no_wall_of_it(gap: int, depth: float) -> None:
    scene = draw_glass(inner=0.0, seed=4)
    columns = np.arange(scene.frames.shape[2])
    line = 1.0 - depth * np.exp(-0.5 * (columns - CENTRE[0] - OUTER - gap) ** 2)
    mask = estimate_mask((scene.frames * line).astype(np.uint8), spheres=[Sphere(*scene.sphere)])
    assert overlap(mask, scene.mask) > 0.92


def offset_of(levels: np.ndarray, mask: np.ndarray, used: np.ndarray) -> float | None:
    distance = signed_distance(mask)
    return rim_offset(levels, distance, cv2.GaussianBlur(distance, (0, 0), 1.0), used)


@pytest.mark.parametrize("blur", [0.6, 1.0, 1.6])
@pytest.mark.parametrize("error", [-0.8, 0.0, 0.7])
def test_the_rim_ends_halfway_to_the_table(blur: float, error: float) -> None:
    rows, columns = np.mgrid[:140, :140]
    distance = np.hypot(columns - 70.0, rows - 70.0)
    levels = 1.0 + 20.0 * cv2.GaussianBlur(np.clip(50.5 - distance, 0.0, 1.0), (0, 0), blur)
    offset = offset_of(levels, distance < 50.0 + error, np.ones(distance.shape, bool))
    assert offset == pytest.approx(-error, abs=0.25)


def test_a_rim_like_the_table_has_no_offset() -> None:
    disc = np.hypot(*(np.mgrid[:100, :100] - 50.0)) < 30.0
    everywhere, nowhere = np.ones(disc.shape, bool), np.zeros(disc.shape, bool)
    half = np.where(disc & (np.arange(100) < 50), 20.0, 1.0)
    assert offset_of(np.where(disc, 2.0, 1.0), disc, everywhere) is None
    assert offset_of(half, disc, everywhere) is None
    assert offset_of(np.where(disc, 20.0, 1.0), disc, nowhere) is None
    assert offset_of(np.where(disc, 20.0, 1.0), nowhere, everywhere) is None


def test_a_table_alone_is_refused(ring: GlassScene) -> None:
    light = np.linspace(0.5, 1.0, 60)[:, None, None]
    generator = np.random.default_rng(2)
    table = 100.0 * light * (1.0 + 0.2 * np.sin(np.arange(120) / 5.0))[None, :, None] * np.ones((1, 1, 160))
    frames = np.clip(table + generator.normal(0, 1.5, table.shape), 0, 255).astype(np.uint8)
    with pytest.raises(UnusableCapture, match="no highlight"):
        estimate_mask(frames)
    with pytest.raises(ValueError, match="uint8"):
        estimate_mask(ring.frames[0])


@pytest.mark.parametrize("seed", [0, 5])
def test_a_shadow_that_falls_away_from_the_light_is_no_part_of_the_object(
    monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    scene = draw_glass(inner=0.0, cast=0.25, seed=seed)
    assert overlap(estimate_mask(scene.frames, spheres=[Sphere(*scene.sphere)]), scene.mask) > 0.92
    # Without known lights it is taken for the object.
    monkeypatch.setattr(mask_module, "sectors_of", lambda frames, spheres: np.full(len(frames), -1))
    assert overlap(estimate_mask(scene.frames, spheres=[Sphere(*scene.sphere)]), scene.mask) < 0.8
