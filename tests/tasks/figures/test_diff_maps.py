"""Maps of what differs between two versions."""

from pathlib import Path

import numpy as np
import pytest

from glint.storage.errors import OutputError
from glint.tasks.figures.diff_maps import draw_diff_maps
from glint.tasks.version_diff import Difference
from tests.pictures import read_picture


@pytest.fixture
def difference() -> Difference:
    """Angles of 0, 10, 20 and 50 degrees, depths of -2, 0, 2 and 2; nothing is known of the last pixel."""
    angles = np.array([[0.0, 10.0, 20.0, 50.0, np.nan]], np.float32)
    depths = np.array([[-2.0, 0.0, 2.0, 2.0, np.nan]], np.float32)
    return Difference("duck/front", angles, depths, "mm", ())


def test_colours_run_to_the_ends_of_their_scales_and_unknown_pixels_are_white(
    difference: Difference, tmp_path: Path
) -> None:
    draw_diff_maps(difference, tmp_path)
    angles, depths = (read_picture(tmp_path / f"{name}_difference.png") for name in ("normals", "depth"))
    for picture in (angles, depths):
        assert (picture[0, 4] == 255).all() and (picture[0, :4] != 255).any(axis=-1).all()
        # From dark blue to yellow; OpenCV reads blue, green, red.
        assert picture[0, 0, 0] > picture[0, 0, 2] and picture[0, 2, 2] > picture[0, 2, 0]
        assert len({tuple(pixel) for pixel in picture[0, :3]}) == 3
        assert np.array_equal(picture[0, 2], picture[0, 3])


def test_versions_that_share_no_pixel_have_white_maps(tmp_path: Path) -> None:
    nothing = np.full((3, 4), np.nan, np.float32)
    draw_diff_maps(Difference("duck/front", nothing, nothing, "mm", ()), tmp_path)
    assert all((read_picture(path) == 255).all() for path in tmp_path.glob("*.png"))


def test_a_folder_that_cannot_be_written_is_named(difference: Difference, tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(OutputError, match="cannot be written"):
        draw_diff_maps(difference, tmp_path / "file" / "out")
