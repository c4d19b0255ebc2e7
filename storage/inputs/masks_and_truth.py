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

Shape = tuple[int | None, ...]
"""Lengths of an array's axes; None: any."""
_MAX_ARRAY_BYTES = 4_000_000_000
_MAX_LENGTH_ERROR = 0.1
"""Error of a unit vector's length; those that 8 bits store are off by 0.01."""
_MAX_RISE = 1.4
"""Factor by which true depth and true normals may differ: beyond it the depth is in another unit."""
_MIN_COSINE, _MIN_SLOPE, _MIN_SLOPES = 0.5, 0.1, 50
"""Least z of normals that are compared with depth, least slope in pixels per pixel, and least number of them."""


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


def read_truth(
    folder: Address, shape: tuple[int, ...] | None = None, frame: tuple[tuple[int, int], Region] | None = None
) -> Truth:
    """Read normals.npy, depth.npy and lights.npy of a folder as float32; those that are missing become None.

    Outside the object many data sets hold zeros; such normals become NaN.

    shape: (H, W) of the region. frame: (height, width) of the full frame, and the region in it; arrays of the full
    frame are then cropped to the region.

    Raises:
        InputError: all are missing, or one is malformed, of another size, or holds no normals of this camera frame.
    """
    location = locate(folder)
    sizes = [size for size in (shape or (None, None), frame and frame[0]) if size is not None]
    shapes: dict[str, list[Shape]] = {
        "normals": [(*size, 3) for size in sizes],
        "depth": [tuple(size) for size in sizes],
        "lights": [(None, 3)],
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
        array = _decode_array(data, expected, location.child(f"{name}.npy").uri)
        if frame is not None and name != "lights" and array.shape[:2] == frame[0]:
            array = array[frame[1].rows, frame[1].columns]
        arrays[name] = array
    if arrays["normals"] is not None:
        _check_normals(arrays["normals"], location.child("normals.npy").uri)
        arrays["normals"][(arrays["normals"] == 0.0).all(axis=-1)] = np.nan
        if arrays["depth"] is not None:
            _check_depth(arrays["depth"], arrays["normals"], location.child("depth.npy").uri)
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


def _check_depth(depth: np.ndarray, normals: np.ndarray, uri: str) -> None:
    """Check that true depth (H, W) rises as the true normals (H, W, 3) show: in pixels, towards the camera."""
    with np.errstate(invalid="ignore", divide="ignore"):
        slopes = normals[..., 1::-1] / normals[..., 2:] * (1.0, -1.0)
        steep = (slopes**2).sum(axis=-1)
        rises = (np.stack(np.gradient(depth), axis=-1) * slopes).sum(axis=-1) / steep
        rises = rises[(normals[..., 2] > _MIN_COSINE) & (steep > _MIN_SLOPE**2) & np.isfinite(rises)]
    rise = float(np.median(rises)) if rises.size >= _MIN_SLOPES else 1.0
    if rise < 0:
        raise InputError(f"{uri} falls where the normals show that it rises", "count depth towards the camera")
    if not 1 / _MAX_RISE < rise < _MAX_RISE:
        remedy = "give depth in pixels: divide millimetres by the millimetres that a pixel covers"
        raise InputError(f"{uri} rises {rise:.3g} times as much as the normals show", remedy)


def _decode_array(data: bytes, shapes: Sequence[Shape], uri: str) -> np.ndarray:
    """Decode the bytes of a .npy file of one of these shapes as float32; nothing in it is executed."""
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        reader: Any = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        lengths, is_fortran, dtype = reader(stream)
    except (ValueError, SyntaxError, TypeError, tokenize.TokenError, RecursionError, MemoryError) as error:
        raise InputError(f"{uri} is no NumPy array", "save it with numpy.save") from error
    if not any(_fits(lengths, shape) for shape in shapes):
        of = [""] if len(shapes) == 1 else [", rows x columns of the region,", " of the full frame"]
        expected = " or ".join(_dimensions(shape) + words for shape, words in zip(shapes, of, strict=True))
        raise InputError(f"{uri} has shape {_dimensions(lengths)}", f"it must be {expected}")
    if dtype.kind not in "fiu":
        raise InputError(f"{uri} holds values of type {dtype}", "save numbers")
    count = math.prod(lengths)
    if min(lengths) < 1 or len(data) - stream.tell() < count * dtype.itemsize:
        raise InputError(f"{uri} is truncated or empty", "copy it again")
    flat = np.frombuffer(data, dtype, count, stream.tell())
    return flat.reshape(lengths, order="F" if is_fortran else "C").astype(np.float32)


def _fits(lengths: Sequence[int], shape: Shape) -> bool:
    return len(lengths) == len(shape) and all(b in (None, a) for a, b in zip(lengths, shape, strict=True))


def _dimensions(shape: Shape) -> str:
    return " x ".join("any" if length is None else str(length) for length in shape)


def _size(shape: Sequence[int]) -> str:
    return f"{shape[1]} x {shape[0]}"
