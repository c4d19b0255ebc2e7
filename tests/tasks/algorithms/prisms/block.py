"""A right prism of glass with rounded edges, rendered from its planes, under either camera."""

from dataclasses import dataclass

import numpy as np

from glint.tasks.algorithms.geometry.vectors import to_camera, unit

SHAPE = (190, 170)
INVERSE_FOCAL = 1.0 / 450.0
CAMERA = np.array([[1 / INVERSE_FOCAL, 0.0, 84.5], [0.0, 1 / INVERSE_FOCAL, 94.5], [0.0, 0.0, 1.0]])
TURNS_DEG = (20.0, 80.0, 140.0, 200.0, 260.0, 320.0)
"""Directions of a hexagonal block's sides about its axis, 0 towards the camera."""


@dataclass(frozen=True)
class Block:
    """A block about the origin: its axis leans towards the camera by `slope` degrees, its sides face `turns`.

    lean: degrees by which the sides face its visible end, so that the other one is the larger.
    """

    slope: float = 35.0
    turns: tuple[float, ...] = TURNS_DEG
    radius: float = 58.0
    half_height: float = 48.0
    inverse_focal: float = 0.0
    shape: tuple[int, int] = SHAPE
    lean: float = 0.0

    @property
    def normals(self) -> np.ndarray:
        """Unit normals (N, 3) of its faces: the visible end, the other one, and the sides."""
        turns = np.radians(self.turns)
        out, up = np.cos(np.radians(self.lean)), np.sin(np.radians(self.lean))
        sides = np.column_stack([out * np.sin(turns), np.full(len(turns), up), out * np.cos(turns)])
        lean, upward = np.radians(self.slope), np.array([[0.0, 1.0, 0.0]])
        c, s = np.cos(lean), np.sin(lean)
        rotation = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        return np.asarray(np.concatenate([upward, -upward, sides]) @ rotation.T)

    @property
    def distances(self) -> np.ndarray:
        """Distances (N,) of its faces from the origin, as `normals`."""
        return np.array([self.half_height] * 2 + [self.radius] * len(self.turns))

    def render(self, rounding: float = 1.5) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return normals (H, W, 3), camera frame, z (H, W), and the nearest face's number (H, W); NaN, -1 beside it.

        rounding: length in pixels over which an edge bends, the soft minimum's.
        """
        rows, columns = np.indices(self.shape).astype(float)
        x, y = to_camera(columns, rows, self.shape[1], self.shape[0])
        rays = np.stack([-self.inverse_focal * x, -self.inverse_focal * y, np.ones_like(x)])
        along = np.einsum("nc,chw->nhw", self.normals, rays)
        depths = self.distances[:, None, None] - self.normals[:, 0, None, None] * x - self.normals[:, 1, None, None] * y
        depths = depths / along
        front = np.where(along > 0.0, depths, np.inf)
        mask = front.min(axis=0) > np.where(along < 0.0, depths, -np.inf).max(axis=0)
        share = np.exp(-(front - front.min(axis=0)) / rounding)
        normals = unit(np.einsum("nhw,nc->hwc", share, self.normals))
        numbers = np.where(mask, front.argmin(axis=0), -1)
        return np.where(mask[..., None], normals, np.nan), np.where(mask, front.min(axis=0), np.nan), numbers

    def contour(self) -> tuple[np.ndarray, np.ndarray]:
        """Return corners on the contour, of the visible end of a prism and of the hidden one, counter-clockwise."""
        turns = np.radians(self.turns)
        # Two neighbouring sides meet half-way between their directions.
        half = (np.roll(turns, -1) - turns) % (2.0 * np.pi) / 2.0
        reach = self.radius / np.cos(half)
        corners = np.column_stack([np.sin(turns + half), np.zeros(len(turns)), np.cos(turns + half)]) * reach[:, None]
        up = np.array([0.0, self.half_height, 0.0])
        upright = np.stack([corners + up, corners - up])
        c, s = np.cos(np.radians(self.slope)), np.sin(np.radians(self.slope))
        points = upright @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]).T
        images = points[..., :2] / (1.0 - self.inverse_focal * points[..., 2:])
        left, right = int(images[0, :, 0].argmin()), int(images[0, :, 0].argmax())
        # About the axis as seen from its visible end, corners run counter-clockwise in the image.
        count = len(turns)
        behind = [(right + step) % count for step in range((left - right) % count + 1)]
        before = [(left + step) % count for step in range((right - left) % count + 1)]
        return images[0, behind], images[1, before]


def seen_candidates(normals: np.ndarray, limit_deg: float = 42.0) -> np.ndarray:
    """Return normals (H, W, 3) where they are within so many degrees of the optical axis, NaN elsewhere."""
    return np.where((normals[..., 2] > np.cos(np.radians(limit_deg)))[..., None], normals, np.nan)


def shown(truth: np.ndarray, seed: int = 0) -> np.ndarray:
    """Candidates (2, H, W, 3): what is within the lights' reach with some noise, and light through the glass."""
    draw = np.random.default_rng(seed)
    mask = np.isfinite(truth[..., 0])
    true = seen_candidates(unit(truth + draw.normal(0.0, 0.01, truth.shape)))
    # Half vectors all over the lights' reach, so that they are known to have been there.
    around = draw.uniform(-0.65, 0.65, (*mask.shape, 2))
    stray = unit(np.concatenate([around, np.sqrt(1.0 - (around**2).sum(axis=-1, keepdims=True))], axis=-1))
    stray[(draw.random(mask.shape) > 0.15) | ~mask] = np.nan
    return np.stack([true, seen_candidates(stray)])
