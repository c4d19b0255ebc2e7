import warnings

import numpy as np

from glint.tasks.algorithms.revolution.fit_limits import FitLimits


def test_a_surface_must_explain_normals_much_better_than_a_flat_face_does() -> None:
    angles = np.radians(np.linspace(-20.0, 20.0, 41))
    accepted = np.stack([np.sin(angles), np.zeros(41), np.cos(angles)], axis=-1)[None]
    mean = float(np.degrees(np.abs(angles)).mean())
    assert np.isclose(FitLimits(90.0, 0.4).largest_error(accepted, None), 0.4 * mean)
    assert FitLimits(2.0, 0.4).largest_error(accepted, None) == 2.0
    assert FitLimits(90.0, 0.4).largest_error(accepted, accepted) < 1e-3


def test_without_accepted_normals_none_is_contradicted() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert FitLimits(5.0, 0.4).largest_error(np.full((4, 4, 3), np.nan), None) == 5.0
