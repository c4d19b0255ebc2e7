"""Highlights that the user marked as true or false, read from JSON."""

from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from glint.storage.catalogue.diagnostics import Problem, raise_all
from glint.storage.catalogue.messages import problems_of
from glint.storage.catalogue.models import Region
from glint.storage.catalogue.yaml_lines import line_of, parse
from glint.storage.errors import InputError
from glint.storage.locations.input_files import MAX_TEXT, Address, locate, read_bytes


class Mark(BaseModel):
    """A highlight that the user marked: frame counted from 0, position in frame pixels, y down."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)
    frame: Annotated[int, Field(ge=0)]
    x: float
    y: float
    kind: Literal["true", "false"]


_MARKS = TypeAdapter(list[Mark])


def read_markup(
    address: Address,
    frame_size: tuple[int, int],
    count: int | None = None,
    region: Region | None = None,
    mask: np.ndarray | None = None,
) -> list[Mark]:
    """Marks of a markup file, in its order.

    frame_size: (height, width); count: number of frames; mask: bool (H, W) of the region, where marks must lie.

    Raises:
        InputError: malformed, or marks in no frame, outside the frame, region or mask; all of them, with their lines.
    """
    location = locate(address)
    data = read_bytes(location, MAX_TEXT)
    try:
        root, problems = parse(data.decode("utf-8-sig"), location.uri)
    except UnicodeDecodeError as error:
        raise InputError(f"{location.uri} is not UTF-8 text", "save it as UTF-8") from error
    raise_all(problems)
    try:
        marks = _MARKS.validate_python(root)
    except ValidationError as error:
        raise_all(problems_of(error, root, Mark, location.uri))
        raise
    for index, mark in enumerate(marks):
        where = _misplaced(mark, frame_size, count, region, mask)
        if where:
            message = f"mark {index} at frame {mark.frame}, x {mark.x:g}, y {mark.y:g} {where}"
            problems.append(Problem(location.uri, line_of(root, (index,)), message, "move or remove it"))
    raise_all(problems)
    return marks


def _misplaced(
    mark: Mark, frame_size: tuple[int, int], count: int | None, region: Region | None, mask: np.ndarray | None
) -> str:
    height, width = frame_size
    if count is not None and mark.frame >= count:
        return f"is after the last frame, {count - 1}"
    if not (-0.5 <= mark.x < width - 0.5 and -0.5 <= mark.y < height - 0.5):
        return f"lies outside the frame of {width} x {height} pixels"
    area = region or Region(x=0, y=0, width=width, height=height)
    column, row = int(np.floor(mark.x + 0.5)) - area.x, int(np.floor(mark.y + 0.5)) - area.y
    if not (0 <= column < area.width and 0 <= row < area.height):
        return "lies outside the region"
    if mask is not None and not mask[row, column]:
        return "lies outside the object"
    return ""
