"""A camera that moved a little: how far each frame is shifted, from what stands still (Lucas and Kanade 1981).

Ball and highlights are measured to a fraction of a pixel: a shift of one pixel turns normals by a degree or two. What
moves in a capture on a tripod is light; edges of background, table and object stay. So fine structure alone is
compared, and what differs much is left out.
"""

import cv2
import numpy as np

FINE = 3.0
"""Standard deviation in pixels of the structure that is compared: coarser brightness is the lamp's."""
ROUNDS = 6
FURTHEST = 16
"""Pixels of shift beyond which none is looked for."""


class Steadier:
    """Measures shifts against a reference picture (H, W) of the same view."""

    def __init__(self, reference: np.ndarray) -> None:
        self._reference = _fine(reference)
        down, right = np.gradient(self._reference)
        size = np.hypot(right, down)
        self._edges = size > max(float(np.percentile(size, 60.0)), 0.1)
        self._gradients = np.stack([right[self._edges], down[self._edges]], axis=-1)
        self._noise = 1.5 * float(np.median(np.abs(self._reference))) + 1.0

    def shift(self, picture: np.ndarray) -> np.ndarray:
        """How far (2,) the contents of a picture (H, W) lie to the right of and below the reference, in pixels."""
        picture = picture.astype(np.float32)
        total = self._nearest_pixels(_fine(picture))
        for _ in range(ROUNDS):
            off = (_fine(moved(picture, -total)) - self._reference)[self._edges]
            used = np.abs(off) < 3.0 * self._noise
            if used.sum() < 50:
                break
            gradients = self._gradients[used]
            normal = gradients.T @ gradients
            step = -np.linalg.solve(normal + 1e-6 * np.trace(normal) * np.eye(2), gradients.T @ off[used])
            total = total + np.clip(step, -1.0, 1.0)
            if np.abs(step).max() < 0.01:
                break
        return total

    def _nearest_pixels(self, fine: np.ndarray) -> np.ndarray:
        """The shift in whole pixels under which the middle of the reference is found again."""
        reach = min(FURTHEST, min(fine.shape) // 6)
        if reach < 1 or not self._edges.any():
            return np.zeros(2)
        limit = 3.0 * self._noise
        middle = self._reference[reach:-reach, reach:-reach]
        alike = cv2.matchTemplate(fine.clip(-limit, limit), middle.clip(-limit, limit), cv2.TM_CCOEFF_NORMED)
        row, column = np.unravel_index(int(alike.argmax()), alike.shape)
        return np.array([column - reach, row - reach], float)


def moved(picture: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """A picture (H, W) moved by (right, down) pixels; what comes in over its border repeats the border."""
    height, width = picture.shape
    matrix = np.array([[1.0, 0.0, shift[0]], [0.0, 1.0, shift[1]]])
    return cv2.warpAffine(picture, matrix, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)


def aligned(frames: np.ndarray, rounds: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """The median (H, W) float32 of some frames (T, H, W) moved onto each other, and the shift (T, 2) of each."""
    reference, shifts = np.median(frames, axis=0).astype(np.float32), np.zeros((len(frames), 2))
    for _ in range(rounds):
        steadier = Steadier(reference)
        shifts = np.array([steadier.shift(frame) for frame in frames])
        steady = [moved(frame, -shift) for frame, shift in zip(frames, shifts, strict=True)]
        reference = np.median(steady, axis=0).astype(np.float32)
    return reference, shifts


def wander(shifts: np.ndarray) -> float:
    """Pixels within which the middle nine tenths of shifts (T, 2) lie, the larger of x and y."""
    low, high = np.percentile(shifts, (5.0, 95.0), axis=0)
    return float((high - low).max())


def _fine(picture: np.ndarray) -> np.ndarray:
    picture = picture.astype(np.float32)
    smooth = cv2.GaussianBlur(picture, (0, 0), 0.8)
    return smooth - cv2.GaussianBlur(picture, (0, 0), FINE)
