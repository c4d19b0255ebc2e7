import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import angles, to_camera, unit
from glint.tasks.algorithms.revolution.opening import _peak, find_opening
from glint.tasks.algorithms.revolution.surface_of_revolution import SurfaceOfRevolution
from tests.tasks.algorithms.revolution.beaker import tumbler

TILT_DEG = 24.0
LIP_PX = 5.0


def vessel(tilt: float = TILT_DEG) -> SurfaceOfRevolution:
    return tumbler(tilt, 60.0, 45.0)


def capture(is_open: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return mask (H, W), candidates (1, H, W, 3) where they can be seen, and which pixels (H, W) show the lip."""
    shape, glass = (180, 130), vessel()
    rows, columns = (index.ravel() for index in np.indices(shape))
    x, y = to_camera(columns.astype(float), rows.astype(float), shape[1], shape[0])
    normals, inner = glass.normals(x, y), glass.shrunk(LIP_PX).normals(x, y, far=True)
    mask, is_end = np.isfinite(normals[:, 0]), glass.is_end(x, y)
    depth = glass.end_radius - np.linalg.norm(glass.intersect(x, y).outward, axis=1)
    is_wall = is_end & (depth >= LIP_PX)
    seen = np.where(is_wall[:, None], inner if is_open else np.nan, normals)
    seen[(seen[:, 2] < np.cos(np.radians(42.0))) | (is_end & ~is_wall)] = np.nan
    lip = is_end & ~is_wall
    return mask.reshape(shape), seen.reshape(1, *shape, 3), lip.reshape(shape)


@pytest.mark.parametrize("turn", [0.0, 0.75, -0.75])
def test_the_lip_and_the_far_wall_are_found_although_the_tilt_is_wrong(turn: float) -> None:
    mask, candidates, lip = capture(is_open=True)
    fitted = SurfaceOfRevolution.from_silhouette(mask, vessel().axis, np.radians(TILT_DEG + turn))
    opening = find_opening(fitted, mask, candidates)
    assert opening is not None
    assert opening.lip == pytest.approx(LIP_PX, abs=1.5)
    assert np.degrees(opening.surface.tilt) == pytest.approx(TILT_DEG, abs=0.5)
    rows, columns = np.nonzero(mask & opening.around & np.isfinite(candidates[0, ..., 0]))
    x, y = to_camera(columns.astype(float), rows.astype(float), mask.shape[1], mask.shape[0])
    error = angles(opening.entries(x, y)[0], candidates[0, rows, columns])
    assert np.median(error) < 3.0
    assert np.mean(error < 8.0) > 0.9
    rows, columns = np.nonzero(lip)
    x, y = to_camera(columns.astype(float), rows.astype(float), mask.shape[1], mask.shape[0])
    assert np.mean(angles(opening.entries(x, y)[0], vessel().frame.upward[None]) < 20.0) > 0.7


def test_highlights_on_a_third_of_the_far_wall_show_an_opening() -> None:
    mask, candidates, _ = capture(is_open=True)
    is_seen = np.random.default_rng(0).random(mask.shape) < 1 / 3
    opening = find_opening(vessel(), mask, np.where(is_seen[..., None], candidates, np.nan))
    assert opening is not None
    assert opening.lip == pytest.approx(LIP_PX, abs=1.5)
    assert np.degrees(opening.surface.tilt) == pytest.approx(TILT_DEG, abs=0.5)


def test_the_lip_is_found_where_the_lights_reach_a_part_of_the_far_wall() -> None:
    mask, candidates, _ = capture(is_open=True)
    x, _ = to_camera(np.arange(mask.shape[1], dtype=float), np.zeros(mask.shape[1]), mask.shape[1], mask.shape[0])
    is_reached = np.abs(x) < 0.25 * vessel().end_radius
    opening = find_opening(vessel(), mask, np.where(is_reached[:, None], candidates, np.nan))
    assert opening is not None
    assert opening.lip == pytest.approx(LIP_PX, abs=1.5)


def test_light_from_anywhere_shows_no_opening() -> None:
    mask, candidates, _ = capture(is_open=False)
    false = np.random.default_rng(0).normal((0.0, 0.0, 2.0), 1.0, (3, *mask.shape, 3))
    assert find_opening(vessel(), mask, np.concatenate([candidates, unit(false)])) is None


def test_a_closed_end_is_no_opening() -> None:
    mask, candidates, _ = capture(is_open=False)
    assert find_opening(vessel(), mask, candidates) is None


def test_an_end_that_faces_away_is_no_opening() -> None:
    mask, candidates, _ = capture(is_open=True)
    assert find_opening(vessel(0.0), mask, candidates) is None


@pytest.mark.parametrize("is_open", [True, False])
def test_a_mask_that_reaches_beyond_the_lip_hides_no_opening(is_open: bool) -> None:
    mask, candidates, _ = capture(is_open)
    # A dome on the vessel, of pixels that are no object.
    bump = mask.copy()
    rows, columns = np.indices(mask.shape)
    bump |= np.hypot((columns - mask.shape[1] / 2 + 0.5) / 25.0, (rows - np.argmax(mask.any(axis=1))) / 7.0) < 1.0
    fitted = SurfaceOfRevolution.from_silhouette(bump, vessel().axis, np.radians(TILT_DEG))
    assert fitted.end_radius < 0.8 * vessel().end_radius
    opening = find_opening(fitted, bump, candidates)
    if not is_open:
        assert opening is None
        return
    assert opening is not None
    assert opening.surface.end_radius == pytest.approx(vessel().end_radius, abs=3.0)
    is_inside = np.isfinite(candidates[0, ..., 0]) & opening.around
    rows, columns = np.nonzero(is_inside)
    x, y = to_camera(columns.astype(float), rows.astype(float), mask.shape[1], mask.shape[0])
    assert np.mean(angles(opening.entries(x, y)[0], candidates[0, rows, columns]) < 8.0) > 0.8


def test_the_best_tilt_is_the_vertex_of_the_scores_and_not_a_single_high_one() -> None:
    scores = -((np.arange(9.0) - 4.0) ** 2)
    assert _peak(scores) == 4
    scores[5] += 1.5
    assert int(np.argmax(scores)) == 5 and _peak(scores) == 4
    scores[[0, 1, 8]] = np.nan
    assert _peak(scores) == 4
    # Two scores, and those of no vertex, give the best one.
    assert _peak(np.array([np.nan, 1.0, 2.0, np.nan])) == 2
    assert _peak(np.array([4.0, 1.0, 0.0, 1.0, 4.5])) == 4
