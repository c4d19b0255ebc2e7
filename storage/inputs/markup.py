"""Read the user's annotations: highlights marked as true or false, in JSON."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from glint.storage.catalogue.diagnostics import Diagnostic, raise_diagnostics
from glint.storage.catalogue.models import Pixel, Region
from glint.storage.catalogue.yaml_file import read_yaml_file
from glint.storage.catalogue.yaml_lines import Kind, line_of
from glint.storage.locations.input_files import Address, locate
from glint.storage.locations.location import Location

MAX_FRAME_NUMBER = 100_000_000
"""No video has more frames: a frame a second for three years."""


class AnnotationEntry(BaseModel):
    """A highlight that the user marked: frame counted from 0, position in pixels of the full frame, y down."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)
    frame: Annotated[int, Field(ge=0, le=MAX_FRAME_NUMBER)]
    x: Pixel
    y: Pixel
    kind: Literal["true", "false"]


_ANNOTATIONS = TypeAdapter(list[AnnotationEntry])


def _is_markup(root: Any) -> bool:
    """Return whether a value is a list of marks, though perhaps one with errors."""
    return isinstance(root, list) and (
        not root or any(isinstance(item, dict) and AnnotationEntry.model_fields.keys() & item for item in root)
    )


MARKUP_KIND = Kind("list of marks", _is_markup, "write [{frame: .., x: .., y: .., kind: ..}, ..]")


def read_markup(
    address: Address,
    frame_size: tuple[int, int],
    count: int | None = None,
    region: Region | None = None,
    mask: np.ndarray | None = None,
) -> list[AnnotationEntry]:
    """Read the annotations of a file, in its order.

    frame_size: (height, width); count: number of frames; mask: bool (H, W) of the region, where annotations must lie.

    Raises:
        InputError: malformed, or annotations after the last frame or outside the frame, region or mask; it lists all
            of them with their lines.
    """
    root, annotations = _parse(locate(address))
    diagnostics: list[Diagnostic] = []
    for index, annotation in enumerate(annotations):
        reason = position_error(annotation, frame_size, count, region, mask)
        if reason:
            position = f"frame {annotation.frame}, x {annotation.x:g}, y {annotation.y:g}"
            message = f"mark {index + 1} at {position} {reason}"
            diagnostics.append(Diagnostic(locate(address).uri, line_of(root, (index,)), message, "move or remove it"))
    raise_diagnostics(diagnostics)
    return annotations


def check_markup(address: Address, count: int | None = None) -> None:
    """Check what can be checked of an annotations' file before any frame is decoded: its form, and frame numbers.

    count: number of frames, None: unknown.

    Raises:
        InputError: malformed, or annotations after the last frame; it lists all of them with their lines.
    """
    root, annotations = _parse(locate(address))
    raise_diagnostics(
        [
            Diagnostic(
                locate(address).uri,
                line_of(root, (index,)),
                f"mark {index + 1} is at frame {annotation.frame}, after the last frame, {count - 1}",
                "frames count from 0",
            )
            for index, annotation in enumerate(annotations)
            if count is not None and annotation.frame >= count
        ]
    )


def read_marks(address: Address) -> list[AnnotationEntry]:
    """Read the annotations of a file, in its order, without looking at the frames that they lie on.

    Raises:
        InputError: malformed; it lists all mistakes with their lines.
    """
    return _parse(locate(address))[1]


def _parse(location: Location) -> tuple[Any, list[AnnotationEntry]]:
    """Return the content of a file of annotations with its lines, and the annotations.

    Raises:
        InputError: malformed; it lists all mistakes with their lines.
    """
    return read_yaml_file(location, MARKUP_KIND, _ANNOTATIONS.validate_python, AnnotationEntry)


def position_error(
    annotation: AnnotationEntry,
    frame_size: tuple[int, int],
    count: int | None,
    region: Region | None = None,
    mask: np.ndarray | None = None,
) -> str:
    """Return the reason why an annotation's position is invalid; empty if it is valid.

    frame_size: height and width of the full frame. count: number of frames, None: unknown. region: that the annotation
    must lie in; mask: (H, W) bool, of the region, the object that it must lie on.
    """
    height, width = frame_size
    if count is not None and annotation.frame >= count:
        return f"is after the last frame, {count - 1}"
    if not (-0.5 <= annotation.x < width - 0.5 and -0.5 <= annotation.y < height - 0.5):
        return f"lies outside the frame of {width} x {height} pixels"
    area = region or Region(x=0, y=0, width=width, height=height)
    column, row = int(np.floor(annotation.x + 0.5)) - area.x, int(np.floor(annotation.y + 0.5)) - area.y
    if not (0 <= column < area.width and 0 <= row < area.height):
        return "lies outside the region"
    if mask is not None and not mask[row, column]:
        return "lies outside the object"
    return ""
