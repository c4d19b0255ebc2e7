"""Collect a pixel's history: the frames in which it was lit, and the candidates from its highlights."""

from dataclasses import replace
from typing import Any

import numpy as np

from glint.storage.errors import InputError
from glint.storage.export.report import code_names
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.review.pictures import stored_geometry
from glint.tasks.review.stored import mask_region, saved_records
from glint.tasks.stages.capture_geometry import OBJECT
from glint.tasks.stages.frames import open_frames

MAX_FRAMES = 500
"""Frames that are listed, the brightest ones of more."""


def pixel_history(context: CaptureContext, x: int, y: int) -> dict[str, Any]:
    """Return the frames in which a pixel (of the full frame) was lit while the light was known, and its candidates.

    Levels are those of the video; a candidate's normal is a unit vector, x right, y up, z towards the camera; `spread`
    in degrees, None for a candidate of a single frame; `chosen`: the labels take it as the outer surface.

    Raises:
        InputError: the pixel lies outside the region, or nothing has run yet; StoreError: the store cannot be read.
    """
    saved, geometry = saved_records(context), stored_geometry(context)
    if geometry is None or "thresholds" not in saved:
        raise InputError("highlights are not known before the first run", "run the capture")
    row, column = replace(geometry, region=mask_region(saved)).row_and_column(x, y)
    place = slice(row, row + 1), slice(column, column + 1)
    levels = open_frames(context).read(OBJECT, slice(None), *place)[:, 0, 0].astype(int)
    threshold = int(_at(context, "thresholds", "thresholds", row, column))
    has_light = np.isfinite(context.load("lights").read("half_vectors")[:, 0])
    lit = np.flatnonzero((levels > threshold) & has_light[: len(levels)])
    listed = np.sort(lit[np.argsort(-levels[lit], kind="stable")[:MAX_FRAMES]])
    return {
        "x": x,
        "y": y,
        "in_mask": bool(_at(context, "mask", "mask", row, column)),
        "threshold": threshold,
        "count": len(lit),
        "frames": [{"frame": int(frame), "level": int(levels[frame])} for frame in listed],
        "candidates": _candidates(context, row, column) if "clusters" in saved else [],
        "normal": _normal(context, row, column) if "labels" in saved else None,
    }


def _candidates(context: CaptureContext, row: int, column: int) -> list[dict[str, Any]]:
    normals, weight, spread, count, shading = (
        _at(context, "clusters", name, slice(None), row, column)
        for name in ("normals", "weight", "spread", "count", "shading")
    )
    labels = None
    if "labels" in saved_records(context):
        labels = _at(context, "labels", "labels", slice(None), row, column)
    return [
        {
            "normal": [round(float(value), 3) for value in normals[number]],
            "weight": round(float(weight[number]), 2),
            "spread": round(float(np.degrees(spread[number])), 2) if np.isfinite(spread[number]) else None,
            "frames": int(count[number]),
            "shading": round(float(shading[number]), 2),
            "chosen": None if labels is None else bool(labels[number] == 1),
        }
        for number in np.flatnonzero(np.isfinite(normals[:, 0]))
    ]


def _normal(context: CaptureContext, row: int, column: int) -> dict[str, Any] | None:
    normal = _at(context, "labels", "normals", row, column)
    if not np.isfinite(normal).all():
        return None
    names = code_names(context.load("labels").record.get("provenance"))
    code = int(_at(context, "labels", "provenance", row, column))
    return {
        "normal": [round(float(value), 3) for value in normal],
        "confidence": round(float(_at(context, "labels", "confidence", row, column)), 3),
        "provenance": names.get(code, f"code {code}"),
    }


def _at(context: CaptureContext, stage: str, name: str, *index: int | slice) -> np.ndarray:
    """Read a part of an array that a stage saved."""
    array: Any = context.load(stage).arrays[name]
    return np.asarray(array[index])
