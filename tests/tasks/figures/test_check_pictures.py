"""Pictures of a check: layers of the frame's size to correct the mask in, and the doubtful silhouette in red."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from glint.storage.catalogue.loading import Region
from glint.storage.errors import OutputError
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.figures.check_pictures import (
    DOUBT_RGB,
    MASK_RGB,
    draw_overview,
    write_check_pictures,
    write_failure_picture,
)
from tests.pictures import read_picture

REGION = Region(x=10, y=20, width=40, height=30)


def test_layers_of_the_mask_have_the_size_of_the_frame(tmp_path: Path) -> None:
    frame = np.full((60, 80), 700 * 16, np.uint16)
    mask, peak = np.zeros((30, 40), bool), np.full((30, 40), 65535, np.uint16)
    mask[5:25, 8:32] = True
    doubt = np.zeros(mask.shape, np.float32)
    half_vectors = np.tile([0.0, 0.0, 1.0], (4, 1))
    paths = write_check_pictures(
        frame,
        REGION,
        [Sphere(65, 30, 10)],
        mask=mask,
        doubt=doubt,
        peak=peak,
        half_vectors=half_vectors,
        keyframe_pictures={2: peak},
        out=tmp_path,
    )
    assert {path.name for path in paths} >= {"frame.png", "brightest.png", "mask.png", "overview.png"}
    first, brightest, painted = (
        read_picture(tmp_path / f"{name}.png", cv2.IMREAD_GRAYSCALE) for name in ("frame", "brightest", "mask")
    )
    assert (first == 43).all() and first.shape == (60, 80)
    assert (brightest[REGION.rows, REGION.columns] == 255).all() and (brightest == 255).sum() == 30 * 40
    assert np.array_equal(painted[REGION.rows, REGION.columns] > 0, mask) and (painted > 0).sum() == mask.sum()


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(OutputError, match="cannot be written"):
        write_failure_picture(np.zeros((60, 80), np.uint8), REGION, [], tmp_path / "file" / "out")


def test_the_silhouette_is_red_where_it_is_doubtful() -> None:
    mask, doubt = np.zeros((30, 40), bool), np.zeros((30, 40), np.float32)
    mask[5:25, 8:32] = True
    doubt[:, 20:] = 0.5
    picture = draw_overview(np.zeros((60, 80), np.uint8), REGION, [], mask, doubt)
    assert tuple(picture[20 + 15, 10 + 31]) == DOUBT_RGB and tuple(picture[20 + 15, 10 + 8]) == MASK_RGB
