"""Open vessels and solid bodies whose flat ends show the same far wall."""

import numpy as np
import pytest

from glint.tasks.algorithms.geometry.vectors import to_camera
from glint.tasks.algorithms.revolution.hollowness import MAX_LIP_RADII, MAX_WALL_DEG, MIN_THROUGH_PIXELS, is_solid
from glint.tasks.algorithms.revolution.opening import Opening
from tests.tasks.algorithms.revolution.beaker import tumbler, upright_surface

SHAPE, LIP_PX = (180, 130), 3.0
VESSEL = tumbler(24.0, 60.0, 45.0)


def capture(shown_share: float, below: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return mask (H, W) and candidates (2, H, W, 3): those of the near wall, and those of the far wall behind it.

    shown_share: share of the pixels that show the far wall through the end; below: whether the near wall shows it too.
    """
    rows, columns = (index.ravel() for index in np.indices(SHAPE))
    x, y = to_camera(columns.astype(float), rows.astype(float), SHAPE[1], SHAPE[0])
    near, far = VESSEL.normals(x, y), VESSEL.shrunk(LIP_PX).normals(x, y, far=True)
    mask, is_end = np.isfinite(near[:, 0]), VESSEL.is_end(x, y)
    is_dark = np.random.default_rng(0).random(len(mask)) > shown_share
    far[is_dark | ~(is_end | below) | ~mask] = np.nan
    near[is_end] = np.nan
    return mask.reshape(SHAPE), np.stack([near, far]).reshape(2, *SHAPE, 3)


@pytest.mark.parametrize("shown_share", [1.0, 0.4])
def test_a_far_wall_that_the_near_wall_shows_too_is_a_vessels(shown_share: float) -> None:
    mask, candidates = capture(shown_share, below=True)
    assert not is_solid(Opening(VESSEL, LIP_PX, mask), mask, candidates)


@pytest.mark.parametrize("shown_share", [1.0, 0.4])
def test_a_far_wall_that_only_the_end_shows_is_a_solids(shown_share: float) -> None:
    mask, candidates = capture(shown_share, below=False)
    assert is_solid(Opening(VESSEL, LIP_PX, mask), mask, candidates)


def test_a_thick_lip_is_a_vessels_whatever_its_wall_shows() -> None:
    mask, candidates = capture(1.0, below=False)
    thickness = 1.5 * MAX_LIP_RADII * VESSEL.end_radius
    assert not is_solid(Opening(VESSEL, thickness, mask), mask, candidates)


def test_a_slanting_wall_is_a_vessels_whatever_it_shows() -> None:
    heights = np.arange(-60.0, 60.5, 0.5)
    radii = 20.0 + (heights + 60.0) * np.tan(np.radians(MAX_WALL_DEG + 3.0))
    radii[[0, -1]] = 0.0
    slanting = upright_surface(radii, heights, 24.0)
    mask, candidates = capture(1.0, below=False)
    assert not is_solid(Opening(slanting, 0.0, mask), mask, candidates)


def test_a_near_wall_of_few_pixels_tells_nothing() -> None:
    mask, candidates = capture(1.0, below=False)
    rows, columns = np.indices(SHAPE)
    x, y = to_camera(columns.ravel().astype(float), rows.ravel().astype(float), SHAPE[1], SHAPE[0])
    is_wall = np.flatnonzero(mask.ravel() & ~VESSEL.is_end(x, y))
    mask = mask.ravel().copy()
    mask[is_wall[MIN_THROUGH_PIXELS - 1 :]] = False
    mask = mask.reshape(SHAPE)
    assert not is_solid(Opening(VESSEL, LIP_PX, mask), mask, candidates)
