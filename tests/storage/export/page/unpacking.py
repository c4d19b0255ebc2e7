"""What the page makes of packed arrays."""

import zlib

import numpy as np

from glint.storage.export.page.packing import (
    Part,
)


def unpacked(part: Part) -> np.ndarray:
    """The array of a part."""
    size = int(part.kind[1:]) // 8
    height, width, *rest = part.shape
    planes = np.frombuffer(zlib.decompress(part.data), np.uint8).reshape(-1, size, height, width)
    differences = sum(planes[:, octet].astype(np.uint64) << (8 * octet) for octet in range(size))
    values = np.cumsum(differences, axis=-1).astype(f"u{size}")
    return np.ascontiguousarray(values.transpose(1, 2, 0)).reshape(height, width, *rest)


def unfolded(codes: np.ndarray) -> np.ndarray:
    """Unit vectors of octahedral codes."""
    square = codes / 32767.5 - 1.0
    z = 1.0 - np.abs(square).sum(axis=-1)
    folded = (1.0 - np.abs(square[..., ::-1])) * np.where(square < 0, -1.0, 1.0)
    vectors = np.concatenate([np.where((z < 0)[..., None], folded, square), z[..., None]], axis=-1)
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
