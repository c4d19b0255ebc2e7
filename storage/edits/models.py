"""Models of the fields that a person can edit; they check whatever comes from outside."""

import base64
from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any, Literal

import cv2
import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, PlainSerializer, PlainValidator, WithJsonSchema

from glint.storage.catalogue.models import Address, Camera, Id, Pose, Positive, Region, Spheres
from glint.storage.errors import InputError, printable
from glint.storage.footage.images import MAX_PIXELS, decode_mask
from glint.storage.inputs.markup import AnnotationEntry

MAX_MARKS = 100_000
"""Largest number of marks of one capture: one every second of a working day, several times over."""
MAX_MASK_BYTES = 50_000_000
"""Largest size of a mask as PNG: noise of the largest frame that a page can show takes less."""
MAX_NOTE_CHARACTERS = 4_000
"""Largest length of a note: two pages of text."""
MAX_LINE_CHARACTERS = 200
"""Largest length of an author's name, and of the sentence that says what changed: one line."""


def _decoded_mask(value: Any) -> np.ndarray:
    """Return a mask, bool (H, W), given as such an array or as the base64 of a PNG.

    Raises:
        ValueError: neither, too large, or empty.
    """
    if isinstance(value, str):
        if len(value) > MAX_MASK_BYTES * 4 // 3:
            raise ValueError(f"the mask has more than {MAX_MASK_BYTES:,} bytes")
        try:
            value = decode_mask(base64.b64decode(value, validate=True), "the mask")
        except (ValueError, InputError) as error:
            raise ValueError(f"the mask is not an image in base64 ({error}): send that of a PNG") from error
    if not isinstance(value, np.ndarray) or value.dtype != np.bool_ or value.ndim != 2:
        raise ValueError("a mask is a bool array (H, W), or the base64 of a PNG")
    if value.size > MAX_PIXELS:
        raise ValueError(f"the mask has {value.size:,} pixels, more than {MAX_PIXELS:,}")
    if not value.any():
        raise ValueError("the mask is empty: paint the object, or take the edit back to have it estimated")
    mask = value.copy()
    mask.flags.writeable = False
    return mask


def mask_png(mask: np.ndarray) -> bytes:
    """Encode a mask, bool (H, W), as PNG: 255 on the object, 0 elsewhere."""
    done, data = cv2.imencode(".png", mask.astype(np.uint8) * np.uint8(255))
    assert done, "cv2 encodes any 8-bit array as PNG"
    return data.tobytes()


def _base64_png(mask: np.ndarray | None) -> str | None:
    return None if mask is None else base64.b64encode(mask_png(mask)).decode()


def _printed(text: str) -> str:
    """Return a text without surrounding space, whose characters a terminal or a page can show.

    Raises:
        ValueError: nothing is left of it, or it holds control characters.
    """
    stripped = text.strip()
    if not stripped or printable(stripped, keep="\n") != stripped:
        raise ValueError("write at least one character, and no control characters")
    return stripped


_MASK_SCHEMA = WithJsonSchema({"type": "string", "format": "byte", "description": "PNG of the frame's size, in base64"})
Mask = Annotated[
    np.ndarray,
    PlainValidator(_decoded_mask),
    PlainSerializer(_base64_png, when_used="json-unless-none"),
    _MASK_SCHEMA,
]
EncodedMask = Annotated[str, Field(max_length=MAX_MASK_BYTES * 4 // 3), _MASK_SCHEMA]
"""A mask before it is decoded."""
Marks = Annotated[tuple[AnnotationEntry, ...], Field(strict=False, max_length=MAX_MARKS)]
Verdict = Literal["good", "usable", "record again"]
"""A person's verdict on what a capture is good for, in the words of `glint check`."""
Line = Annotated[
    str, Field(min_length=1, max_length=MAX_LINE_CHARACTERS, pattern=r"^[^\n]+$"), AfterValidator(_printed)
]
Text = Annotated[str, Field(min_length=1, max_length=MAX_NOTE_CHARACTERS), AfterValidator(_printed)]
Number = Annotated[int, Field(ge=0)]


class _Model(BaseModel):
    model_config = ConfigDict(
        frozen=True, strict=True, extra="forbid", allow_inf_nan=False, arbitrary_types_allowed=True
    )


class EditedFields(_Model):
    """The fields of a capture that can be edited; None: not edited, what the catalogue says holds.

    No spheres (empty): they are found in the video. No marks (empty): none. mask: bool (H, W) of the full frame.
    Coordinates are pixels of the full frame (its first one, where the camera shook), y down, as in the catalogue.
    """

    spheres: Spheres | None = None
    region: Region | None = None
    camera: Camera | None = None
    pixel_size: Positive | None = None
    pose: Pose | None = None
    mask: Mask | None = None
    marks: Marks | None = None
    verdict: Verdict | None = None

    @property
    def edited(self) -> tuple[str, ...]:
        """Names of the fields that are edited, in the order of the model."""
        return tuple(name for name in EditedFields.model_fields if getattr(self, name) is not None)


class Changes(EditedFields):
    """Changes of a capture that are saved together: only the fields that are set, also those set to None, change.

    None takes the edit of a field back. note: is added to the notes.
    """

    note: Text | None = None

    @property
    def changed(self) -> tuple[str, ...]:
        """Names of the fields that change, in the order of the model, without `note`."""
        return tuple(name for name in EditedFields.model_fields if name in self.model_fields_set)


class Note(_Model):
    """A note that a person left."""

    author: Line
    time: datetime
    text: Text


class FieldChange(_Model):
    """The last change of a field: its author, time and revision."""

    revision: Number
    author: Line
    time: datetime


class CaptureEdits(EditedFields):
    """The edits of a capture at a revision of its object's edits.

    revision: of the object's edits when this was read: the `base_revision` of what is saved on top of it. notes: oldest
    first. changes: of each field that was ever edited, also of those whose edit was taken back.
    """

    capture: Id
    revision: Number
    notes: Annotated[tuple[Note, ...], Field(strict=False)] = ()
    changes: Mapping[str, FieldChange] = {}


class EntryEdits(_Model):
    """The edits of a capture in a file: the keys of a catalogue, with mask and marks as files, and the verdict.

    A key that is null takes the edit of that field back. notes: written, but not taken from a file.
    """

    id: Id
    spheres: Spheres | None = None
    region: Region | None = None
    camera: Camera | None = None
    pixel_size: Positive | None = None
    pose: Pose | None = None
    mask: Address | None = None
    markup: Address | None = None
    verdict: Verdict | None = None
    notes: Annotated[tuple[dict[str, str], ...], Field(strict=False)] = ()


class EditsFile(_Model):
    """A file of edits of an object's captures."""

    captures: Annotated[tuple[EntryEdits, ...], Field(strict=False, min_length=1)]


class Revision(_Model):
    """A saved change of one capture's edits.

    number: counted from 1 over all captures of the object. sentence: what changed. fields: those that changed (`note`
    included). undoes: the revision that it takes back, if it does. seals: checksums of all captures' edits.
    """

    number: Number
    capture: Id
    author: Line
    time: datetime
    sentence: Line
    fields: Annotated[tuple[str, ...], Field(strict=False)]
    undoes: Number | None = None
    seals: Mapping[str, str] = {}
