"""A mask grown from a clicked pixel: a disc on a darker table, with noise, and a strip leading away from it."""

import numpy as np
import pytest

from glint.storage.errors import InputError
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.review.growing import NEIGHBOURHOOD, grow, grown_region

HEIGHT, WIDTH, RADIUS = 120, 160, 30
ROWS, COLUMNS = np.mgrid[:HEIGHT, :WIDTH]
DISC = (ROWS - 60) ** 2 + (COLUMNS - 70) ** 2 <= RADIUS**2
EVERYTHING = slice(0, HEIGHT), slice(0, WIDTH)


@pytest.fixture
def image() -> np.ndarray:
    levels = np.where(DISC, 180, 60) + np.random.default_rng(7).normal(0.0, 4.0, (HEIGHT, WIDTH))
    levels[58:63, 70:] = 180
    return levels.clip(0, 255).astype(np.uint8)


def test_what_is_connected_and_alike_grows(image: np.ndarray) -> None:
    strip = np.zeros_like(DISC)
    strip[58:63, 70:] = True
    grown = grown_region(image, 60, 70, 40, *EVERYTHING)
    assert np.count_nonzero(grown ^ (DISC | strip)) < 0.02 * DISC.sum()
    assert np.count_nonzero(grown_region(image, 5, 5, 40, *EVERYTHING) & DISC) < 0.01 * DISC.sum()


def test_a_greater_tolerance_grows_more(image: np.ndarray) -> None:
    sizes = [np.count_nonzero(grown_region(image, 60, 70, tolerance, *EVERYTHING)) for tolerance in (0, 8, 40, 200)]
    assert sizes == sorted(sizes) and sizes[0] < 0.1 * DISC.sum() and sizes[-1] == HEIGHT * WIDTH


def test_nothing_grows_far_from_the_mask(image: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    rows, columns = slice(20, 101), slice(30, 111)
    grown = grown_region(image, 60, 70, 40, rows, columns)
    assert grown[60, 110] and not grown[:, 111:].any()
    monkeypatch.setattr("glint.tasks.review.growing.level_image", lambda context, level: image)
    context: CaptureContext = None  # type: ignore[assignment]
    assert grow(context, "peak", 60, 70, 40, DISC).startswith(b"\x89PNG")
    beyond = 70 + RADIUS + int(NEIGHBOURHOOD * 2 * RADIUS) + 3
    with pytest.raises(InputError, match="far from the mask"):
        grow(context, "peak", beyond, 60, 40, DISC)
    with pytest.raises(InputError, match="outside the frame"):
        grow(context, "peak", WIDTH, 60, 40, DISC)
    assert grow(context, "peak", WIDTH - 1, 60, 40, np.zeros_like(DISC)).startswith(b"\x89PNG")
