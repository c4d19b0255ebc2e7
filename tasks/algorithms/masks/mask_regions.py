"""Regions of an estimated mask: components that belong together, gaps that close, holes that are glass or openings."""

import cv2
import numpy as np
from scipy import ndimage

from glint.tasks.algorithms.geometry.connected_parts import largest_part
from glint.tasks.algorithms.geometry.distance import depth_inside
from glint.tasks.algorithms.silhouettes.mirror_images import MirrorAxis, mirror_image, symmetric_body

JOIN_SHARE, CLOSE_SHARE, BRIDGE_SHARE = 0.1, 0.07, 0.12
"""Gaps that are closed, as shares of the square root of the object's area: between components of one object, between
pixels of its contour, and those that only a contour along most of the region may bridge."""
THIN_SHARE = 0.015
"""Half the width of a thin line, likewise: glass beyond a line is still the object, while a handle is thicker."""
MIN_HOLE_RATIO = 0.015
"""Area of the smallest hole, relative to the object's."""
MAX_MOUTH_SHARE = 0.33
"""Share of a region's contour that may be open for it to be bridged: a concavity of the silhouette is more open."""
MIN_BRIDGED_RATIO = 0.003
"""Area of the smallest bridged region, relative to the object's."""
MIN_SEED_RATIO = 0.1
"""Flashing pixels of a further component, relative to the component with the most."""
MIN_MOMENT_RATIO = 0.1
"""Different frames in which the pixels of a further component flash most, likewise."""
MAX_ALONG_EDGE_RATIO = 0.3
"""Pixels of a component on the frame's edge, relative to the square root of its area, from which it lies along it."""
EDGE_PENALTY = 0.1
"""Weight of the flashing pixels of a component along the frame's edge: a light or an arm in the picture."""
MIN_OPENING_RATIO, MIN_OPENING_PX = 0.002, 12
"""Area of the smallest opening, relative to the object's and in pixels."""
MIN_HANDLE_RATIO = 0.02
"""Area of the smallest handle with its opening, relative to the object's."""
MIN_THICKNESS_PX = 2
"""Least thickness of a handle."""
GAP_SHARE = 0.02
"""Half the width of a gap across which parts of a mask are one object, as a share as above: a line that was missed."""
MIN_OBJECT_RATIO = 0.3
"""Area of a further object relative to the largest part. The foot of a wine glass whose stem is missing has less."""
SPECK = np.ones((3, 3))
"""What is narrower than this is noise, or the contour's."""


def main_components(differing: np.ndarray, flashing: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Return those components of `differing` (H, W) bool that hold most of the `flashing` pixels (H, W) bool.

    moment: (H, W) int, frame of a pixel's largest flash. Some part of a glass object flashes under nearly every light;
    where a lamp or an arm passes through the picture, all flashes fall in the few frames that show it.
    """
    components, count = ndimage.label(closed(differing, JOIN_SHARE * _root_area(flashing)))
    if count == 0:
        return differing
    seeded = flashing & differing
    seeds = np.bincount(components.ravel(), seeded.ravel(), minlength=count + 1)
    areas = np.bincount(components.ravel(), minlength=count + 1)
    along_edge = np.bincount(_frame_edge(components), minlength=count + 1)
    seeds = np.where(along_edge > MAX_ALONG_EDGE_RATIO * np.sqrt(areas), EDGE_PENALTY * seeds, seeds)
    pairs = np.unique(np.stack([components[seeded], moment[seeded]]), axis=1)
    moments = np.bincount(pairs[0], minlength=count + 1)
    is_main = (seeds >= MIN_SEED_RATIO * seeds.max()) & (moments >= MIN_MOMENT_RATIO * moments[seeds.argmax()])
    return differing & np.isin(components, np.flatnonzero(is_main))


def large_components(mask: np.ndarray, min_area_ratio: float = 0.15) -> np.ndarray:
    """Return the largest component of a mask (H, W) bool, and those of at least `min_area_ratio` of its area."""
    components, count = ndimage.label(mask)
    if count == 0:
        return mask
    areas = np.bincount(components.ravel())[1:]
    return np.isin(components, 1 + np.flatnonzero(areas >= min_area_ratio * areas.max()))


def object_sizes(mask: np.ndarray, counted: np.ndarray) -> list[int]:
    """Return the pixels of those separate parts of a mask (H, W) bool that may each be an object, largest first.

    Small parts beside a large one belong to it: the masks of glass often fall apart.

    counted: (H, W) bool, pixels that count, as those beside the spheres; the others only join what lies around them.
    """
    parts, _ = ndimage.label(closed(mask, GAP_SHARE * _root_area(mask)))
    sizes = sorted((int(size) for size in np.bincount(parts[mask & counted], minlength=1)[1:]), reverse=True)
    return [size for size in sizes if size >= MIN_OBJECT_RATIO * sizes[0]]


def thick_components(mask: np.ndarray, min_depth: float) -> np.ndarray:
    """Return those components of a mask (H, W) bool in which a pixel lies at least `min_depth` pixels from outside."""
    components, _ = ndimage.label(mask)
    return mask & np.isin(components, components[depth_inside(mask) >= min_depth])


def without_specks(mask: np.ndarray, min_area: float = 2.0, *, diagonal: bool = True) -> np.ndarray:
    """Return a mask (H, W) bool without its components of fewer than `min_area` pixels.

    diagonal: whether pixels connect across their corners too.
    """
    components, _ = ndimage.label(mask, ndimage.generate_binary_structure(2, 2 if diagonal else 1))
    return mask & (np.bincount(components.ravel())[components] >= min_area)


def filled(differing: np.ndarray, share: float) -> np.ndarray:
    """Return `differing` (H, W) bool with gaps up to `share` closed and with the holes that are glass.

    A hole is glass if it is small, or if only a thin line separates it from the surroundings: the rim of a foot, the
    edge of a wall.
    """
    mask = closed(differing, share * _root_area(differing))
    around, open_labels = _around_solid(differing, mask)
    holes, _ = ndimage.label(~mask)
    outside, area = set(np.unique(_frame_edge(holes))), int(mask.sum())
    for number, window in enumerate(ndimage.find_objects(holes), 1):
        if number in outside:
            continue
        hole = holes[window] == number
        size = int(hole.sum())
        if size < MIN_HOLE_RATIO * area or np.isin(around[window][hole], open_labels).mean() > 0.5:
            mask[window] |= hole
            area += size
    return mask


def bridged(differing: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Return the regions beside the mask that thin lines of differing pixels, with gaps, enclose; all (H, W) bool."""
    root_area = _root_area(mask)
    wide = closed(differing, BRIDGE_SHARE * root_area)
    around, open_labels = _around_solid(differing, mask)
    regions, _ = ndimage.label(wide & ~mask)
    result = np.zeros_like(mask)
    for number, window in enumerate(ndimage.find_objects(regions), 1):
        grown = tuple(slice(max(0, side.start - 2), side.stop + 2) for side in window)
        region = regions[grown] == number
        rim = ndimage.binary_dilation(region) & ~region
        is_large = region.sum() >= MIN_BRIDGED_RATIO * differing.sum()
        is_enclosed = (rim & ~wide[grown]).sum() < MAX_MOUTH_SHARE * rim.sum()
        if is_large and is_enclosed and np.isin(around[grown][region], open_labels).mean() > 0.5:
            result[grown] |= region
    return result


def handle_openings(mask: np.ndarray, is_like_table: np.ndarray, axis: MirrorAxis) -> np.ndarray:
    """Return the pixels (H, W) bool of a mask (H, W) bool that are openings of a handle, which show the table.

    The clear wall of a vessel does so too. But an opening lies in what stands off on one side of the body, which is
    symmetric about its axis, and the handle encloses it.

    is_like_table: (H, W) bool, pixels that follow the light as the table does. axis: of the body.
    """
    is_like_table = ndimage.binary_opening(mask & is_like_table, SPECK)
    min_area = max(MIN_OPENING_PX, MIN_OPENING_RATIO * float(mask.sum()))
    if not without_specks(is_like_table, min_area, diagonal=False).any():
        return np.zeros_like(mask)
    body = symmetric_body(mask, mirror_image(mask, axis))
    if body is None:
        return np.zeros_like(mask)
    handle = largest_part(ndimage.binary_opening(mask & ~body, SPECK))
    if handle.sum() < MIN_HANDLE_RATIO * mask.sum():
        return np.zeros_like(mask)
    components, _ = ndimage.label(without_specks(is_like_table & handle, min_area, diagonal=False))
    at_rim = components[~ndimage.binary_erosion(mask, SPECK, iterations=MIN_THICKNESS_PX)]
    return np.asarray((components > 0) & ~np.isin(components, at_rim))


def closed(mask: np.ndarray, radius: float) -> np.ndarray:
    """Close the gaps of a mask (H, W) bool that are narrower than twice `radius` pixels."""
    disc, margin = _disc(radius), round(radius) + 2
    padded = np.pad(mask.astype(np.uint8), 2 * margin)
    inner = slice(2 * margin, -2 * margin)
    return cv2.morphologyEx(padded, cv2.MORPH_CLOSE, disc)[inner, inner] > 0


def _around_solid(differing: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return components (H, W) of what remains of the picture without the thick parts, and those at its edge."""
    radius = THIN_SHARE * _root_area(mask)
    solid = cv2.morphologyEx(differing.astype(np.uint8), cv2.MORPH_OPEN, _disc(radius)) > 0
    around, _ = ndimage.label(~solid)
    at_edge = np.unique(_frame_edge(around))
    return around, at_edge[at_edge > 0]


def _disc(radius: float) -> np.ndarray:
    size = 2 * max(1, round(radius)) + 1
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))


def _root_area(mask: np.ndarray) -> float:
    """Return the square root of the mask's area, at least 5 pixels."""
    return float(np.sqrt(max(int(mask.sum()), 25)))


def _frame_edge(image: np.ndarray) -> np.ndarray:
    """Return the values (N,) along the edge of an image (H, W)."""
    return np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
