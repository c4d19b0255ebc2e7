"""Pictures of a check: the frame with what was located in it, the coverage of the lights, the keyframes."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from glint.storage.catalogue.loading import Region
from glint.storage.export.image_files import write_pictures
from glint.storage.footage.luma import eight_bits
from glint.tasks.algorithms.lighting.coverage import coverage
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.figures.coverage_map import draw_coverage
from glint.tasks.figures.keyframe_picture import draw_keyframe

REGION_RGB, MASK_RGB, SPHERE_RGB, DOUBT_RGB = (255, 190, 60), (80, 220, 120), (90, 160, 255), (255, 60, 60)
DOUBTFUL, DOUBTFUL_SHARE = 0.05, 0.5
"""Doubt of a silhouette from which it is drawn as doubtful, and its share of the largest: doubt falls with the distance
from the piece that is to be corrected."""


def write_check_pictures(
    first_frame: np.ndarray,
    region: Region,
    spheres: Sequence[Sphere],
    *,
    mask: np.ndarray,
    doubt: np.ndarray,
    peak: np.ndarray,
    half_vectors: np.ndarray,
    keyframe_pictures: Mapping[int, np.ndarray],
    out: Path,
) -> tuple[Path, ...]:
    """Write coverage.png, overview.png, keyframe_<frame>.png and three pictures of the mask; return their paths.

    Those three, frame.png, brightest.png (peak level) and mask.png, have the frame's size: layers to correct the mask.

    first_frame: of the video, whole; mask, doubt and peak (H, W) of the region; half_vectors (T, 3); keyframe_pictures:
    frames (H, W) of the region by number.

    Raises:
        OutputError: the folder cannot be written.
    """
    pictures = {
        "coverage": draw_coverage(coverage(half_vectors), half_vectors),
        "overview": draw_overview(first_frame, region, spheres, mask, doubt),
        "frame": eight_bits(first_frame),
        "brightest": _placed(eight_bits(peak), region, eight_bits(first_frame)),
        "mask": _placed(mask.astype(np.uint8) * 255, region, np.zeros(first_frame.shape, np.uint8)),
    }
    for frame, picture in keyframe_pictures.items():
        pictures[f"keyframe_{frame:06d}"] = draw_keyframe(picture, frame, region.x, region.y)
    return write_pictures(out, pictures)


def write_failure_picture(frame: np.ndarray, region: Region | None, spheres: Sequence[Sphere], out: Path) -> Path:
    """Write overview.png of a capture that cannot be processed: a frame (H, W) with what is known of it; return it.

    Raises:
        OutputError: the folder cannot be written.
    """
    height, width = frame.shape
    whole = Region(x=0, y=0, width=width, height=height)
    return write_pictures(out, {"overview": draw_overview(frame, region or whole, spheres)})[0]


def draw_overview(
    frame: np.ndarray,
    region: Region,
    spheres: Sequence[Sphere],
    mask: np.ndarray | None = None,
    doubt: np.ndarray | None = None,
) -> np.ndarray:
    """Draw region, silhouette and spheres into a frame (H, W) uint8 or uint16; the picture (H, W, 3) uint8.

    The silhouette of the mask (H, W) bool is red where its doubt (H, W), both of the region, is at least DOUBTFUL, and
    half of the largest.
    """
    picture = cv2.cvtColor(eight_bits(frame), cv2.COLOR_GRAY2RGB)
    corner = (region.x + region.width - 1, region.y + region.height - 1)
    cv2.rectangle(picture, (region.x, region.y), corner, REGION_RGB, 1)
    if mask is not None and doubt is not None:
        _draw_silhouette(picture, region, mask, doubt)
    for sphere in spheres:
        centre = round(sphere.x), round(sphere.y)
        cv2.circle(picture, centre, round(sphere.radius), SPHERE_RGB, 1, cv2.LINE_AA)
        cv2.drawMarker(picture, centre, SPHERE_RGB, cv2.MARKER_CROSS, 8, 1)
    return picture


def _draw_silhouette(picture: np.ndarray, region: Region, mask: np.ndarray, doubt: np.ndarray) -> None:
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, contours, -1, MASK_RGB, 1, offset=(region.x, region.y))
    inside = picture[region.rows, region.columns]
    rim = (cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8)) > 0) & mask
    inside[rim & (doubt >= max(DOUBTFUL, DOUBTFUL_SHARE * float(doubt.max())))] = DOUBT_RGB


def _placed(image: np.ndarray, region: Region, frame: np.ndarray) -> np.ndarray:
    """Return a frame (H, W) with the region's image in its place."""
    picture = frame.copy()
    picture[region.rows, region.columns] = image
    return picture
