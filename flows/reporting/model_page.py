"""What the dashboard shows of an object's model: the model from all around, its views, its files."""

from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from prefect.artifacts import create_markdown_artifact

from glint.flows.reporting.artifacts import artifact_key, capture_page, file_lines, plain
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import WHOLE_OBJECT
from glint.tasks.engine.stage import Record
from glint.tasks.stages.model import STAGE

WIDEST = 780
"""Pixels of the picture sheet's longer side."""


def model_artifact(repository: ObjectRepository, name: str, records: Sequence[Record]) -> None:
    """Put the model from all around, and how its views were placed, beside the object's flow run."""
    found = repository.load(WHOLE_OBJECT, STAGE)
    drawn = found.read_file("model.png")
    sheet = np.asarray(cv2.imdecode(np.frombuffer(drawn, np.uint8), cv2.IMREAD_COLOR_RGB))
    files = file_lines(repository.location, repository.object_id, found.files)
    page = model_page(name, sheet, found.record, records, files)
    create_markdown_artifact(page, key=artifact_key(name), description=name)


def model_page(
    name: str, sheet: np.ndarray, about: Mapping[str, Any], records: Sequence[Record], files: Sequence[str] = ()
) -> str:
    """Markdown of a model: warnings, its picture sheet (H, W, 3) uint8, views, stages, lines about its files.

    about: as in model.json.
    """
    legend = (
        f"{about['seen']:.0%} of the surface known, {about['unseen']:.0%} seen by no view; "
        f"volume {rounded(about['volume'])} {about['unit']}\u00b3, area {rounded(about['area'])} {about['unit']}\u00b2"
    )
    lines = [*_views(about), *files]
    return capture_page(name, {"The model, every 60 degrees": sheet}, records, lines, legend, widest=WIDEST)


def rounded(value: float) -> str:
    """A number with four digits that count, and no exponent."""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def _views(about: Mapping[str, Any]) -> list[str]:
    table = about["turntable"]
    lines = ["## Views", "", "| view | pose | outline misses, pixels | says most of |", "|---|---|---:|---:|"]
    for each in sorted(about["views"], key=lambda each: str(each["capture"])):
        name = each["capture"]
        pose = each["pose"] if table is None else f"{each['pose']}: {table['angles'][name]:.1f} degrees"
        lines.append(
            f"| {plain(name)} | {plain(pose)} | {each['outline_misses_pixels']:.2f} | {plain(f'{each["share"]:.0%}')} |"
        )
    lines += [f"| {plain(each['name'])} | left out | | |" for each in about["left_out"]]
    if table is not None:
        lines += [
            "",
            plain(
                f"The turntable's axis leans {table['leans_to_camera_degrees']:.2f} degrees to the camera and "
                f"{table['leans_to_the_right_degrees']:.2f} to the right."
            ),
        ]
    return [*lines, ""]
