"""The truth of a simulated capture as files: normals, depth, lights, mask, annotations, and the true model."""

import json
from pathlib import Path

import numpy as np
import trimesh
from scipy import ndimage

from glint.storage.export.image_files import write_png
from glint.tasks.algorithms.frames.keyframes import keyframes
from glint.tasks.algorithms.geometry.perspective import half_vectors_on_axis, view_vectors
from glint.tasks.algorithms.geometry.vectors import half_vectors_of
from glint.tasks.algorithms.simulation.options import CaptureOptions
from glint.tasks.algorithms.simulation.ray_tracing import RenderedTruth
from glint.tasks.algorithms.simulation.shapes import build_solids
from glint.tasks.simulation.scene_layout import FrameLayout, camera_of, mm_per_pixel, object_size, region_centre

MARKS_PER_KEYFRAME = 3
"""True highlights that are marked on a keyframe."""
MAX_MARK_ERROR_DEG = 1.0
"""Degrees between a marked pixel's half vector and that of the frame."""
MARK_SPACING_PX = 8
"""Pixels between the marks of a keyframe, along columns and rows."""


def write_truth(
    folder: Path, truth: RenderedTruth, lights: np.ndarray, layout: FrameLayout, options: CaptureOptions
) -> None:
    """Write truth/normals.npy, truth/depth.npy and truth/lights.npy, and mask.png, of the object's region.

    lights: (T, 3). The mask is enlarged or reduced by `options.mask_error`.
    """
    (folder / "truth").mkdir()
    normals, depth = (values[layout.region.rows, layout.region.columns] for values in (truth.normals, truth.depth))
    mask = np.isfinite(depth)
    np.save(folder / "truth" / "normals.npy", normals)
    # Under perspective depth counts from where a pixel covers one unit, the focal length from the camera.
    zero = np.float32(0.0 if options.focal is not None else np.nanmean(depth))
    np.save(folder / "truth" / "depth.npy", depth - zero)
    np.save(folder / "truth" / "lights.npy", lights)
    if options.mask_error > 0:
        mask = ndimage.binary_dilation(mask, iterations=options.mask_error)
    elif options.mask_error < 0:
        mask = ndimage.binary_erosion(mask, iterations=-options.mask_error)
    write_png(folder / "mask.png", mask)


def write_annotations(
    path: Path, highlight_vectors: np.ndarray, lights: np.ndarray, lit_pixels: np.ndarray, layout: FrameLayout
) -> None:
    """Write the annotations of a careful user: true highlights of the outer surface on some keyframes.

    highlight_vectors (H, W, 3): see `highlight_half_vectors`; lights (T, 3); lit_pixels (T,): of the region by frame.
    """
    half_vectors = half_vectors_of(lights)
    half_vectors[~(lights[:, 2] > 0)] = np.nan
    marks = []
    rows, columns = layout.region.rows, layout.region.columns
    for frame in keyframes(half_vectors, lit_pixels):
        error = np.linalg.norm(np.nan_to_num(highlight_vectors, nan=9.0) - half_vectors[frame], axis=-1)
        for _ in range(MARKS_PER_KEYFRAME):
            row, column = np.unravel_index(int(error.argmin()), error.shape)
            if error[row, column] > np.radians(MAX_MARK_ERROR_DEG):
                break
            marks.append(
                {"frame": frame, "x": float(column + columns.start), "y": float(row + rows.start), "kind": "true"}
            )
            # The next mark must lie elsewhere.
            near_rows = slice(max(0, row - MARK_SPACING_PX), row + MARK_SPACING_PX + 1)
            near_columns = slice(max(0, column - MARK_SPACING_PX), column + MARK_SPACING_PX + 1)
            error[near_rows, near_columns] = 9.0
    path.write_text(json.dumps(marks, indent=0) + "\n")


def highlight_half_vectors(truth: RenderedTruth, layout: FrameLayout, options: CaptureOptions) -> np.ndarray:
    """Return the half vectors (H, W, 3), as a distant camera would have them, that light each pixel of the region.

    For an orthographic camera they are the true normals of the outer surface.
    """
    camera, normals = camera_of(layout, options), truth.normals[layout.region.rows, layout.region.columns]
    if camera is None:
        return normals
    view = view_vectors(np.array(camera.matrix), normals.shape, layout.region.x, layout.region.y)
    return half_vectors_on_axis(normals, view)


def write_true_model(path: Path, shape: str, layout: FrameLayout, options: CaptureOptions) -> None:
    """Write the outer surface as PLY, in world coordinates and millimetres.

    The turntable's axis is y, and y = 0 is the frame's centre row.
    """
    solids = build_solids(shape, *object_size(layout, options), 0.0, level=True)
    shift = np.array([0.0, region_centre(layout)[1], 0.0])
    meshes = [
        trimesh.Trimesh((solid.vertices + shift) * mm_per_pixel(layout, options), solid.triangles, process=False)
        for solid in solids
        if not solid.inner
    ]
    path.write_bytes(bytes(trimesh.util.concatenate(meshes).export(file_type="ply")))
