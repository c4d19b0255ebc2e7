"""Arrays as few bytes, which the viewer's `payload.js` unpacks without loss.

Unsigned integers are replaced by their differences along the rows, split into planes of bytes, and deflated: what is
smooth becomes small. Nothing is rounded here but where a function says so.
"""

import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

_KINDS = {np.dtype(np.uint8): "u8", np.dtype(np.uint16): "u16", np.dtype(np.uint32): "u32"}
NO_DEPTH = 0
"""Code of a packed depth that is not known; known ones are 1 to 65535."""
NO_CONFIDENCE = 255
"""Code of a packed confidence that is not known; known ones are 0 to 254."""


@dataclass(frozen=True, slots=True)
class Part:
    """A packed array (`kind` u8, u16 or u32, `shape`), or the content of a file (`kind` is its media type)."""

    kind: str
    shape: tuple[int, ...]
    data: bytes

    @property
    def facts(self) -> dict[str, Any]:
        """The facts that the viewer needs to unpack it, as JSON."""
        return {"kind": self.kind, "shape": list(self.shape)}


def pack(values: np.ndarray) -> Part:
    """Pack an array (H, W) or (H, W, C) of unsigned integers.

    Raises:
        ValueError: another shape or dtype.
    """
    if values.ndim not in (2, 3) or values.dtype not in _KINDS:
        raise ValueError(f"an array of shape {values.shape} and dtype {values.dtype} cannot be packed")
    layers = values.reshape(*values.shape[:2], -1).transpose(2, 0, 1)
    differences = layers.copy()
    differences[:, :, 1:] -= layers[:, :, :-1]
    little_endian = differences.astype(values.dtype.newbyteorder("<"), order="C")
    octets = little_endian.view(np.uint8).reshape(*layers.shape, values.dtype.itemsize)
    planes = np.ascontiguousarray(octets.transpose(0, 3, 1, 2))
    return Part(_KINDS[values.dtype], values.shape, zlib.compress(planes.tobytes(), 8))


def octahedral(vectors: np.ndarray) -> np.ndarray:
    """Return unit vectors (.., 3) as uint16 (.., 2) within 0.004 degrees (Cigolle 2014); (0, 0, 1) for NaN.

    The sphere is projected onto the octahedron |x| + |y| + |z| = 1 and unfolded to the square from -1 to 1.
    """
    known = np.isfinite(vectors).all(axis=-1, keepdims=True)
    x, y, z = np.moveaxis(np.where(known, vectors, (0.0, 0.0, 1.0)).astype(float), -1, 0)
    length = np.maximum(np.abs(x) + np.abs(y) + np.abs(z), 1e-12)
    square = np.stack([x, y], axis=-1) / length[..., None]
    folded = (1.0 - np.abs(square[..., ::-1])) * np.where(square >= 0.0, 1.0, -1.0)
    square = np.where((z < 0.0)[..., None], folded, square)
    return np.rint((square + 1.0) * 32767.5).astype(np.uint16)


def confidence_codes(confidence: np.ndarray) -> np.ndarray:
    """Return confidence in 0..1 as uint8, in steps of 1/254; NO_CONFIDENCE for NaN."""
    known = np.isfinite(confidence)
    codes = np.rint(np.clip(np.where(known, confidence, 0.0), 0.0, 1.0) * 254.0)
    return np.where(known, codes, NO_CONFIDENCE).astype(np.uint8)


def scaled_codes(values: np.ndarray) -> tuple[np.ndarray, tuple[float, float]]:
    """Return finite values as uint16, 1 the lowest and 65535 the highest, NO_DEPTH where NaN; lowest and highest."""
    known = np.isfinite(values)
    low, high = (float(values[known].min()), float(values[known].max())) if known.any() else (0.0, 0.0)
    scale = 65534.0 / (high - low) if high > low else 0.0
    codes = 1.0 + np.rint((np.where(known, values, low).astype(float) - low) * scale)
    return np.where(known, codes, NO_DEPTH).astype(np.uint16), (low, high)
