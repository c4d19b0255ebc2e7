"""The straight profile of the body that polygons inside a contour are sections of."""

import numpy as np

from glint.tasks.algorithms.facets.straight_profile import straight_profile


def test_a_profile_ends_flat_where_its_sections_are_seen_edge_on() -> None:
    heights = np.arange(-40.0, 61.0)
    tilt = np.radians(30.0)
    # A wall, its end seen edge-on down to a neck, and the neck's end.
    falling = 1.0 / np.tan(tilt)
    apothems = np.minimum(30.0, np.maximum(30.0 - falling * (heights - 20.0), 8.0))
    apothems = np.minimum(apothems, np.maximum(8.0 - falling * (heights - 50.0), 0.0))
    at, sizes = straight_profile(heights, apothems, np.full(len(heights), tilt))
    assert sizes[0] == sizes[-1] == 0.0
    assert (np.diff(at) >= 0.0).all()
    for middle, size in ((-30.0, 30.0), (15.0, 30.0), (25.0, 8.0), (46.0, 8.0)):
        assert abs(np.interp(middle, at, sizes) - size) < 1.0
    # Flat: at its shoulder and at its end.
    flat = at[:-1][np.diff(at) == 0.0]
    assert {min((-40.0, 20.0, 50.0), key=lambda end: abs(end - height)) for height in flat} == {-40.0, 20.0, 50.0}
    assert all(min(abs(height - end) for end in (-40.0, 20.0, 50.0)) < 3.0 for height in flat)


def test_a_profile_without_sections_is_empty() -> None:
    heights = np.arange(5.0)
    corners = np.column_stack(straight_profile(heights, np.zeros(5), np.zeros(5)))
    assert (corners[:, 1] == 0.0).all()
