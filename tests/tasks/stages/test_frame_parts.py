"""Parts of a frame, and what is given for it: the last position that is accepted and the first that is not."""

import numpy as np
import pytest

from glint.storage.catalogue.loading import Region
from glint.storage.catalogue.models import Camera
from glint.storage.errors import InputError
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.errors import MisplacedSphere
from glint.tasks.stages.frame_parts import (
    MIN_FOCAL_SHARE,
    MIN_REGION_PX,
    around,
    camera_warnings,
    check_camera,
    check_frame,
    check_light_source,
    check_region,
    check_spheres,
    moving_parts,
    within,
)

SIZE = (60, 80)


def test_the_rectangle_around_a_mask_has_its_margin_inside_the_frame() -> None:
    mask = np.zeros(SIZE, bool)
    mask[20:31, 40:52] = True
    assert around(mask, 0) == Region(x=40, y=20, width=12, height=11)
    assert around(mask, 5) == Region(x=35, y=15, width=22, height=21)
    assert around(mask, 30) == Region(x=10, y=0, width=70, height=60)


def test_the_pixels_of_a_region_are_those_of_its_rows_and_columns() -> None:
    inside = within(Region(x=3, y=7, width=20, height=10), SIZE)
    assert inside is not None and inside.sum() == 200 and inside[7, 3] and inside[16, 22]
    assert within(None, SIZE) is None


@pytest.mark.parametrize("size", [(1, 400), (400, 1), (MIN_REGION_PX - 1, 400)])
def test_frames_that_hold_no_object_are_refused_with_their_size(size: tuple[int, int]) -> None:
    with pytest.raises(InputError, match=f"are {size[1]} x {size[0]} pixels, too small") as caught:
        check_frame(size)
    assert f"at least {MIN_REGION_PX} pixels" in caught.value.remedy
    check_frame((MIN_REGION_PX, 400))


def test_what_moves_with_the_light_is_the_object_and_a_square_around_each_sphere() -> None:
    region = Region(x=1, y=2, width=30, height=20)
    parts = moving_parts(region, [Sphere(50.0, 30.0, 10.0), Sphere(75.0, 5.0, 10.0)], SIZE)
    assert parts == [
        region,
        Region(x=39, y=19, width=23, height=23),
        Region(x=64, y=0, width=16, height=17),
    ]
    assert moving_parts(None, [], SIZE) == []


@pytest.mark.parametrize(("x", "y"), [(9.0, 30.0), (70.0, 30.0), (40.0, 9.0), (40.0, 50.0)])
def test_a_sphere_may_touch_the_edge_of_the_frame_and_not_leave_it(x: float, y: float) -> None:
    check_spheres([Sphere(x, y, 10.0)], SIZE)
    outward = np.sign([x - 40.0, y - 30.0])
    with pytest.raises(MisplacedSphere, match="leaves the frame of 80 x 60 pixels"):
        check_spheres([Sphere(40.0, 30.0, 10.0), Sphere(x + outward[0], y + outward[1], 10.0)], SIZE)


def test_a_sphere_that_the_frame_cuts_off_is_to_be_recorded_again() -> None:
    with pytest.raises(MisplacedSphere) as cut:
        check_spheres([Sphere(75.0, 30.0, 10.0)], SIZE)
    assert cut.value.remedy.startswith("if the frame cuts the sphere off, record again")
    with pytest.raises(MisplacedSphere) as beside:
        check_spheres([Sphere(400.0, 30.0, 10.0)], SIZE)
    assert beside.value.remedy.startswith("correct it")


def test_a_region_lies_inside_the_frame_and_can_hold_an_object() -> None:
    check_region(Region(x=50, y=40, width=30, height=20), SIZE)
    for region in (Region(x=51, y=40, width=30, height=20), Region(x=50, y=41, width=30, height=20)):
        with pytest.raises(InputError, match="leaves the frame"):
            check_region(region, SIZE)
    check_region(Region(x=0, y=0, width=MIN_REGION_PX, height=MIN_REGION_PX), SIZE)
    with pytest.raises(InputError, match="too small"):
        check_region(Region(x=0, y=0, width=30, height=MIN_REGION_PX - 1), SIZE)


def test_a_focal_length_is_in_pixels() -> None:
    def camera(focal_x: float, focal_y: float) -> Camera:
        return Camera(matrix=((focal_x, 0.0, 39.5), (0.0, focal_y, 29.5), (0.0, 0.0, 1.0)))

    least = MIN_FOCAL_SHARE * 80
    check_camera(None, SIZE)
    check_camera(camera(least, least), SIZE)
    for focal_x, focal_y in ((least - 1.0, 200.0), (200.0, least - 1.0)):
        with pytest.raises(InputError, match="focal length of 19"):
            check_camera(camera(focal_x, focal_y), SIZE)


def test_spheres_that_a_person_drew_and_known_lights_exclude_each_other() -> None:
    check_light_source([Sphere(1.0, 1.0, 1.0)], None)
    check_light_source([], "lights.lp")
    with pytest.raises(InputError, match="known lights"):
        check_light_source([Sphere(1.0, 1.0, 1.0)], "lights.lp")


@pytest.mark.parametrize(
    ("x", "y", "words"),
    [
        (500.0, 375.0, None),
        (375.0, 500.0, "principal point (375, 500) is 177 pixels beside the middle of the frame of 1001 x 751"),
        (390.0, 510.0, "with x and y exchanged"),
        (700.0, 300.0, None),
        (300.0, 700.0, None),
        (500.0, 800.0, "(500, 800) lies outside the frame of 1001 x 751"),
        (-20.0, 375.0, "lies outside"),
        (1400.0, 375.0, "matrix of this resolution"),
    ],
)
def test_a_principal_point_that_contradicts_the_frame_is_reported(x: float, y: float, words: str | None) -> None:
    warnings = camera_warnings(Camera(matrix=((2000.0, 0.0, x), (0.0, 2000.0, y), (0.0, 0.0, 1.0))), (751, 1001))
    assert [words in warning.message for warning in warnings if words] == [True] * (words is not None)
    assert len(warnings) == (words is not None)
    for warning in warnings:
        assert warning.cause == "camera"
        assert warning.cost_deg == pytest.approx(np.degrees(np.arctan(np.hypot(x - 500.0, y - 375.0) / 2000.0)))


def test_a_square_frame_shows_no_exchange_and_no_camera_is_no_fault() -> None:
    camera = Camera(matrix=((900.0, 0.0, 390.0), (0.0, 900.0, 520.0), (0.0, 0.0, 1.0)))
    assert camera_warnings(camera, (1001, 1001)) == [] and camera_warnings(None, SIZE) == []
