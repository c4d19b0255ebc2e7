"""Pictures of an evaluation: normals and errors of each method by capture, and the reliability diagram."""

from collections.abc import Sequence

import cv2
import numpy as np

from glint.storage.export.image_files import colour_normals, colour_values
from glint.tasks.algorithms.evaluation.metrics import Reliability
from glint.tasks.algorithms.geometry.vectors import angles
from glint.tasks.evaluation.captures import METHODS, Evaluation

MAX_ERROR_DEG = 45.0
"""Degrees of error at the end of the colour scale."""
CELL_PX = 220
"""Pixels along each side of a cell of the sheet, without its title."""
CELL_TITLE_PX = 22
"""Height of a cell's title in pixels."""
LEFT_PX, TOP_PX, BORDER_PX = 44, 16, 60
"""Corner of the reliability diagram in its picture, and the pixels around it, horizontally and vertically."""
DIAGRAM_GRID_COLOUR, DIAGRAM_DIAGONAL_COLOUR, DIAGRAM_LINE_COLOUR = (225, 225, 225), (150, 150, 150), (60, 120, 190)
"""RGB colours of the reliability diagram."""


def evaluation_sheet(evaluations: Sequence[Evaluation]) -> np.ndarray:
    """Draw two rows of cells per capture: truth and each method's normals; below, confidence and each method's errors.

    Returns RGB uint8 (H, W, 3).
    """
    rows = []
    for evaluation in evaluations:
        normals = [_cell(colour_normals(evaluation.truth), f"{evaluation.name}: truth")]
        title = f"confidence; errors to {MAX_ERROR_DEG:.0f} degrees:"
        errors = [_cell(colour_values(evaluation.confidence, 0.0, 1.0), title)]
        for name in METHODS:
            method = evaluation.method(name)
            normals.append(_cell(colour_normals(evaluation.normals[name]), name))
            error = angles(evaluation.normals[name], evaluation.truth)
            title = f"{method.observed_region.squared:.4f} / {method.whole_mask.squared:.4f}"
            errors.append(_cell(colour_values(error, 0.0, MAX_ERROR_DEG), title))
        rows += [np.hstack(normals), np.hstack(errors)]
    return np.vstack(rows)


def reliability_diagram(evaluations: Sequence[Evaluation], size: int = 420) -> np.ndarray:
    """Draw the share of pixels within 5 degrees over their confidence, all captures together.

    The areas of the circles are proportional to the pixels of each bin. Returns RGB uint8 (size + 60, size + 60, 3).
    Reliability diagram after DeGroot and Fienberg 1983.
    """
    picture = np.full((size + BORDER_PX, size + BORDER_PX, 3), 255, np.uint8)

    def position(confidence: float, right_share: float) -> tuple[int, int]:
        return LEFT_PX + round(confidence * size), TOP_PX + round((1.0 - right_share) * size)

    for tick in np.linspace(0.0, 1.0, 6):
        vertical = position(tick, 0.0), position(tick, 1.0)
        horizontal = position(0.0, tick), position(1.0, tick)
        for ends in (vertical, horizontal):
            cv2.line(picture, *ends, DIAGRAM_GRID_COLOUR, 1, cv2.LINE_AA)
        _write(picture, f"{tick:.1f}", (vertical[0][0] - 10, size + 32))
        _write(picture, f"{tick:.1f}", (12, horizontal[0][1] + 4))
    _write(picture, "confidence (areas: pixels); upwards: share within 5 degrees", (LEFT_PX, size + 52))
    cv2.line(picture, position(0.0, 0.0), position(1.0, 1.0), DIAGRAM_DIAGONAL_COLOUR, 1, cv2.LINE_AA)
    bins = _pooled([bin_ for evaluation in evaluations for bin_ in evaluation.reliability])
    total = max(sum(pixels for _, _, pixels in bins), 1)
    points = [position(confidence, right_share) for confidence, right_share, _ in bins]
    for point, (_, _, pixels) in zip(points, bins, strict=True):
        cv2.circle(picture, point, 3 + round(40.0 * float(np.sqrt(pixels / total))), DIAGRAM_LINE_COLOUR, 1)
    cv2.polylines(picture, [np.array(points, np.int32)], False, DIAGRAM_LINE_COLOUR, 2, cv2.LINE_AA)
    return picture


def _pooled(bins: Sequence[Reliability]) -> list[tuple[float, float, float]]:
    """Return mean confidence, mean share of right pixels, and pixels, of bins with the same lower bound."""
    pooled = []
    for low in sorted({bin_.low for bin_ in bins}):
        members = [bin_ for bin_ in bins if bin_.low == low]
        pixels = np.array([bin_.pixels for bin_ in members], float)
        confidence = float(np.average([bin_.confidence for bin_ in members], weights=pixels))
        right_share = float(np.average([bin_.right for bin_ in members], weights=pixels))
        pooled.append((confidence, right_share, float(pixels.sum())))
    return pooled


def _cell(picture: np.ndarray, title: str) -> np.ndarray:
    """Return a picture scaled into a white cell under its title."""
    scale = min((CELL_PX - 4) / picture.shape[1], (CELL_PX - 4) / picture.shape[0])
    size = max(1, round(picture.shape[1] * scale)), max(1, round(picture.shape[0] * scale))
    scaled = cv2.resize(picture, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_NEAREST)
    cell = np.full((CELL_PX + CELL_TITLE_PX, CELL_PX, 3), 255, np.uint8)
    left, top = (CELL_PX - size[0]) // 2, CELL_TITLE_PX + (CELL_PX - size[1]) // 2
    cell[top : top + size[1], left : left + size[0]] = scaled
    _write(cell, title, (4, 15))
    return cell


def _write(picture: np.ndarray, text: str, position: tuple[int, int]) -> None:
    cv2.putText(picture, text, position, cv2.FONT_HERSHEY_SIMPLEX, 0.4, (30, 30, 30), 1, cv2.LINE_AA)
