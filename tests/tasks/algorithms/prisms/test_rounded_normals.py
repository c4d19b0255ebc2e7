"""Right prisms with rounded edges that candidates prove, mostly by their edges."""

from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.perspective import rotate_to_view, view_vectors
from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.prisms.right_prism import RightPrism, SweptContour
from glint.tasks.algorithms.prisms.rounded_evidence import ShownCandidates, mean_deviation, rounded_log_ratio
from glint.tasks.algorithms.prisms.rounded_normals import RoundedPrismSearch
from glint.tasks.algorithms.prisms.rounded_prism import RoundedPrism
from tests.tasks.algorithms.prisms.block import shown
from tests.tasks.algorithms.prisms.rounded_block import CAMERA, INVERSE_FOCAL, SHAPE, RoundedBlock

FALSE = unit(np.array([0.1, 0.15, 1.0]))


def solid_at(block: RoundedBlock, slope: float, radius: float | None = None) -> RoundedPrism:
    contour = SweptContour(*block.core.contour())
    return RoundedPrism(RightPrism(contour, float(np.radians(slope))), block.radius if radius is None else radius)


@pytest.fixture(scope="module")
def block() -> RoundedBlock:
    return RoundedBlock()


@pytest.fixture(scope="module")
def truth(block: RoundedBlock) -> np.ndarray:
    return block.render()[0]


@pytest.fixture(scope="module")
def given(truth: np.ndarray) -> ShownCandidates:
    view = ShownCandidates.of(shown(truth), np.isfinite(truth[..., 0]))
    assert view is not None
    return view


def test_candidates_speak_for_the_true_slope(block: RoundedBlock, given: ShownCandidates) -> None:
    ratios = {slope: rounded_log_ratio(solid_at(block, slope), given) for slope in range(18, 68, 5)}
    assert max(ratios, key=lambda slope: ratios[slope]) == block.slope
    assert ratios[38] > 40.0
    assert max(ratio for slope, ratio in ratios.items() if abs(slope - block.slope) > 10) < 10.0


def test_edges_that_would_have_flashed_speak_against_a_prism(block: RoundedBlock, given: ShownCandidates) -> None:
    layers = given.layers.copy()
    layers[:, :, 0] = 0.0
    assert rounded_log_ratio(solid_at(block, block.slope), replace(given, layers=layers)) < -10.0


def test_the_same_normals_everywhere_speak_for_no_prism(block: RoundedBlock, truth: np.ndarray) -> None:
    mask = np.isfinite(truth[..., 0])
    proven = np.argwhere(mask & (truth[..., 2] > 0.75))
    draw = np.random.default_rng(3)
    scattered = np.full((12, *truth.shape), np.nan)
    for layer in scattered:
        rows, columns = proven[draw.integers(len(proven), size=int(mask.sum()))].T
        layer[mask] = truth[rows, columns]
    view = ShownCandidates.of(scattered, mask)
    assert view is not None
    assert rounded_log_ratio(solid_at(block, block.slope), view) < 10.0


def test_deviations_are_least_at_the_true_slope(block: RoundedBlock, given: ShownCandidates) -> None:
    deviations = {slope: mean_deviation(solid_at(block, slope), given) for slope in (35.0, 36.5, 38.0, 39.5, 41.0)}
    assert min(deviations, key=lambda slope: deviations[slope]) == block.slope


def test_deviations_are_least_at_the_true_radius(block: RoundedBlock, given: ShownCandidates) -> None:
    solid = solid_at(block, block.slope)
    deviations = {}
    for radius in (6.0, 9.0, 13.0, 17.0):
        other = solid.with_radius(radius)
        assert other is not None
        deviations[radius] = mean_deviation(other, given)
    assert min(deviations, key=lambda radius: deviations[radius]) == block.radius


def test_an_edge_of_another_profile_shows_the_same_normals(block: RoundedBlock, given: ShownCandidates) -> None:
    sharper = solid_at(replace(block, half_width=37.0, half_height=29.0, radius=10.0), block.slope)
    assert rounded_log_ratio(sharper, given) > 20.0


def test_no_candidates_speak_for_nothing(truth: np.ndarray) -> None:
    mask, none = np.isfinite(truth[..., 0]), np.full((1, *SHAPE, 3), np.nan)
    assert ShownCandidates.of(none, mask) is None
    assert RoundedPrismSearch(none, mask, None).best is None


@pytest.mark.parametrize("shape", [{}, {"slope": 30.0, "radius": 8.0}, {"turn": 65.0, "radius": 18.0}])
def test_a_prism_is_found_with_all_its_faces(shape: dict[str, float]) -> None:
    normals, depths = replace(RoundedBlock(), **shape).render()
    mask = np.isfinite(depths)
    best = RoundedPrismSearch(shown(normals), mask, None).best
    assert best is not None
    assert best.log_ratio > 20.0
    assert (np.isfinite(best.normals[..., 0]) == mask).all()
    error = angles(best.normals, normals)[mask]
    assert np.median(error) < 2.0
    assert error.mean() < 4.0
    difference = (best.depths - depths)[mask]
    assert np.nanmedian(np.abs(difference - np.nanmedian(difference))) < 2.0
    # Faces are their flat parts, where normals are the same.
    for pixels in best.faces_in(mask):
        assert angles(best.normals[pixels], best.normals[pixels].mean(axis=0)).max(initial=0.0) < 3.0


def test_a_near_camera_sees_the_same() -> None:
    normals, depths = RoundedBlock(inverse_focal=INVERSE_FOCAL).render()
    mask, view = np.isfinite(depths), view_vectors(CAMERA, SHAPE, 0.0, 0.0)
    relative = rotate_to_view(normals, view)
    best = RoundedPrismSearch(shown(relative), mask, CAMERA).best
    assert best is not None
    error = angles(best.normals, relative)[mask]
    assert np.median(error) < 2.5
    assert error.mean() < 4.5
    assert (best.faces[~mask] == -1).all()


def test_light_through_the_glass_alone_proves_little(truth: np.ndarray) -> None:
    candidates = shown(truth)
    candidates[0] = np.where(np.isfinite(truth), FALSE, np.nan)
    best = RoundedPrismSearch(candidates, np.isfinite(truth[..., 0]), None).best
    assert best is None or best.log_ratio < 10.0
