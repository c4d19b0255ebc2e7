from dataclasses import replace

import numpy as np

from glint.tasks.algorithms.labelling.weights import FieldError


def test_spread_grows_with_the_distance_up_to_its_ceiling() -> None:
    known = np.zeros((5, 200), dtype=bool)
    known[:, 0] = True
    error = FieldError(floor=4.0, slope=25.0, ceiling=30.0)
    spread = np.degrees(error.spread(known, thickness=50.0))
    assert np.allclose(spread[:, 0], 4.0) and np.allclose(spread[:, 50], 29.0) and np.allclose(spread[:, 150], 30.0)
    assert np.allclose(np.degrees(error.spread(np.zeros((3, 3), dtype=bool), 10.0)), 30.0)
    # Nothing is thinner than a pixel.
    assert np.allclose(error.spread(known, thickness=0.1), error.spread(known, thickness=1.0))
    assert np.allclose(np.degrees(replace(error, ceiling=100.0).spread(known, thickness=1.0)[:, 1]), 29.0)
