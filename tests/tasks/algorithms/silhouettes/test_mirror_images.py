import numpy as np
import pytest

from glint.tasks.algorithms.silhouettes.mirror_images import (
    MirrorAxis,
    completed_silhouette,
    mirror_axes,
    mirror_image,
    mirror_images,
    symmetric_body,
)
from glint.tasks.algorithms.silhouettes.reflection_axes import reflection_axes
from tests.tasks.algorithms.overlap import overlap
from tests.tasks.algorithms.revolution.beaker import camera_positions


def handled() -> tuple[np.ndarray, np.ndarray]:
    """Return the silhouettes (H, W) bool of a tapering vessel with a handle, and of the vessel alone."""
    x, y = camera_positions()
    vessel = (np.abs(y) < 70) & (np.abs(x + 15) < 34 + 0.12 * y)
    ring = np.hypot(x - 22, y - 5)
    return vessel | ((ring < 36) & (ring > 24)), vessel


def bodies(mask: np.ndarray) -> list[np.ndarray]:
    possible = [symmetric_body(mask, image) for image in mirror_images(mask)]
    return [body for body in possible if body is not None]


def test_the_body_beside_a_handle_is_found() -> None:
    mask, vessel = handled()
    assert reflection_axes(mask) == []
    assert max(overlap(body, vessel) for body in bodies(mask)) > 0.99


def test_what_a_mask_lacks_on_one_side_shows_on_the_other() -> None:
    x, y = camera_positions()
    _, vessel = handled()
    mask = vessel & ~((x > 8) & (y < -35)) & ~((x < -42) & (y > 45))
    assert reflection_axes(mask) == []
    completed = [completed_silhouette(mask, image) for image in mirror_images(mask)]
    assert max(overlap(whole, vessel) for whole in completed if whole is not None) > 0.99


def test_half_of_a_silhouette_is_too_little_to_complete() -> None:
    x, _ = camera_positions()
    _, vessel = handled()
    mask = vessel & (x < -10)
    assert completed_silhouette(mask, vessel & (x > -20)) is None


def test_a_flag_with_a_weight_has_no_body() -> None:
    x, y = camera_positions()
    flag = (np.abs(x + 40) < 10) & (np.abs(y) < 90) | (np.abs(y - 70) < 10) & (np.abs(x) < 50)
    mask = flag | (np.hypot(x - 30, y - 20) < 28)
    assert bodies(mask) == []


@pytest.mark.filterwarnings("error")
def test_a_mirror_image_beside_the_silhouette_shows_no_body() -> None:
    mask = np.zeros((40, 60), bool)
    mask[10:30, 5:20] = True
    assert symmetric_body(mask, mask[:, ::-1]) is None


@pytest.mark.parametrize("turn", [0.0, 17.3, -41.0])
def test_the_axis_of_a_body_beside_a_handle_is_found_to_a_fraction_of_a_pixel(turn: float) -> None:
    rows, columns = np.indices((110, 130)).astype(float)
    middle, normal = np.array([64.37, 55.21]), np.array([np.cos(np.radians(turn)), np.sin(np.radians(turn))])
    across = (columns - middle[0]) * normal[0] + (rows - middle[1]) * normal[1]
    along = (rows - middle[1]) * normal[0] - (columns - middle[0]) * normal[1]
    body = (np.abs(across) < 22.0 + 6.0 * np.sin(along / 9.0)) & (np.abs(along) < 42.0)
    axis = mirror_axes(body | (np.hypot(across - 26.0, along + 8.0) < 12.0))[0]
    assert abs((middle - axis.centre) @ axis.normal - axis.offset) < 0.2
    assert abs(axis.normal @ normal) > np.cos(np.radians(0.2))


@pytest.mark.parametrize("offset", [-3.0, 0.0, 2.5])
@pytest.mark.parametrize("down", [False, True])
def test_the_mirror_image_of_a_mask_up_to_the_border_ends_with_the_mask(offset: float, down: bool) -> None:
    """What lies beyond the image is no part of the mask, and pixels of its border are."""
    mask = np.random.default_rng(3).random((14, 21)) < 0.5
    mask[0] = mask[-1] = mask[:, 0] = mask[:, -1] = True
    lines = mask if down else mask.T
    expected = np.zeros_like(lines)
    for line in range(len(lines)):
        image = len(lines) - 1 + round(2.0 * offset) - line
        if 0 <= image < len(lines):
            expected[line] = lines[image]
    axis = MirrorAxis(np.array([10.0, 6.5]), np.pi / 2 if down else 0.0, offset)
    assert np.array_equal(mirror_image(mask, axis), expected if down else expected.T)
