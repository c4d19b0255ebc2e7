"""Matrices of near cameras in another unit than the spheres: refused, told, or named as the model's unit."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from glint.storage.catalogue.loading import Capture
from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.multiview.view import View
from glint.tasks.algorithms.registration.registered_views import RegisteredViews
from glint.tasks.algorithms.registration.turntable import Turntable
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.model.model_unit import UNIT_OF_POSES, checked_unit, unit_of_model
from tests.tasks.algorithms.multiview.figurine import body, views_at, views_of

ANGLES = np.array([0.0, 100.0, 220.0])
MATRIX = np.array([[400.0, 0.0, 47.5], [0.0, 400.0, 47.5], [0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def near() -> Callable[[float], RegisteredViews]:
    """Views of a world whose unit is a pixel at the object, stated in a unit that is larger by a factor."""
    rotations = [Turntable(0.0, 0.0, 0.0, ANGLES).pose(number)[0] for number in range(3)]
    views = views_at(body(), [(rotation, np.array([0.0, 0.0, -400.0])) for rotation in rotations], matrix=MATRIX)

    def registered(factor: float) -> RegisteredViews:
        stated = [replace(view, translation=view.translation / factor) for view in views]
        return RegisteredViews(tuple(stated), (), (0.0,) * 3)

    return registered


@pytest.mark.parametrize(("factor", "text"), [(1000.0, "1000"), (25.4, "25"), (0.1, "0.1")])
def test_another_unit_is_refused_with_the_factor(
    near: Callable[[float], RegisteredViews], factor: float, text: str
) -> None:
    with pytest.raises(UnusableCapture, match="times as large as by the spheres") as caught:
        checked_unit(near(factor), "mm")
    assert caught.value.remedy.startswith(f"give positions in millimetres: multiply those of all matrices by {text}")


def test_the_right_unit_and_spheres_beside_the_object_are_taken(near: Callable[[float], RegisteredViews]) -> None:
    for factor in (1.0, 0.85, 1.15):
        assert checked_unit(near(factor), "mm") == ("mm", ())
    unit, (warning,) = checked_unit(near(1.5), "mm")
    assert unit == "mm" and "the model has the size of the matrices" in warning.message


def test_sizes_are_compared_in_the_units_of_the_spheres(near: Callable[[float], RegisteredViews]) -> None:
    """Where a pixel covers 0.2 mm at the spheres, and by the matrices at the object too."""
    registered = near(5.0)
    views = tuple(replace(view, pixel_size=0.2) for view in registered.views)
    assert checked_unit(replace(registered, views=views), "mm") == ("mm", ())


def surveyed(store: Path, sizes: Sequence[float | None]) -> list[CaptureContext]:
    """Return captures whose surveys have found these pixel sizes."""
    captures = [Capture(id=f"view-{number}", frames="video.mp4") for number in range(len(sizes))]
    works = [CaptureContext(str(store), "duck", capture, Parameters(), "run") for capture in captures]
    for work, size in zip(works, sizes, strict=True):
        work.repository.save(work.capture.id, "survey", "key", {}, {"pixel_size": size})
    return works


def test_views_have_one_unit(tmp_path: Path) -> None:
    assert unit_of_model(surveyed(tmp_path / "mm", [0.1, 0.2])) == "mm"
    assert unit_of_model(surveyed(tmp_path / "pixels", [None, None])) == "pixels"
    with pytest.raises(UnusableCapture, match="the scale of view-1 is not known") as caught:
        unit_of_model(surveyed(tmp_path / "both", [0.1, None, 0.2]))
    assert "for all views or for none" in caught.value.remedy


def test_without_a_scale_the_unit_is_that_of_the_matrices(near: Callable[[float], RegisteredViews]) -> None:
    assert checked_unit(near(1.0), "pixels") == ("pixels", ())
    assert checked_unit(near(1000.0), "pixels") == (UNIT_OF_POSES, ())


def test_parallel_rays_and_turntables_hold_the_unit_themselves(near: Callable[[float], RegisteredViews]) -> None:
    views: tuple[View, ...] = tuple(views_of(body(), Turntable(0.0, 0.0, 0.0, ANGLES)))
    assert checked_unit(RegisteredViews(views, (), (0.0,) * 3), "mm") == ("mm", ())
    on_table = replace(near(1000.0), turntable=Turntable(0.0, 0.0, 0.0, ANGLES))
    assert checked_unit(on_table, "mm") == ("mm", ())
