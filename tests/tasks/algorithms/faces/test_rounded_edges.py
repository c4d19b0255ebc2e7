"""Rounded edges of a face: candidates beside an edge that turn away from the face, perpendicular to the crease."""

import numpy as np
import pytest

from glint.tasks.algorithms.faces.creases import UNSEEN, Edge
from glint.tasks.algorithms.faces.observed_faces import Face
from glint.tasks.algorithms.faces.rounded_edges import rounded_share, rounding_evidence

SHAPE, INRADIUS = (60, 80), 25.0
HULL = np.zeros(SHAPE, bool)
HULL[10:50, 20:50] = True
RIGHT = Edge(0, np.array([49.0, -10.0]), np.array([49.0, -49.0]), np.array([1.0, 0.0]), UNSEEN)
BELOW = Edge(0, np.array([20.0, -49.0]), np.array([49.0, -49.0]), np.array([0.0, -1.0]), UNSEEN)
OUTSIDE, INSIDE, FAR = slice(50, 54), slice(43, 48), slice(56, 60)
"""Columns of the strip beyond the right edge, of the one before it, and of what lies beyond the first."""


def turned(outward_deg: float, along_deg: float = 0.0) -> np.ndarray:
    """Return the normal (3,) that is turned from the view to the right, and upwards, along the crease."""
    right, up = np.radians([outward_deg, along_deg])
    return np.array([np.sin(right) * np.cos(up), np.sin(up), np.cos(right) * np.cos(up)])


def leaning(degrees: float) -> Face:
    return Face(turned(degrees), HULL, HULL)


def shown(normal: np.ndarray, columns: slice, rows: slice = slice(None)) -> np.ndarray:
    """Return candidates (2, H, W, 3): one normal in the second layer of some pixels, nothing elsewhere."""
    candidates = np.full((2, *SHAPE, 3), np.nan)
    candidates[1, rows, columns] = normal
    return candidates


def test_the_share_is_that_of_the_edge_beside_which_candidates_turn_outwards() -> None:
    face, rounded = leaning(0.0), turned(8.0)
    assert rounded_share(RIGHT, face, shown(rounded, OUTSIDE), INRADIUS) == 1.0
    # Of the rows from 14 to 45, those above the 30th.
    half = rounded_share(RIGHT, face, shown(rounded, OUTSIDE, slice(30)), INRADIUS)
    assert half == pytest.approx(0.5, abs=0.03)
    assert rounded_share(RIGHT, face, shown(rounded, FAR), INRADIUS) == 0.0
    assert rounded_share(RIGHT, face, shown(rounded, INSIDE), INRADIUS) == 0.0
    assert rounded_share(RIGHT, face, shown(rounded, INSIDE), INRADIUS, is_inside=True) == 1.0
    assert rounded_share(RIGHT, face, shown(rounded, OUTSIDE), INRADIUS, is_inside=True) == 0.0


@pytest.mark.parametrize("lean", [-30.0, 0.0, 20.0])
def test_candidates_that_hardly_turn_or_turn_another_way_are_not_those_of_the_edge(lean: float) -> None:
    face = leaning(lean)
    turns = {(8.0, 0.0): 1.0, (8.0, 3.0): 1.0, (3.0, 0.0): 0.0, (-8.0, 0.0): 0.0, (8.0, 6.0): 0.0, (0.0, 8.0): 0.0}
    for (outward, along), share in turns.items():
        candidates = shown(turned(lean + outward, along), OUTSIDE)
        assert rounded_share(RIGHT, face, candidates, INRADIUS) == share, (outward, along)


def test_an_edge_whose_rounding_no_light_reaches_shows_nothing() -> None:
    candidates = shown(turned(42.0), OUTSIDE)
    assert rounded_share(RIGHT, leaning(33.0), candidates, INRADIUS) == 1.0
    assert np.isnan(rounded_share(RIGHT, leaning(35.0), candidates, INRADIUS))
    # On the other side the normal turns towards the camera.
    left = Edge(0, np.array([20.0, -10.0]), np.array([20.0, -49.0]), np.array([-1.0, 0.0]), UNSEEN)
    assert rounded_share(left, leaning(35.0), candidates, INRADIUS) == 0.0


def test_long_edges_count_more_and_untested_ones_do_not() -> None:
    candidates = shown(turned(8.0), OUTSIDE)
    share, length = rounding_evidence([RIGHT, BELOW], leaning(0.0), candidates, INRADIUS)
    assert length == 39.0 + 29.0 and share == pytest.approx(39.0 / 68.0)
    share, length = rounding_evidence([RIGHT, BELOW], leaning(40.0), candidates, INRADIUS)
    assert (share, length) == (0.0, 29.0)
    share, length = rounding_evidence([RIGHT], leaning(40.0), candidates, INRADIUS)
    assert np.isnan(share) and length == 0.0
