"""Flat faces among accepted normals: connected regions whose pixels share one normal.

All pixels of a flat face show the light in the same frames, and so have the same candidate to a fraction of a degree,
over an area in which a curved surface would turn by many degrees. A face is accepted if it is flat over several times
the length on which a surface as curved as the object leaves the tolerance.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy import ndimage

from glint.tasks.algorithms.geometry.convex_hull import convex_hull
from glint.tasks.algorithms.geometry.distance import depth_inside
from glint.tasks.algorithms.geometry.vectors import angles, unit

FLAT_DEG = 1.0
"""Degrees within which normals count as equal: twice the error of a candidate of two thousand frames."""
FACE_DEG = 1.5
"""Degrees from a face's normal within which a connected pixel belongs to it."""
WINDOW_INRADII, MIN_WINDOW_PX = 0.06, 2
"""Radius in inradii of the window whose normals equal the one in its middle, and at least, in pixels; a surface as
curved as the object turns by 3.4 degrees on that length."""
WINDOW_SAMPLES = 12
"""Pixels along the window's radius that are compared at most; of more, every n-th."""
MIN_WINDOW_SHARE = 0.6
"""Share of the window's pixels that have the same normal, since marks of other paths leave holes in a face."""
MAX_SCATTER_DEG = 2.0
"""Eightieth percentile of the angles to the median normal of a region in which neighbours are equal."""
MIN_FACE_INRADII = 0.075
"""Inradius of the smallest face, in those of the object: 4 times the length on which a surface as curved as the object
turns by FLAT_DEG."""
MIN_FACE_PX = 4.5
"""Inradius in pixels of the smallest face."""
MIN_LIGHTS = 1.4
"""Lights at a distance from one another that a face must have shown: a single light is seen in one and the same half
vector all over the highlight, whatever the surface."""
SAME_FACE_DEG = 4.0
"""Degrees up to which two regions are parts of one face: other light paths divide it and hide some of its frames."""
MAX_FOREIGN_SHARE = 0.25
"""Share of accepted normals within a face's convex hull that may contradict it."""


@dataclass(frozen=True, slots=True)
class Face:
    """A flat face: its unit normal (3,), its observed pixels (H, W) bool, and their convex hull (H, W) bool."""

    normal: np.ndarray
    pixels: np.ndarray
    hull: np.ndarray


def find_faces(accepted: np.ndarray, lights: np.ndarray, mask: np.ndarray, inradius: float) -> list[Face]:
    """Find the flat faces of accepted normals, largest first.

    Args:
        accepted: (H, W, 3) unit, camera frame, NaN where there is none.
        lights: (H, W), weights of their clusters: how many lights at a distance from one another they come from.
        mask: (H, W) bool.
        inradius: of the mask, in pixels.
    """
    values = np.where(mask[..., None], accepted, np.nan).astype(np.float32)
    radius = max(MIN_WINDOW_PX, round(WINDOW_INRADII * inradius))
    flat = flat_pixels(values, radius, float(np.cos(np.radians(FLAT_DEG))), MIN_WINDOW_SHARE)
    faces: list[Face] = []
    parts, count = ndimage.label(flat & ~_at_crease(values, flat))
    sizes = np.bincount(parts.ravel(), minlength=count + 1)[1:]
    windows, taken = ndimage.find_objects(parts), np.zeros_like(mask)
    for part in np.argsort(-sizes):
        window = windows[part]
        core = parts[window] == part + 1
        normal = unit(np.median(values[window][core], axis=0))
        scatter = np.percentile(angles(values[window][core], normal), 80)
        if scatter > MAX_SCATTER_DEG or np.median(lights[window][core]) < MIN_LIGHTS:
            continue
        rows, region = _connected_rows(values, normal, parts, part + 1, window[0])
        region &= ~taken[rows]
        if depth_inside(region).max() < max(MIN_FACE_INRADII * inradius, MIN_FACE_PX):
            continue
        pixels = np.zeros_like(mask)
        pixels[rows] = region
        taken |= pixels
        faces = _with_region(faces, normal, pixels, values, mask)
    return sorted(faces, key=lambda face: -int(face.pixels.sum()))


def _at_crease(normals: np.ndarray, flat: np.ndarray) -> np.ndarray:
    """Return the flat pixels (H, W) bool that touch one with another normal (H, W, 3), as two faces do."""
    result = np.zeros_like(flat)
    for axis in (0, 1):
        first, second = (np.moveaxis(array, axis, 0) for array in (normals, flat))
        differs = (angles(first[1:], first[:-1]) > 2.0 * FLAT_DEG) & second[1:] & second[:-1]
        np.moveaxis(result, axis, 0)[1:] |= differs
        np.moveaxis(result, axis, 0)[:-1] |= differs
    return result


def _with_region(
    faces: list[Face], normal: np.ndarray, pixels: np.ndarray, values: np.ndarray, mask: np.ndarray
) -> list[Face]:
    """Return the faces with one more region: as a part of a face with its normal, or as a face of its own."""
    for number, face in enumerate(faces):
        if angles(face.normal, normal) < SAME_FACE_DEG:
            merged = face.pixels | pixels
            hull = convex_hull(merged) & mask
            common = unit(face.normal * face.pixels.sum() + normal * pixels.sum())
            known = hull & np.isfinite(values[..., 0])
            if (angles(values[known], common) > FACE_DEG + SAME_FACE_DEG).mean() < MAX_FOREIGN_SHARE:
                return [*faces[:number], Face(common, merged, hull), *faces[number + 1 :]]
    return [*faces, Face(normal, pixels, convex_hull(pixels) & mask)]


def _connected_rows(
    values: np.ndarray, normal: np.ndarray, parts: np.ndarray, part: int, rows: slice
) -> tuple[slice, np.ndarray]:
    """Return rows of an image, and which of their pixels (h, W) bool have a normal and are connected to a part.

    All such pixels of the image lie in these rows: the whole image for each of thousands of small parts would take a
    time that grows with the square of its size.

    values: (H, W, 3) float32. parts: (H, W), the number of each pixel's part. rows: of the part.
    """
    height, cosine = len(values), np.cos(np.radians(FACE_DEG))
    while True:
        region = _touching(values[rows] @ normal.astype(np.float32) > cosine, parts[rows] == part)
        is_open_above, is_open_below = rows.start > 0 and region[0].any(), rows.stop < height and region[-1].any()
        if not (is_open_above or is_open_below):
            return rows, region
        more = rows.stop - rows.start
        rows = slice(
            max(0, rows.start - more) if is_open_above else rows.start,
            min(height, rows.stop + more) if is_open_below else rows.stop,
        )


def _touching(region: np.ndarray, core: np.ndarray) -> np.ndarray:
    """Return the pixels (H, W) bool of a region that are connected to its core."""
    parts, count = ndimage.label(region)
    touches = np.zeros(count + 1, bool)
    touches[parts[core & region]] = True
    return touches[parts]


@njit(cache=True, nogil=True)
def flat_pixels(normals: np.ndarray, radius: int, min_cosine: float, min_share: float) -> np.ndarray:
    """Return the pixels (H, W) bool around which most normals are the same as in the middle.

    normals: (H, W, 3), NaN where there is none; radius: of the window, a disc, in pixels; min_cosine: of the angle
    within which two normals are the same; min_share: of the disc's pixels (at most WINDOW_SAMPLES along its radius).
    """
    height, width, _ = normals.shape
    step = max(1, radius // WINDOW_SAMPLES)
    reach = radius // step * step
    result = np.zeros((height, width), np.bool_)
    for y in range(height):
        for x in range(width):
            centre = normals[y, x]
            if np.isnan(centre[0]):
                continue
            same, total = 0, 0
            for down in range(-reach, reach + 1, step):
                for right in range(-reach, reach + 1, step):
                    if down * down + right * right > radius * radius:
                        continue
                    total += 1
                    v, u = y + down, x + right
                    if v < 0 or v >= height or u < 0 or u >= width:
                        continue
                    normal = normals[v, u]
                    if centre[0] * normal[0] + centre[1] * normal[1] + centre[2] * normal[2] > min_cosine:
                        same += 1
            result[y, x] = same >= min_share * total
    return result
