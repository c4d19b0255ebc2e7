"""Read the files beside a capture's frames: mask, known lights, annotations, truth; none is trusted until checked."""

import io
import math
import tokenize
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from glint.storage.catalogue.models import Camera, Region
from glint.storage.errors import InputError
from glint.storage.footage.images import MAX_IMAGE_BYTES, decode_mask
from glint.storage.inputs.lp_file import read_lights
from glint.storage.inputs.markup import AnnotationEntry, read_markup
from glint.storage.locations.input_files import Address, locate, read_bytes

__all__ = [
    "AnnotationEntry",
    "Truth",
    "camera_matrix",
    "read_lights",
    "read_markup",
    "read_mask",
    "read_truth",
]

_MAX_ARRAY_BYTES = 4_000_000_000
_MAX_LENGTH_ERROR = 0.1
"""Error of a unit vector's length; those that 8 bits store are off by 0.01."""


def read_mask(address: Address, frame_size: tuple[int, int], region: Region | None = None) -> np.ndarray:
    """Read the object's mask, bool (H, W) of the region (of the frame if there is none); see `decode_mask`.

    frame_size: (height, width). The image has the frame's or the region's size, with any number of channels.

    Raises:
        InputError: unreadable, of another size, or empty inside the region.
    """
    location = locate(address)
    pixels = decode_mask(read_bytes(location, MAX_IMAGE_BYTES), location.uri)
    expected = (region.height, region.width) if region else frame_size
    if pixels.shape == frame_size and region is not None and pixels.shape != expected:
        pixels = pixels[region.rows, region.columns]
    if pixels.shape != expected:
        sizes = [f"the frame's {_size(frame_size)}"] + [f"the region's {_size(expected)}"] * (region is not None)
        raise InputError(
            f"the mask {location.uri} is {_size(pixels.shape)}", f"it must have {' or '.join(sizes)} pixels"
        )
    if not pixels.any():
        raise InputError(
            f"the mask {location.uri} is empty" + (" inside the region" if region else ""),
            "paint the object white on black, or leave the mask out to have it estimated",
        )
    return pixels


def camera_matrix(camera: Camera | None) -> np.ndarray | None:
    """Return the camera's matrix, float64 (3, 3) in pixels; None: orthographic."""
    return None if camera is None else np.array(camera.matrix, np.float64)


@dataclass(frozen=True, slots=True)
class Truth:
    """Ground truth: normals (H, W, 3) and depth (H, W) of the region, NaN outside, lights (T, 3); None if not given."""

    normals: np.ndarray | None
    depth: np.ndarray | None
    lights: np.ndarray | None


def read_truth(folder: Address, shape: tuple[int, ...] | None = None) -> Truth:
    """Read normals.npy, depth.npy and lights.npy of a folder as float32; those that are missing become None.

    Outside the object many data sets hold zeros; such normals become NaN.

    shape: (H, W) of the region.

    Raises:
        InputError: all are missing, or one is malformed, of another size, or holds no normals of this camera frame.
    """
    location = locate(folder)
    shapes: dict[str, tuple[int | None, ...]] = {
        "normals": (*(shape or (None, None)), 3),
        "depth": shape or (None, None),
        "lights": (None, 3),
    }
    arrays: dict[str, np.ndarray | None] = {}
    for name, expected in shapes.items():
        try:
            data = read_bytes(location.child(f"{name}.npy"), _MAX_ARRAY_BYTES)
        except InputError as error:
            if not isinstance(error.__cause__, FileNotFoundError):
                raise
            arrays[name] = None
            continue
        arrays[name] = _decode_array(data, expected, location.child(f"{name}.npy").uri)
    if arrays["normals"] is not None:
        _check_normals(arrays["normals"], location.child("normals.npy").uri)
        arrays["normals"][(arrays["normals"] == 0.0).all(axis=-1)] = np.nan
    if all(array is None for array in arrays.values()):
        raise InputError(f"{location.uri} holds no truth", "put normals.npy, depth.npy or lights.npy there")
    return Truth(**arrays)


def _check_normals(normals: np.ndarray, uri: str) -> None:
    """Check that true normals (H, W, 3) are unit vectors, most of them towards the camera; NaN and 0 are outside."""
    lengths = np.linalg.norm(normals, axis=-1)
    inside = np.isfinite(lengths) & (lengths > 0)
    if not inside.any():
        raise InputError(f"{uri} holds no normal", "save unit vectors, NaN outside the object")
    length, median_z = float(np.median(lengths[inside])), float(np.median(normals[inside, 2]))
    if abs(length - 1.0) > _MAX_LENGTH_ERROR:
        raise InputError(f"the normals of {uri} have a length of {length:.3g}", "save unit vectors")
    if median_z < 0:
        raise InputError(
            f"the normals of {uri} point away from the camera (z is {median_z:.2f} in the median)",
            "write x to the right, y up, z towards the camera: negate y and z of OpenCV's",
        )


def _decode_array(data: bytes, shape: tuple[int | None, ...], uri: str) -> np.ndarray:
    """Decode the bytes of a .npy file of a shape (None: any length) as float32; nothing in it is executed."""
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        reader: Any = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        lengths, is_fortran, dtype = reader(stream)
    except (ValueError, SyntaxError, TypeError, tokenize.TokenError, RecursionError, MemoryError) as error:
        raise InputError(f"{uri} is no NumPy array", "save it with numpy.save") from error
    if len(lengths) != len(shape) or any(
        expected not in (None, length) for expected, length in zip(shape, lengths, strict=True)
    ):
        expected_shape = " x ".join("any" if length is None else str(length) for length in shape)
        raise InputError(f"{uri} has shape {' x '.join(map(str, lengths))}", f"it must be {expected_shape}")
    if dtype.kind not in "fiu":
        raise InputError(f"{uri} holds values of type {dtype}", "save numbers")
    count = math.prod(lengths)
    if min(lengths) < 1 or len(data) - stream.tell() < count * dtype.itemsize:
        raise InputError(f"{uri} is truncated or empty", "copy it again")
    flat = np.frombuffer(data, dtype, count, stream.tell())
    return flat.reshape(lengths, order="F" if is_fortran else "C").astype(np.float32)


def _size(shape: Sequence[int]) -> str:
    return f"{shape[1]} x {shape[0]}"
