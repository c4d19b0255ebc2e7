"""Collect what the inputs view shows of a capture besides pictures: geometry, lights, warnings, the estimated mask."""

import base64
from typing import Any

import numpy as np

from glint.storage.edits.models import Changes
from glint.storage.errors import InputError
from glint.storage.export.image_files import encode_png
from glint.storage.footage.images import image_size
from glint.storage.inputs.markup import position_error
from glint.storage.inputs.masks_and_truth import read_mask
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.review.pictures import first_frame, stored_geometry, surveyed_frame
from glint.tasks.review.stored import mask_region, saved_records
from glint.tasks.review.summary import Records, summary_of
from glint.tasks.stages.frame_parts import check_camera, check_light_source, check_region, check_spheres

PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
"""First bytes of a PNG."""


def capture_inputs(context: CaptureContext) -> dict[str, Any]:
    """Return the inputs of a capture as JSON values: as the catalogue or a person gives them, and as the last run used
    them (`used`, None before the first run).

    Lengths in pixels of the full frame, y down; lights: unit vectors by frame, x right, y up, z towards the camera,
    None where the frame was rejected.

    Raises:
        InputError: the video cannot be read; StoreError: the store cannot be read.
    """
    capture, saved = context.capture, saved_records(context)
    geometry, height_width = stored_geometry(context), first_frame(context).shape
    given = capture.model_dump(mode="json", include={"spheres", "region", "camera", "pixel_size", "pose"})
    used = None
    if geometry is not None:
        used = {
            "spheres": [
                {"x": sphere.x, "y": sphere.y, "radius": sphere.radius, "centre_sd": sphere.centre_sd}
                for sphere in geometry.spheres
            ],
            "region": geometry.region.model_dump(),
            "pixel_size": geometry.pixel_size,
        }
    summary = summary_of(saved)
    return {
        "frame_size": [int(height_width[1]), int(height_width[0])],
        "frames": frame_count(saved) or 1,
        "given": given | {"mask": capture.mask is not None, "lights": capture.lights is not None},
        "used": used,
        "stages": sorted(saved),
        "warnings": [warning.to_json() for warning in summary.warnings],
        "verdict": None if summary.verdict is None else str(summary.verdict),
        "lights": _light_rows(context) if "lights" in saved else [],
    }


def mask_picture(context: CaptureContext, edited: np.ndarray | None = None) -> bytes:
    """Return the mask as PNG of the full frame, white on black.

    Arguments and errors are those of `mask_in_use`.
    """
    return encode_png(mask_in_use(context, edited))


def mask_in_use(context: CaptureContext, edited: np.ndarray | None = None) -> np.ndarray:
    """Return the mask (H, W) bool of the full frame; empty before the first run where none is given.

    edited: the mask (H, W) bool that a person painted, None: the one that the last run used, else the catalogue's.

    Raises:
        InputError: the given mask cannot be read; the frames have another size than the painted mask or than at the
            last run; StoreError: the store cannot be read.
    """
    if edited is not None:
        check_mask(edited.shape, first_frame(context).shape)
        return edited
    saved = saved_records(context)
    shape = (surveyed_frame if "mask" in saved else first_frame)(context).shape
    whole = np.zeros(shape, bool)
    address, region = context.file("mask"), context.capture.region
    if "mask" in saved:
        used = mask_region(saved)
        whole[used.rows, used.columns] = context.load("mask").read("mask")
    elif address is not None:
        given = read_mask(address, shape, region)
        rows, columns = (region.rows, region.columns) if region is not None else (slice(None), slice(None))
        whole[rows, columns] = given
    return whole


def mask_to_replace(context: CaptureContext, edited: np.ndarray | None = None) -> np.ndarray:
    """Return the mask that `mask_in_use` does, empty where it cannot be used: a person makes another one in its place.

    Raises:
        InputError: the video cannot be read; StoreError: the store cannot be read.
    """
    try:
        return mask_in_use(context, edited)
    except InputError:
        return np.zeros(first_frame(context).shape, bool)


def check_changes(changes: Changes, context: CaptureContext) -> None:
    """Check that what a person drew lies in the capture's frames, and does not contradict the catalogue.

    Raises:
        InputError: a mask of another size than the full frame's, a camera's matrix that is not in pixels, or a sphere,
            region or mark beyond the frames; spheres beside known lights; or the video cannot be read.
    """
    check_light_source(changes.spheres or (), context.file("lights"))
    check_fit(changes, first_frame(context).shape, frame_count(saved_records(context)))


def check_fit(changes: Changes, size: tuple[int, int], count: int | None) -> None:
    """Check that what a person drew lies in the frames.

    size: rows and columns of the full frame; count: number of frames, None: not known yet.

    Raises:
        InputError: a mask of another size than the full frame's, a camera's matrix that is not in pixels, or a sphere,
            region or mark beyond the frames.
    """
    if changes.mask is not None:
        check_mask(changes.mask.shape, size)
    check_spheres([Sphere(item.x, item.y, item.radius) for item in changes.spheres or ()], size)
    check_camera(changes.camera, size)
    if changes.region is not None:
        check_region(changes.region, size)
    for number, mark in enumerate(changes.marks or (), 1):
        if reason := position_error(mark, size, count):
            raise InputError(
                f"mark {number} at frame {mark.frame}, x {mark.x:g}, y {mark.y:g} {reason}", "move or remove it"
            )


def check_mask(shape: tuple[int, ...], size: tuple[int, int]) -> None:
    """Check that the shape of a mask that a person painted is the size (rows, columns) of the full frame.

    Raises:
        InputError: it is another.
    """
    if shape != size:
        raise InputError(
            f"the painted mask is {shape[1]} x {shape[0]}", f"it must have the frame's {size[1]} x {size[0]}"
        )


def check_mask_head(mask: str, context: CaptureContext) -> None:
    """Check the size that the head of a painted mask states, before decoding takes memory for it.

    mask: the base64 of a PNG.

    Raises:
        InputError: it is no PNG, or has another size than the full frame; or the video cannot be read.
    """
    try:
        data = base64.b64decode(mask, validate=True)
    except ValueError as error:  # binascii.Error is one, and other letters than those of ASCII are another
        raise InputError(f"the mask is not base64 ({error})", "send the base64 of a PNG") from error
    if not data.startswith(PNG_SIGNATURE):
        raise InputError("the mask is no PNG", "send the base64 of a PNG")
    check_mask(image_size(data, "the mask"), first_frame(context).shape)


def frame_count(saved: Records) -> int | None:
    """Return the number of frames, None before they were read."""
    frames = saved.get("frames", ("", {}))[1].get("counts", {}).get("frames")
    return int(frames) if frames else None


def _light_rows(context: CaptureContext) -> list[list[float] | None]:
    lights = context.load("lights").read("lights")
    return [[round(float(value), 3) for value in row] if np.isfinite(row[0]) else None for row in lights]
