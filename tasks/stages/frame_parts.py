"""Parts of a frame: the rectangles of object and spheres, and whether what is given fits the frame."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glint.storage.catalogue.loading import Region
from glint.storage.catalogue.models import Camera
from glint.storage.errors import InputError
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.errors import MisplacedSphere
from glint.tasks.engine.stage_warning import StageWarning

MIN_REGION_PX = 8
"""Least width and height of a region: a narrower one holds no surface that turns."""
SHADED_REACH = 1.1
"""Half the side of the square around a sphere in which nothing counts as standing still, in radii."""
MIN_FOCAL_SHARE = 0.25
"""Least focal length by the frame's longer side: that of the widest lenses that keep lines straight."""

MIN_EXCHANGED_SHARE, MAX_MIDDLE_RATIO = 0.08, 0.25
"""Distance of a principal point from the frame's middle, by the frame's longer side, from which its coordinates may be
exchanged, and the distance that is left when they are put in order, by the one before."""


def around(mask: np.ndarray, margin: int) -> Region:
    """Return the rectangle around a mask (H, W) of the full frame, `margin` pixels wider, inside the frame."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    top, left = max(int(rows[0]) - margin, 0), max(int(columns[0]) - margin, 0)
    bottom = min(int(rows[-1]) + margin + 1, mask.shape[0])
    right = min(int(columns[-1]) + margin + 1, mask.shape[1])
    return Region(x=left, y=top, width=right - left, height=bottom - top)


def within(region: Region | None, size: tuple[int, int]) -> np.ndarray | None:
    """Return the pixels (H, W) bool of a region; None: no region is given."""
    if region is None:
        return None
    inside = np.zeros(size, bool)
    inside[region.rows, region.columns] = True
    return inside


def moving_parts(region: Region | None, spheres: Sequence[Sphere], size: tuple[int, int]) -> list[Region]:
    """Return the rectangles of object and spheres: their shading and reflections move with the light."""
    parts = [] if region is None else [region]
    for sphere in spheres:
        reach = SHADED_REACH * sphere.radius
        left, top = max(int(sphere.x - reach), 0), max(int(sphere.y - reach), 0)
        right, bottom = min(int(sphere.x + reach) + 1, size[1]), min(int(sphere.y + reach) + 1, size[0])
        parts.append(Region(x=left, y=top, width=right - left, height=bottom - top))
    return parts


def check_frame(size: tuple[int, int]) -> None:
    """Check that frames of `size` (rows, columns) in pixels can hold an object.

    Raises:
        InputError: they are too small.
    """
    if min(size) < MIN_REGION_PX:
        raise InputError(
            f"the frames are {size[1]} x {size[0]} pixels, too small for any object",
            f"export them in full size: at least {MIN_REGION_PX} pixels wide and high, and in practice some hundreds",
        )


def check_spheres(spheres: list[Sphere], size: tuple[int, int]) -> None:
    """Check that given spheres, in pixels, lie inside a frame of `size` (rows, columns).

    Raises:
        MisplacedSphere: one leaves it.
    """
    for sphere in spheres:
        # Whoever drew the circle may be off by a pixel.
        if not replace(sphere, radius=sphere.radius - 1.0).is_inside(size[1], size[0]):
            remedy = "correct it (pixels of the full frame, y down), or leave it out to have it found"
            if 0 <= sphere.x < size[1] and 0 <= sphere.y < size[0]:
                remedy = f"if the frame cuts the sphere off, record again with all of it in the frame; else {remedy}"
            raise MisplacedSphere(
                f"the sphere at ({sphere.x:.1f}, {sphere.y:.1f}) with radius {sphere.radius:.1f} leaves the frame of"
                f" {size[1]} x {size[0]} pixels",
                remedy,
            )


def check_light_source(spheres: Sequence[object], lights: str | None) -> None:
    """Check that a capture has no edited spheres beside known lights (their address): a catalogue cannot give both.

    Raises:
        InputError: it has.
    """
    if spheres and lights is not None:
        raise InputError(
            "a person drew spheres, and the catalogue names known lights",
            "take the edit of the spheres back, or remove `lights` from the catalogue",
        )


def region_text(region: Region) -> str:
    """Return what messages call a given region."""
    columns, rows = region.columns, region.rows
    return f"the region x {columns.start} to {columns.stop - 1}, y {rows.start} to {rows.stop - 1}"


def check_region(region: Region, size: tuple[int, int]) -> None:
    """Check that a given region, in pixels, lies inside a frame of `size` (rows, columns) and can hold an object.

    Raises:
        InputError: it leaves the frame, or is too small.
    """
    if region.x + region.width > size[1] or region.y + region.height > size[0]:
        raise InputError(
            f"{region_text(region)} leaves the frame of {size[1]} x {size[0]} pixels",
            "correct it in the catalogue (pixels of the full frame), or leave it out to have it found",
        )
    if min(region.width, region.height) < MIN_REGION_PX:
        raise InputError(
            f"{region_text(region)} is {region.width} x {region.height} pixels, too small for any object",
            f"make it at least {MIN_REGION_PX} pixels wide and high, or leave it out to have it found",
        )


def check_camera(camera: Camera | None, size: tuple[int, int]) -> None:
    """Check that the matrix of a camera, where one is given, is in pixels of a frame of `size` (rows, columns).

    Raises:
        InputError: it is in millimetres, or in units of the frame's size.
    """
    if camera is None:
        return
    focal = min(camera.matrix[0][0], camera.matrix[1][1])
    if focal < MIN_FOCAL_SHARE * max(size):
        raise InputError(
            f"the camera's matrix has a focal length of {focal:g}, too little for a frame of {size[1]} x {size[0]}"
            " pixels",
            "the matrix is in pixels: divide a focal length in mm by the sensor's width and multiply it by the frame's",
        )


def camera_warnings(camera: Camera | None, size: tuple[int, int]) -> list[StageWarning]:
    """Return a warning of a given camera whose principal point contradicts the frame.

    It lies outside the frame of `size` (rows, columns), or x and y are exchanged: with them in the other order it lies
    at the middle. One that lies elsewhere in the frame is that of a crop.
    """
    if camera is None:
        return []
    x, y = camera.matrix[0][2], camera.matrix[1][2]
    middle_x, middle_y = (size[1] - 1) / 2, (size[0] - 1) / 2
    offset, exchanged = math.hypot(x - middle_x, y - middle_y), math.hypot(y - middle_x, x - middle_y)
    place = f"the camera's principal point ({x:g}, {y:g})"
    if offset > MIN_EXCHANGED_SHARE * max(size) and exchanged < MAX_MIDDLE_RATIO * offset:
        message = (
            f"{place} is {offset:.0f} pixels beside the middle of the frame of {size[1]} x {size[0]}, where it lies"
            " with x and y exchanged: the matrix is [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] with cx along the width;"
            " correct it, unless the frame is a crop"
        )
    elif not (0 <= x < size[1] and 0 <= y < size[0]):
        message = (
            f"{place} lies outside the frame of {size[1]} x {size[0]} pixels: check that `camera` is the matrix of this"
            " resolution, and that a crop is subtracted from it"
        )
    else:
        return []
    turn = math.atan(offset / min(camera.matrix[0][0], camera.matrix[1][1]))
    return [StageWarning(message, "camera", math.degrees(turn))]
