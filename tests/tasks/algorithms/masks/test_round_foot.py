"""Feet of vessels, drawn from formulas: a stem, a near rim that flashes, a far rim that is a line on the table."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from glint.tasks.algorithms.masks.ellipse_evidence import Ellipse
from glint.tasks.algorithms.masks.round_foot import round_foot
from tests.tasks.algorithms.overlap import overlap

LEVEL, TEXTURE, LINE_DEPTH, FLASH = 120.0, 6.0, 0.3, 4.0


@dataclass
class Foot:
    """What a foot is found from (`round_foot`), and its true pixels (H, W) bool."""

    mask: np.ndarray
    background: np.ndarray
    flashes: np.ndarray
    is_table: np.ndarray
    truth: np.ndarray

    def found(self) -> np.ndarray:
        return round_foot(self.mask, self.background, self.flashes, self.is_table)


def draw_foot(
    scale: float = 1.0,
    half_height: float = 9.0,
    x: float = 150.0,
    other: float | None = None,
    flash: float = FLASH,
    depth: float = LINE_DEPTH,
    tilt: float = 0.0,
) -> Foot:
    """Draw a vessel whose foot is 60 pixels wide, on a stem.

    scale: of all lengths. x: column of its axis. other: column of a second foot. flash: of the near rim, log
    ratio to the table's. depth: share of the light that the rim takes. tilt: of the vessel, degrees.
    """
    height, width = round(180 * scale), round(300 * scale)
    generator = np.random.default_rng(0)
    noise = cv2.GaussianBlur(generator.normal(0.0, 1.0, (height, width)), (0, 0), 5.0 * scale)
    background = LEVEL + TEXTURE * noise / noise.std()
    flashes = generator.normal(0.0, 0.5, (height, width))
    rows, columns = np.mgrid[:height, :width] / scale
    cosine, sine = np.cos(np.radians(tilt)), np.sin(np.radians(tilt))
    right, below = columns - 150.0, rows - 90.0
    rows, columns = 90.0 + below * cosine - right * sine, 150.0 + right * cosine + below * sine
    truth = np.zeros((height, width), bool)
    for centre in (x, other):
        if centre is None:
            continue
        radius = np.hypot(columns - centre, (rows - 150.0) * 30.0 / half_height)
        slope = np.hypot(columns - centre, (rows - 150.0) * (30.0 / half_height) ** 2) / np.maximum(radius, 1e-6)
        distance = (radius - 30.0) / np.maximum(slope, 1e-6)
        background *= 1.0 - depth * np.exp(-0.5 * ((distance + 1.0) / 0.8) ** 2)
        flashes += flash * ((distance > -2.0) & (distance <= 0.0) & (rows > 150.0))
        if centre == x:
            truth = radius <= 30.0
    bowl = np.hypot((columns - x) / 45.0, (rows - 60.0) / 30.0) < 1.0
    stem = (np.abs(columns - x) < 3.0) & (rows > 60.0) & (rows < 150.0 + half_height)
    mask = bowl | stem
    is_table = ~cv2.dilate((mask | truth).astype(np.uint8), np.ones((7, 7), np.uint8)).astype(bool)
    return Foot(mask, background, flashes, is_table, truth)


@pytest.mark.parametrize("half_height", [5.0, 9.0, 16.0])
def test_a_foot_is_found_by_its_rim(half_height: float) -> None:
    foot = draw_foot(half_height=half_height)
    assert overlap(foot.found(), foot.truth) > 0.8


@pytest.mark.parametrize("tilt", [-15.0, 10.0])
def test_the_foot_of_a_tilted_vessel_is_found(tilt: float) -> None:
    foot = draw_foot(tilt=tilt)
    assert overlap(foot.found(), foot.truth) > 0.85


def test_a_large_foot_is_refined_at_its_own_size() -> None:
    foot = draw_foot(scale=4.0)
    assert overlap(foot.found(), foot.truth) > 0.94


def test_a_matt_coaster_is_no_foot() -> None:
    assert not draw_foot(flash=0.0, depth=0.8).found().any()


def test_a_clear_rim_whose_near_half_hardly_flashes_is_no_foot() -> None:
    assert not draw_foot(flash=2.0, depth=0.9).found().any()


def test_a_stem_without_a_foot_has_none() -> None:
    assert not draw_foot(flash=0.0, depth=0.0).found().any()


def test_an_ellipse_is_no_foot_where_there_is_another_one_on_the_table() -> None:
    foot = draw_foot(x=90.0, other=90.0 + 1.1 * 89.0)
    assert not foot.found().any()


def test_nothing_is_made_up_where_a_foot_is_cut_by_the_edge_of_the_image() -> None:
    foot = draw_foot(x=15.0)
    beside = cv2.dilate(foot.truth.astype(np.uint8), np.ones((5, 5), np.uint8)) == 0
    assert not (foot.found() & beside).any()


def test_an_image_of_a_few_rows_has_no_foot() -> None:
    foot = draw_foot()
    rows = slice(150, 153)
    assert not round_foot(foot.mask[rows], foot.background[rows], foot.flashes[rows], foot.is_table[rows]).any()


def test_a_mask_without_pixels_has_no_foot() -> None:
    foot = draw_foot()
    foot.mask[:] = False
    assert not foot.found().any()


def test_a_foot_is_found_where_no_table_is_known() -> None:
    foot = draw_foot()
    foot.is_table[:] = False
    assert overlap(foot.found(), foot.truth) > 0.8


def test_an_ellipse_keeps_its_place_on_a_finer_grid() -> None:
    ellipse = Ellipse(9.5, 4.5, 3.0, 1.0, 0.1)
    assert ellipse.scaled(2.0) == Ellipse(19.5, 9.5, 6.0, 2.0, 0.1)
    assert Ellipse(2.0, 3.0, 4.0, 1.5, 0.0).lowest == (2.0, 4.5)
