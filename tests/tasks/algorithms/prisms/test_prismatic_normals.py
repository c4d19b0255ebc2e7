"""Right prisms that candidates prove, by their edges alone or by faces that flashed."""

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.perspective import rotate_to_view, view_vectors
from glint.tasks.algorithms.geometry.vectors import angles, unit
from glint.tasks.algorithms.prisms.prism_evidence import ShownNormals, prism_log_ratio
from glint.tasks.algorithms.prisms.prismatic_normals import PrismSearch
from glint.tasks.algorithms.prisms.right_prism import RightPrism, SweptContour
from tests.tasks.algorithms.prisms.block import CAMERA, INVERSE_FOCAL, SHAPE, Block, shown

FALSE = unit(np.array([0.1, 0.15, 1.0]))


def prism_at(block: Block, slope: float) -> RightPrism:
    return RightPrism(SweptContour(*block.contour()), float(np.radians(slope)), block.inverse_focal)


def test_candidates_speak_for_the_true_slope() -> None:
    block = Block()
    truth, *_ = block.render()
    given = ShownNormals.of(shown(truth), np.isfinite(truth[..., 0]))
    assert given is not None
    ratios = {slope: prism_log_ratio(prism_at(block, slope), given) for slope in range(15, 76, 5)}
    assert max(ratios, key=lambda slope: ratios[slope]) == block.slope
    assert ratios[35] > 20.0
    assert max(ratio for slope, ratio in ratios.items() if abs(slope - block.slope) > 10) < 0.5 * ratios[35]


def test_a_face_that_would_have_flashed_speaks_against_a_prism() -> None:
    block = Block(slope=70.0)
    truth, *_ = block.render()
    candidates = shown(truth)
    mask = np.isfinite(truth[..., 0])
    bright = ShownNormals.of(candidates, mask)
    candidates[0][truth @ block.normals[0] > 0.99] = np.nan
    dark = ShownNormals.of(candidates, mask)
    assert bright is not None
    assert dark is not None
    prism = prism_at(block, 70.0)
    assert prism_log_ratio(prism, dark) < prism_log_ratio(prism, bright) - 20.0


def test_no_candidates_speak_for_nothing() -> None:
    mask = np.isfinite(Block().render()[0][..., 0])
    assert ShownNormals.of(np.full((1, *SHAPE, 3), np.nan), mask) is None
    assert PrismSearch(np.full((1, *SHAPE, 3), np.nan), mask, None).best is None


@pytest.mark.parametrize("block", [Block(), Block(slope=48.0, turns=(30.0, 120.0, 210.0, 300.0)), Block(slope=25.0)])
def test_a_prism_is_found_with_all_its_faces(block: Block) -> None:
    truth, depths, _ = block.render()
    mask = np.isfinite(depths)
    found = PrismSearch(shown(truth), mask, None).best
    assert found is not None
    assert found.log_ratio > 15.0
    assert angles(found.normals, truth)[mask].mean() < 5.0
    assert (np.isfinite(found.normals[..., 0]) == mask).all()
    difference = (found.depths - depths)[mask]
    difference = np.abs(difference - np.nanmedian(difference))
    assert np.nanmedian(difference) < 5.0


def test_a_near_camera_sees_the_same() -> None:
    block = Block(inverse_focal=INVERSE_FOCAL)
    truth, depths, _ = block.render()
    mask, view = np.isfinite(depths), view_vectors(CAMERA, SHAPE, 0.0, 0.0)
    relative = rotate_to_view(truth, view)
    found = PrismSearch(shown(relative), mask, CAMERA).best
    assert found is not None
    assert angles(found.normals, relative)[mask].mean() < 5.0
    assert set(np.unique(found.faces[mask])) <= {-1, 0, 1, 2, 3}
    assert (found.faces[mask] >= 0).mean() > 0.9
    assert (found.faces[~mask] == -1).all()


def test_a_large_image_shows_the_same_prism() -> None:
    block = Block(radius=3.0 * 58.0, half_height=3.0 * 48.0, shape=(3 * SHAPE[0], 3 * SHAPE[1]))
    truth, *_ = block.render(rounding=4.5)
    mask = np.isfinite(truth[..., 0])
    found = PrismSearch(shown(truth), mask, None).best
    assert found is not None
    assert angles(found.normals, truth)[mask].mean() < 5.0


def test_light_through_the_glass_alone_proves_little() -> None:
    truth, *_ = Block().render()
    candidates = shown(truth)
    candidates[0] = np.where(np.isfinite(truth), FALSE, np.nan)
    found = PrismSearch(candidates, np.isfinite(truth[..., 0]), None).best
    assert found is None or found.log_ratio < 10.0


def test_a_round_object_is_no_prism() -> None:
    right, down = np.meshgrid(np.arange(170) - 84.5, np.arange(190) - 94.5)
    squared = (right**2 + down**2) / 70.0**2
    sphere = np.stack([right / 70.0, -down / 70.0, np.sqrt(np.maximum(1.0 - squared, 0.0))], axis=-1)
    sphere[squared >= 1.0] = np.nan
    assert PrismSearch(shown(sphere), squared < 1.0, None).best is None
