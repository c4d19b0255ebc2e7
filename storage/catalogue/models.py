"""The catalogue's models: objects, their captures, and the addresses of each capture's files."""

import math
import re
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Annotated, Any, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, field_validator, model_validator
from pydantic_core import PydanticCustomError

from glint.storage.locations.location import METADATA_FILE

ID = re.compile(r"[a-z0-9][a-z0-9._-]{0,63}")

MODEL = "model"
"""Name of the merged model among an object's results."""
RESERVED_IDS = {MODEL: "the object's merged model", METADATA_FILE: "a file in the store"}
"""Ids that no capture may have, and what has them."""

Id = Annotated[str, Field(pattern=rf"^{ID.pattern}$")]
Address = Annotated[str, Field(min_length=1, max_length=4096, pattern=r"^[^\x00]+$")]
MAX_PIXELS_PER_SIDE = 1_000_000
"""Pixels; no frame is wider or higher, nor does anything that a catalogue names lie farther outside of it."""
Pixel = Annotated[float, Field(ge=-MAX_PIXELS_PER_SIDE, le=MAX_PIXELS_PER_SIDE)]
Count = Annotated[int, Field(ge=0, le=MAX_PIXELS_PER_SIDE)]
Positive = Annotated[float, Field(ge=1e-6, le=1e6)]
"""A length in pixels or millimetres, from the size of a molecule to a kilometre: numbers beyond it are mistakes."""
ROTATION_TOLERANCE = 0.01
"""Error of the products of a rotation's rows: a rounded or calibrated matrix passes, a scale or a mirror does not."""
Entry = Annotated[float, Field(ge=-1e9, le=1e9)]
"""An entry of a matrix, in pixels or millimetres: beyond it, single precision loses what is added."""
Row3 = Annotated[tuple[Entry, Entry, Entry], Field(strict=False)]
Row4 = Annotated[tuple[Entry, Entry, Entry, Entry], Field(strict=False)]
Parameters = dict[str, Any]


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, strict=True, extra="forbid", allow_inf_nan=False)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with some fields changed, and without what follows from the fields as they were."""
        copied = super().model_copy(update=update, deep=deep)
        for name in copied.__dict__.keys() - type(self).model_fields.keys():
            del copied.__dict__[name]
        return copied


class Region(_Strict):
    """A crop of the full frame: column and row of its top-left pixel, and its size, in pixels."""

    x: Count
    y: Count
    width: Annotated[Count, Field(ge=1)]
    height: Annotated[Count, Field(ge=1)]

    @property
    def rows(self) -> slice:
        """The region's rows of the full frame."""
        return slice(self.y, self.y + self.height)

    @property
    def columns(self) -> slice:
        """The region's columns of the full frame."""
        return slice(self.x, self.x + self.width)


class Sphere(_Strict):
    """A chrome sphere: centre and radius in pixels of the full frame, y down; its diameter gives the scale."""

    x: Pixel
    y: Pixel
    radius: Positive
    diameter_mm: Positive | None = None


class Camera(_Strict):
    """Perspective camera: 3 x 3 intrinsic matrix in pixels."""

    matrix: Annotated[tuple[Row3, Row3, Row3], Field(strict=False)]

    @model_validator(mode="after")
    def _is_intrinsic_matrix(self) -> Self:
        if self.matrix[2] != (0, 0, 1) or self.matrix[1][0] != 0 or min(self.matrix[0][0], self.matrix[1][1]) <= 0:
            raise PydanticCustomError(
                "camera", "the camera matrix must be [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] with fx and fy above 0"
            )
        return self


class Pose(_Strict):
    """Camera pose: degrees of a turntable, or a 4 x 4 matrix (columns: camera's x right, y up, z to the camera)."""

    turntable: Annotated[float, Field(ge=-36_000, le=36_000)] | None = None
    camera_to_world: Annotated[tuple[Row4, Row4, Row4, Row4], Field(strict=False)] | None = None

    @model_validator(mode="after")
    def _has_one_form(self) -> Self:
        if (self.turntable is None) == (self.camera_to_world is None):
            raise PydanticCustomError("pose", "a pose is either turntable or camera_to_world")
        return self

    @model_validator(mode="after")
    def _is_rigid(self) -> Self:
        if (rows := self.camera_to_world) is not None:
            if rows[3] != (0, 0, 0, 1):
                raise PydanticCustomError("last_row", "the last row of camera_to_world must be 0, 0, 0, 1")
            _check_rotation([row[:3] for row in rows[:3]])
        return self


def _check_rotation(rows: Sequence[Sequence[float]]) -> None:
    """Check that three rows of three are orthonormal and right-handed, to ROTATION_TOLERANCE.

    Raises:
        PydanticCustomError: they are scaled, skewed or mirrored.
    """
    products = [sum(a * b for a, b in zip(rows[i], rows[j], strict=True)) for i in range(3) for j in range(3)]
    (a, b, c), (d, e, f), (g, h, k) = rows
    determinant = a * (e * k - f * h) - b * (d * k - f * g) + c * (d * h - e * g)
    errors = [abs(product - (index % 4 == 0)) for index, product in enumerate(products)]
    if max(errors) >= ROTATION_TOLERANCE:
        lengths = ", ".join(f"{math.hypot(*column):.3g}" for column in zip(*rows, strict=True))
        message = "the first three columns must be at right angles and of length 1; their lengths are {lengths}"
        raise PydanticCustomError("not_orthonormal", message, {"lengths": lengths})
    if abs(determinant - 1) >= ROTATION_TOLERANCE:
        raise PydanticCustomError("mirrored", "the axes in the first three columns are mirrored")


MIN_DISTANCE_RATIO = 0.1
"""Distance of two spheres' centres, in radii of the smaller one, below which they are one sphere listed twice."""


def _distinct(spheres: tuple[Sphere, ...]) -> tuple[Sphere, ...]:
    """Return spheres of which no two are the same.

    Raises:
        PydanticCustomError: two are.
    """
    for second, sphere in enumerate(spheres):
        for first, earlier in enumerate(spheres[:second]):
            distance = math.hypot(sphere.x - earlier.x, sphere.y - earlier.y)
            if distance < MIN_DISTANCE_RATIO * min(sphere.radius, earlier.radius):
                place = f"({sphere.x:.1f}, {sphere.y:.1f})"
                numbers = {"first": first + 1, "second": second + 1, "place": place}
                raise PydanticCustomError(
                    "same_sphere", "spheres {first} and {second} are the same circle {place}", numbers
                )
    return spheres


MAX_GIVEN_SPHERES = 100
"""Largest number of spheres of one capture."""
Spheres = Annotated[tuple[Sphere, ...], Field(strict=False, max_length=MAX_GIVEN_SPHERES), AfterValidator(_distinct)]


class Capture(_Strict):
    """One video or set of images of an object, and what is known about it; what is None or empty is estimated."""

    id: Id
    frames: Address
    spheres: Spheres = ()
    lights: Address | None = None
    camera: Camera | None = None
    region: Region | None = None
    mask: Address | None = None
    markup: Address | None = None
    pose: Pose | None = None
    pixel_size: Positive | None = None
    truth: Address | None = None
    parameters: Parameters = {}

    @model_validator(mode="after")
    def _has_one_light_source(self) -> Self:
        if self.spheres and self.lights:
            raise PydanticCustomError("spheres_and_lights", "a capture has either spheres or lights, not both")
        return self


class Object(_Strict):
    """An object and its captures."""

    id: Id
    captures: Annotated[tuple[Capture, ...], Field(strict=False, min_length=1)]
    truth_model: Address | None = None
    parameters: Parameters = {}

    @cached_property
    def _by_id(self) -> dict[str, Capture]:
        return {capture.id: capture for capture in self.captures}

    def capture(self, capture_id: str) -> Capture:
        """Return the capture with this id; KeyError if there is none."""
        return self._by_id[capture_id]

    @model_validator(mode="after")
    def _has_distinct_ids(self) -> Self:
        if len({capture.id for capture in self.captures}) < len(self.captures):
            raise PydanticCustomError("duplicate_id", "two captures of an object have the same id")
        return self


class Catalogue(_Strict):
    """Objects to process. Paths are absolute, or addresses of an object store."""

    schema_: Annotated[int, Field(alias="schema")]
    name: Annotated[str, Field(min_length=1, max_length=200)]
    objects: Annotated[tuple[Object, ...], Field(strict=False, min_length=1)]
    parameters: Parameters = {}

    @cached_property
    def _by_id(self) -> dict[str, Object]:
        return {item.id: item for item in self.objects}

    def object(self, object_id: str) -> Object:
        """Return the object with this id; KeyError if there is none."""
        return self._by_id[object_id]

    def find(self, object_id: str) -> Object | None:
        """Return the object with this id, None if there is none."""
        return self._by_id.get(object_id)

    @cached_property
    def n_captures(self) -> int:
        """The captures of all objects together."""
        return sum(len(item.captures) for item in self.objects)

    @field_validator("schema_")
    @classmethod
    def _is_known_schema(cls, schema: int) -> int:
        if schema != 1:
            raise PydanticCustomError("schema", "schema {schema} is not known", {"schema": schema})
        return schema

    @model_validator(mode="after")
    def _has_distinct_ids(self) -> Self:
        if len({item.id for item in self.objects}) < len(self.objects):
            raise PydanticCustomError("duplicate_id", "two objects have the same id")
        return self


ADDRESS_KEYS = ("frames", "lights", "mask", "markup", "truth", "truth_model")
"""Keys whose values are paths or addresses."""
