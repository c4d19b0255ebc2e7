"""Scales of one object's captures are compared by the size that the object has by each of them."""

from pathlib import Path

import pytest

from glint.storage.catalogue.loading import Region
from glint.tasks.agreement import contradicting_scales, scale_warnings, unknown_scales
from glint.tasks.stages.capture_geometry import CaptureGeometry
from tests.tasks.make_context import make_context, perform_all


def views(*scales: float | None, width: int = 200, height: int = 300) -> dict[str, CaptureGeometry]:
    region = Region(x=0, y=0, width=width, height=height)
    return {
        f"view-{number}": CaptureGeometry((640, 480), region, (), None, scale, "mm" if scale else "pixels")
        for number, scale in enumerate(scales)
    }


@pytest.mark.parametrize(
    ("scales", "wrong"),
    [
        ((0.3, 0.3), []),
        ((0.3, 0.08, 0.3), []),
        ((0.3, 0.0003, 0.3, 0.31), ["view-1"]),
        ((0.3, 300.0), ["view-0", "view-1"]),
        ((0.3, 2.0, 0.3), ["view-1"]),
        ((0.3, None, None), []),
    ],
)
def test_a_view_in_another_unit_is_told(scales: tuple[float | None, ...], wrong: list[str]) -> None:
    warnings = contradicting_scales(views(*scales))
    assert list(warnings) == wrong
    for name, (warning,) in warnings.items():
        assert warning.cause == "scale"
        assert f"{views(*scales)[name].pixel_size:.3g} mm per pixel" in warning.message
        assert "correct `pixel_size` or `diameter_mm`" in warning.message


def test_the_sizes_are_told() -> None:
    (warning,) = contradicting_scales(views(0.3, 0.0003, 0.3))["view-1"]
    assert "the object is 90 micrometres large, by those of the other captures 90 mm" in warning.message


def test_views_of_a_bottle_from_the_side_and_from_above_agree() -> None:
    above = views(0.1, 0.1, width=200, height=200)
    side = {"side": next(iter(views(0.1, width=220, height=800).values()))}
    assert contradicting_scales(above | side) == {}


def test_views_without_a_scale_beside_others_are_told() -> None:
    assert list(unknown_scales(views(0.3, None, 0.3))) == ["view-1"]
    assert unknown_scales(views(None, None)) == {} == unknown_scales(views(0.3, 0.4))


def test_scales_need_not_be_known_where_no_model_is_wanted(simulated: Path, tmp_path: Path) -> None:
    works = [make_context(simulated, tmp_path / "store") for _ in range(2)]
    for work in works:
        perform_all(work, "survey")
    assert scale_warnings(works) == {}
