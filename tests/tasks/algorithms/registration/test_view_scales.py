"""Views of the figurine whose scales are stated wrongly by a few percent; a turntable seen from above."""

from dataclasses import replace

import numpy as np
import pytest

from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.registered_views import register_by_matrices, register_on_turntable
from glint.tasks.algorithms.registration.turntable import Turntable
from glint.tasks.algorithms.registration.view_scales import fit_scales, scaled
from tests.tasks.algorithms.multiview.figurine import body, views_at, views_of

ANGLES = np.arange(0.0, 360.0, 45.0)
MATRIX = np.array([[400.0, 0.0, 47.5], [0.0, 400.0, 47.5], [0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def upright() -> list[View]:
    return views_of(body(), Turntable(3.0, 0.0, 0.0, ANGLES))


def one_scaled(views: list[View], factor: float) -> list[View]:
    return [*views[:2], scaled(views[2], factor), *views[3:]]


@pytest.mark.long
@pytest.mark.parametrize("factor", [0.97, 1.02])
def test_the_scale_of_one_view_is_corrected(upright: list[View], factor: float) -> None:
    registered = register_on_turntable(one_scaled(upright, factor), ANGLES.tolist())
    factors = np.log([registered.scale_factors[view.name] for view in registered.views])
    # The prior spreads the correction over this view and the opposite one, whose silhouette is its mirror image.
    assert abs(np.log(factor) + factors[2] - factors[6]) < 0.4 * abs(np.log(factor))
    assert np.abs(factors).argmax() == 2 and max(registered.residuals) < 0.05


@pytest.mark.long
def test_right_scales_are_kept_and_large_errors_are_another_mistake(upright: list[View]) -> None:
    assert not register_on_turntable(upright, ANGLES.tolist()).scale_factors
    assert (fit_scales(one_scaled(upright, 1.12), Turntable(3.0, 0.0, 0.0, ANGLES)) == 1.0).all()


@pytest.mark.long
def test_scales_of_views_with_matrices_are_corrected_too(upright: list[View]) -> None:
    posed = register_on_turntable(upright, ANGLES.tolist()).views
    registered = register_by_matrices(one_scaled(list(posed), 1.02))
    factors = np.log([registered.scale_factors[view.name] for view in posed])
    assert abs(np.log(1.02) + factors[2] - factors[6]) < 0.4 * np.log(1.02) and np.abs(factors).argmax() == 2


def test_near_cameras_keep_their_scales() -> None:
    poses = [
        (view.rotation, np.array([0.0, 0.0, -400.0])) for view in views_of(body(), Turntable(0.0, 0, 0, ANGLES[:3]))
    ]
    near = [replace(view, pixel_size=1.1) for view in views_at(body(), poses, matrix=MATRIX)]
    assert (fit_scales(near, None) == 1.0).all()
    assert (fit_scales(near, Turntable(0.0, 0.0, 0.0, ANGLES[:3])) == 1.0).all()


@pytest.mark.long
@pytest.mark.parametrize("lean", [20.0, 45.0])
def test_a_turntable_that_few_views_see_from_above_is_not_taken_for_one_seen_from_below(lean: float) -> None:
    views = views_of(body(), Turntable(3.0, lean, 0.0, ANGLES[::2]))
    registered = register_on_turntable(views, ANGLES[::2].tolist())
    assert not registered.rejected and registered.turntable is not None
    assert registered.turntable.lean_to_camera == pytest.approx(lean, abs=1.5)
