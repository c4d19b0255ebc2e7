"""Keyframes to mark highlights on: which frames, and how they are drawn to read positions from."""

import cv2
import numpy as np

MINOR, MAJOR = 10, 50
"""Pixels between the lines of the grid, and between those that are numbered."""


def keyframes(half_vectors: np.ndarray, lit: np.ndarray, count: int = 8) -> list[int]:
    """Frames spread over the lamp's sweep, in order, among those that show most highlights.

    half_vectors (T, 3), NaN where the frame was rejected; lit (T,) lit pixels of the object. Each further frame is the
    one whose half vector lies farthest from those taken.
    """
    usable = np.flatnonzero(np.isfinite(half_vectors[:, 0]) & (lit > 0))
    if len(usable) == 0:
        return []
    usable = usable[lit[usable] >= np.median(lit[usable])]
    taken = [int(usable[lit[usable].argmax()])]
    distance = np.linalg.norm(half_vectors[usable] - half_vectors[taken[0]], axis=1)
    while len(taken) < min(count, len(usable)):
        farthest = int(usable[distance.argmax()])
        taken.append(farthest)
        distance = np.minimum(distance, np.linalg.norm(half_vectors[usable] - half_vectors[farthest], axis=1))
    return sorted(taken)


def draw_keyframe(frame: np.ndarray, number: int, left: int, top: int, width: int = 1400) -> np.ndarray:
    """Picture (h, w, 3) uint8 of a region's frame (H, W), enlarged, with a grid that counts the full frame's pixels.

    left, top: column and row of the region's first pixel in the full frame. A pixel's number is that of its centre, as
    the markup file wants it.
    """
    zoom = max(2, round(width / frame.shape[1]))
    grey = frame if frame.dtype == np.uint8 else (frame // 257).astype(np.uint8)
    big = cv2.resize(grey, None, fx=zoom, fy=zoom, interpolation=cv2.INTER_NEAREST)
    picture = cv2.cvtColor(big, cv2.COLOR_GRAY2RGB)
    margin = 46
    canvas = np.full((picture.shape[0] + margin + 26, picture.shape[1] + margin, 3), 255, np.uint8)
    for axis, start in ((1, left), (0, top)):
        for position in range(start - start % -MINOR, start + frame.shape[axis], MINOR):
            at = (position - start) * zoom + zoom // 2
            line = np.s_[:, at] if axis == 1 else np.s_[at, :]
            strength = 0.45 if position % MAJOR == 0 else 0.18
            picture[line] = (picture[line] * (1 - strength) + np.array((255, 190, 60)) * strength).astype(np.uint8)
    canvas[26 + margin - 20 : 26 + margin - 20 + picture.shape[0], margin:] = picture
    for position in range(left - left % -MAJOR, left + frame.shape[1], MAJOR):
        _write(canvas, str(position), margin + (position - left) * zoom, 44)
    for position in range(top - top % -MAJOR, top + frame.shape[0], MAJOR):
        _write(canvas, str(position), 4, 26 + margin - 20 + (position - top) * zoom + zoom // 2 + 5)
    _write(canvas, f"frame {number}: x to the right, y down, pixels of the full frame", margin, 18)
    return canvas


def _write(picture: np.ndarray, text: str, x: int, y: int) -> None:
    cv2.putText(picture, text, (x, y), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (20, 20, 20), 1, cv2.LINE_AA)
