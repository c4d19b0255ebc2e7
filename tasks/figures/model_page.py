"""The page of an object's model: the model from all sides, its views, its files, as markdown."""

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np

from glint.storage.catalogue.models import MODEL
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.tasks.engine.stage import StageRecord
from glint.tasks.figures.capture_page import file_lines, picture_page
from glint.tasks.figures.markdown import plain

MAX_SHEET_EDGE_PX = 780
"""Longer side of the picture sheet."""


def model_page(repository: ObjectRepository, name: str, records: Sequence[StageRecord]) -> str:
    """Return the page of the model (OBJECT/model) that an object has stored."""
    stored = repository.load(WHOLE_OBJECT, MODEL)
    data = stored.read_file("model.png")
    sheet = np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR_RGB))
    files = file_lines(repository.location, repository.object_id, stored.files)
    return sheet_page(name, sheet, stored.record, records, files)


def sheet_page(
    name: str, sheet: np.ndarray, about: Mapping[str, Any], records: Sequence[StageRecord], files: Sequence[str] = ()
) -> str:
    """Return the page of a model from its picture sheet, uint8 (H, W, 3) RGB, and its description as in model.json."""
    legend = (
        f"{about['seen']:.0%} of the surface known, {about['unseen']:.0%} seen by no view; "
        f"volume {rounded(about['volume'])} {about['unit']}\u00b3, area {rounded(about['area'])} {about['unit']}\u00b2"
    )
    lines = [*_views(about), *files]
    pictures = {"The model, every 60 degrees": sheet}
    return picture_page(name, pictures, records, lines, legend, max_edge_px=MAX_SHEET_EDGE_PX)


def rounded(value: float) -> str:
    """Return a number with four significant digits and no exponent."""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def _views(about: Mapping[str, Any]) -> list[str]:
    table = about["turntable"]
    lines = ["## Views", "", "| view | pose | outline misses, pixels | share of the surface |", "|---|---|---:|---:|"]
    for view in sorted(about["views"], key=lambda view: str(view["capture"])):
        name, share = view["capture"], plain(f"{view['share']:.0%}")
        pose = view["pose"] if table is None else f"{view['pose']}: {table['angles'][name]:.1f} degrees"
        residual = f"{view['outline_misses_pixels']:.2f}"
        lines.append(f"| {plain(name)} | {plain(pose)} | {residual} | {share} |")
    lines += [f"| {plain(view['name'])} | left out | | |" for view in about["left_out"]]
    if table is not None:
        lines += [
            "",
            plain(
                f"The turntable's axis leans {table['leans_to_camera_degrees']:.2f} degrees to the camera and "
                f"{table['leans_to_the_right_degrees']:.2f} to the right."
            ),
        ]
    return [*lines, ""]
