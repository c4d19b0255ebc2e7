"""The round foot of a vessel: an ellipse about its axis, whose near rim flashes and whose far rim is an edge.

A foot seen from above shows the table through clear glass, so that only its rim differs from the table. The near rim is
round and flashes from end to end, which gives the ellipse; the far one is a weak edge. Inside there may be anything,
outside is the table.
"""

from typing import NamedTuple

import cv2
import numpy as np

from glint.tasks.algorithms.masks.contour_edges import edge_image
from glint.tasks.algorithms.masks.ellipse_evidence import Ellipse, EllipseGrid, Evidence, best_ellipse, mean_evidence

SEARCH_WIDTH_PX = 110
"""Largest width of the mask at which a foot is searched for; then it is refined at twice the size, and so on."""
MIN_IMAGE_PX = 8
"""Least width and height of an image in which a foot is searched for."""
MIN_WIDTH_SHARE, MAX_WIDTH_SHARE = 0.15, 0.7
"""Half the width of the foot as a share of the mask's width."""
MIN_ASPECT, MAX_ASPECT = 0.08, 0.65
"""Height of the foot relative to its width: that of a level circle is the sine of the camera's elevation."""
LOWEST_OFFSETS_PX = -5.0, 2.0
"""Offsets of the foot's lowest point from the mask's at the search width."""
AXIS_OFFSET_PX = 2.0
"""Largest offset of the foot from the axis at that width."""
MAX_PLACE_EVIDENCE, MAX_FINE_EVIDENCE = 1.0, 3.0
"""Bound of a place's evidence: in the search, where no place may outweigh the rest, and in the refinement, where the
rim is where slopes are steepest."""
MIN_EVIDENCE, MIN_HALF_EVIDENCE = 0.62, 0.55
"""Mean evidence of the whole rim, and of each half, without which there is no foot."""
MIN_TABLE_RATIO = 1.5
"""Evidence in excess of the neutral level, relative to that of the best ellipse beside the axis."""
BESIDE_SHARE = 1.1
"""Distance of that ellipse from the axis, as a share of the mask's width."""
RIM_INSET_PX = 0.5
"""Distance of the contour from the ellipse: slopes are steepest at the outer edge of the rim's blur."""
COARSE_SAMPLES, FINE_SAMPLES = 48, 96
"""Places along the rim at which evidence is taken, in the search and in the refinement."""
FOOT_TILT_STEP_DEG, MAX_AXIS_TILT_DEG = 4.0, 30.0
"""First step of the tilt in the refinement, and the largest tilt of an axis."""
LINE_ROUNDS, MIN_MISFIT_PX = 10, 0.5
"""Rounds of reweighted least squares in which a line of least absolute distance is fitted, and the distance below which
points weigh alike."""
REFINEMENTS = 3
"""Times that the ellipse is refined at each size, with half of the last steps."""


class _Start(NamedTuple):
    """Where a foot is searched for: lower end (x, y) of the vessel's axis, its tilt, and the vessel's width."""

    x: float
    y: float
    tilt: float
    width: float


def round_foot(mask: np.ndarray, background: np.ndarray, flashes: np.ndarray, is_table: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool of a vessel's foot, none where there is none.

    Args:
        mask: (H, W) bool, the vessel as far as it is known: its stem or its walls, and the lowest point of its foot.
        background: (H, W), level of each pixel without highlights, 0 to 255.
        flashes: (H, W), log ratio of each pixel's flash to the table's.
        is_table: (H, W) bool, pixels of the table.
    """
    width = int(mask.any(axis=0).sum())
    factor = 2 ** max(0, int(np.ceil(np.log2(max(width, 1) / SEARCH_WIDTH_PX))))
    if not width or min(mask.shape) < MIN_IMAGE_PX * factor:
        return np.zeros_like(mask)
    flashes = np.maximum(flashes - np.median(flashes[is_table]) if is_table.any() else flashes, 0.0)
    evidence = _evidence(background, flashes, is_table, factor)
    starts = [
        _Start((x + 0.5) / factor - 0.5, (y + 0.5) / factor - 0.5, tilt, width / factor)
        for x, y, tilt in _lower_ends(mask)
    ]
    excess, ellipse = max((_search(evidence, start) for start in starts), key=lambda best: best[0])
    near, far, _ = mean_evidence(evidence, ellipse, FINE_SAMPLES, MAX_PLACE_EVIDENCE)
    if min(near, far) < MIN_HALF_EVIDENCE or 0.5 * (near + far) < MIN_EVIDENCE:
        return np.zeros_like(mask)
    shift = BESIDE_SHARE * width / factor
    beside = [
        _search(evidence, start._replace(x=start.x + side * shift))[0] for side in (-1.0, 1.0) for start in starts
    ]
    if excess <= MIN_TABLE_RATIO * max(*beside, 0.0):
        return np.zeros_like(mask)
    ellipse = _refined(evidence, ellipse, MAX_FINE_EVIDENCE)[1]
    while factor > 1:
        factor //= 2
        evidence = _evidence(background, flashes, is_table, factor)
        ellipse = _refined(evidence, ellipse.scaled(2.0), MAX_FINE_EVIDENCE)[1]
    return _pixels(ellipse, mask.shape)


def _lower_ends(mask: np.ndarray) -> list[tuple[float, float, float]]:
    """Return column, row and tilt of the lower end of the axis of a mask (H, W) bool, if it is upright and if not.

    The axis is the line of least absolute distance from the middles of the rows. Narrow rows, as of a stem, count more
    than wide ones, as of a vessel with its handle.
    """
    rows = np.flatnonzero(mask.any(axis=1))
    first, last = mask[rows].argmax(axis=1), mask.shape[1] - 1 - mask[rows, ::-1].argmax(axis=1)
    middles, weights = (first + last) / 2.0, 1.0 / (last - first + 1.0)
    height, ends = rows - rows[-1], []
    for degree in (0, 1)[: len(rows)]:
        misfit = np.ones(len(rows))
        for _ in range(LINE_ROUNDS):
            used = np.sqrt(weights / np.maximum(misfit, MIN_MISFIT_PX))
            line = np.polynomial.polynomial.polyfit(height, middles, degree, w=used)
            misfit = np.abs(np.polynomial.polynomial.polyval(height, line) - middles)
        tilt = -float(np.arctan(line[1])) if degree else 0.0
        if abs(tilt) <= np.radians(MAX_AXIS_TILT_DEG):
            ends.append((float(line[0]), float(rows[-1]), tilt))
    return ends


def _evidence(background: np.ndarray, flashes: np.ndarray, is_table: np.ndarray, factor: int) -> Evidence:
    """Return the evidence of images reduced by a factor."""
    background, flashes, share = (_reduced(image, factor) for image in (background, flashes, is_table))
    is_table = share == 1.0
    line_slopes = np.stack(np.gradient(edge_image(background, is_table, is_sharp=True).astype(float)))
    flash_slopes = np.stack(np.gradient(flashes.astype(float)))
    return Evidence(line_slopes, flash_slopes, np.maximum(np.hypot(*line_slopes), np.hypot(*flash_slopes)))


def _reduced(image: np.ndarray, factor: int) -> np.ndarray:
    """Return the means of an image (H, W) over whole blocks of factor x factor pixels."""
    rows, columns = image.shape[0] // factor, image.shape[1] // factor
    whole = image[: rows * factor, : columns * factor].astype(np.float32)
    return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA))


def _search(evidence: Evidence, start: _Start) -> tuple[float, Ellipse]:
    """Return the ellipse with the most evidence about an axis, refined, and its excess over the neutral level."""
    grid = EllipseGrid(
        lowest=(start.x, start.y),
        across=np.linspace(-AXIS_OFFSET_PX, AXIS_OFFSET_PX, 5),
        down=np.arange(LOWEST_OFFSETS_PX[0], LOWEST_OFFSETS_PX[1] + 0.5),
        half_widths=np.geomspace(MIN_WIDTH_SHARE * start.width, MAX_WIDTH_SHARE * start.width, 22),
        aspects=np.geomspace(MIN_ASPECT, MAX_ASPECT, 14),
        tilts=np.array([start.tilt]),
    )
    excess, ellipse = best_ellipse(evidence, grid, COARSE_SAMPLES, MAX_PLACE_EVIDENCE)
    if not np.isfinite(excess):
        return excess, Ellipse(*ellipse)
    return _refined(evidence, Ellipse(*ellipse), MAX_PLACE_EVIDENCE)


def _refined(evidence: Evidence, ellipse: Ellipse, bound: float) -> tuple[float, Ellipse]:
    """Return the ellipse with the most evidence near another, and its excess over the neutral level."""
    excess, steps = -np.inf, np.linspace(-1.0, 1.0, 5)
    for step in 0.5 ** np.arange(REFINEMENTS):
        grid = EllipseGrid(
            lowest=ellipse.lowest,
            across=step * np.linspace(-1.0, 1.0, 3),
            down=step * steps,
            half_widths=ellipse.half_width * (1.0 + 0.03 * step * steps),
            aspects=ellipse.half_height / ellipse.half_width * (1.0 + 0.06 * step * steps),
            tilts=ellipse.tilt + np.radians(FOOT_TILT_STEP_DEG) * step * np.linspace(-1.0, 1.0, 3),
        )
        excess, best = best_ellipse(evidence, grid, FINE_SAMPLES, bound)
        ellipse = Ellipse(*best)
    return excess, ellipse


def _pixels(ellipse: Ellipse, shape: tuple[int, ...]) -> np.ndarray:
    """Return the pixels (H, W) bool inside the rim of an ellipse."""
    rows, columns = np.indices(shape)
    right, below, cosine, sine = columns - ellipse.x, rows - ellipse.y, np.cos(ellipse.tilt), np.sin(ellipse.tilt)
    across = (right * cosine + below * sine) / max(ellipse.half_width - RIM_INSET_PX, 0.5)
    down = (below * cosine - right * sine) / max(ellipse.half_height - RIM_INSET_PX, 0.5)
    return np.asarray(across**2 + down**2 <= 1.0)
