"""Normals that the lights of a recording reach, and the nearest ones beyond them.

A surface whose normal is a half vector of the recording shows the light, and so does one whose normal is very near.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

CELLS = 200
"""Cells of a half-vector map along either axis; a cell in the middle is half a degree wide."""
MIN_COUNT = 3
"""Candidates in a cell from which it holds half vectors of the recording: single ones are noise."""
FLASH_DEG, BEYOND_DEG = 1.5, 7.0
"""Angle to a half vector of the recording up to which a normal is certain to flash, and from which it is well beyond
the lights' reach. Beyond 4 degrees hardly any normal flashes; dark ones are steeper than that by 7 on average."""
MAX_LENGTH = 0.9
"""Length of (n_x, n_y) up to which normals beyond the lights' reach are looked for: one in the image plane has slopes
without bounds."""


@dataclass(frozen=True, slots=True)
class SweptNormals:
    """Normals that the lights of a recording reach, on a square map of (n_x, n_y).

    flashing (CELLS, CELLS) bool: those certain to show the light. reached: those that are not well beyond the lights'
    reach. beyond (2, CELLS, CELLS): row and column of the nearest cell that is.
    """

    flashing: np.ndarray
    reached: np.ndarray
    beyond: np.ndarray

    @classmethod
    def of(cls, candidates: np.ndarray) -> "SweptNormals | None":
        """Return the normals reached by the lights that caused candidates (K, H, W, 3; NaN where there is none).

        True or false, candidates are half vectors of the recording. None without any.
        """
        present = candidates[np.isfinite(candidates[..., 0])]
        count = np.zeros((CELLS, CELLS), int)
        np.add.at(count, _cells(present), 1)
        centres = (np.arange(CELLS) + 0.5) / CELLS * 2.0 - 1.0
        x, y = np.meshgrid(centres, centres)
        normals = np.stack([x, y, np.sqrt(np.maximum(1.0 - x**2 - y**2, 0.0))], axis=-1)
        half_vectors = normals[count >= MIN_COUNT]
        if not half_vectors.size:
            return None
        chord = cKDTree(half_vectors).query(normals, distance_upper_bound=np.radians(BEYOND_DEG))[0]
        chord[x**2 + y**2 > 1.0] = np.inf
        reached = np.isfinite(chord)
        beyond = ndimage.distance_transform_edt(reached, return_distances=False, return_indices=True)
        return cls(chord <= np.radians(FLASH_DEG), reached, beyond)

    def flashes(self, normals: np.ndarray) -> np.ndarray:
        """Return whether normals (..., 3) are certain to show the light; not those that are NaN."""
        return np.asarray(self.flashing[_cells(normals)] & np.isfinite(normals[..., 0]))

    def nearest_beyond(self, normals: np.ndarray) -> np.ndarray:
        """Return the nearest normals (..., 3) well beyond what the lights reach, but no further out than MAX_LENGTH."""
        cells = _cells(normals)
        nearest = np.stack([self.beyond[1][cells], self.beyond[0][cells]], axis=-1)
        plane = np.where(self.reached[cells][..., None], (nearest + 0.5) / CELLS * 2.0 - 1.0, normals[..., :2])
        length = np.hypot(plane[..., 0], plane[..., 1])[..., None]
        plane = plane * np.minimum(1.0, MAX_LENGTH / np.maximum(length, 1e-6))
        return np.concatenate([plane, np.sqrt(1.0 - (plane**2).sum(axis=-1, keepdims=True))], axis=-1)


def _cells(normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows and columns (...) of the cells of normals (..., 3)."""
    column, row = (
        np.clip(((np.nan_to_num(normals[..., axis]) + 1.0) / 2.0 * CELLS).astype(int), 0, CELLS - 1) for axis in (0, 1)
    )
    return row, column
