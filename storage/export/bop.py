"""A version as a dataset in the format of BOP, the benchmark for 6D object pose estimation (Hodan 2018).

Layout and keys follow docs/bop_datasets_format.md of the BOP toolkit: models in millimetres with z up and the origin at
the centre of their bounding box, cameras as OpenCV's, depth ahead of the camera in 16-bit PNG times `depth_scale`.
The images are full frames, so that frames of the videos can be put beside them as `rgb` without cropping.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, cKDTree
from scipy.spatial.distance import cdist

from glint.storage.errors import StoreError
from glint.storage.export.axes import OPENCV_FROM_CAMERA
from glint.storage.export.image_files import write_png
from glint.storage.export.mesh_files import Mesh, write_ply
from glint.storage.export.placed_depth import placed_on_model
from glint.storage.export.point_cloud import MAX_SLOPE_DEG, has_surface
from glint.storage.export.stored_capture import ExportedCapture

DEPTH_SCALES_MM = (0.01, 0.1, 1.0)
"""Millimetres of one step of the depth images; the finest that holds the farthest pixel is used."""

_MAX_DEPTH_STEP = 65535

_BLOCK = 256
"""Points whose distances to as many others are computed at once."""

_Z_UP_FROM_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])

_ABOUT = """# {object_id}, {version}

Exported by Glint in the format of BOP datasets (scene-wise), split `train`.

- The models are reconstructions, not scans or CAD models: see each capture's confidence in the other exports.
- `depth` is the reconstruction's, not a sensor's. {distances}
- Depth is 0 where the surface is steeper than {slope:.0f} degrees: only the silhouette is known there.
- Depth and masks are full frames. Versions hold no frames of the videos: put one per image at `rgb/IMAGE.png`.

Images: {images}
"""

_ON_MODEL = "Each connected component is at the distance of the model."
_AT_PIXEL_SIZE = """Distances are those at which a pixel covers the capture's pixel size;
  each connected component has a scale of its own that one view cannot show."""


@dataclass(slots=True)
class BopObject:
    """One model of the dataset: its mesh (mm, camera or world frame, y up) and what its images say.

    centre: (3,) of the mesh's bounding box; cameras, poses: entries of scene_camera.json and scene_gt.json by image.
    """

    number: int
    mesh: Mesh
    cameras: dict[str, Any] = field(default_factory=dict)
    poses: dict[str, Any] = field(default_factory=dict)
    infos: dict[str, Any] = field(default_factory=dict)

    @property
    def centre(self) -> np.ndarray:
        """The centre (3,) of the mesh's bounding box, in the mesh's own frame."""
        return (self.mesh.vertices.min(axis=0).astype(float) + self.mesh.vertices.max(axis=0)) / 2

    @property
    def model(self) -> Mesh:
        """The mesh in BOP's model frame: z up, origin at the centre of the bounding box."""
        vertices = (self.mesh.vertices - self.centre) @ _Z_UP_FROM_Y_UP.T
        normals = self.mesh.normals @ _Z_UP_FROM_Y_UP.T
        return replace(self.mesh, vertices=vertices.astype(np.float32), normals=normals.astype(np.float32))


def check_exportable(captures: Sequence[ExportedCapture]) -> None:
    """Check that the captures can be images of a BOP dataset.

    Raises:
        StoreError: a capture's camera is orthographic or its scale is unknown.
    """
    orthographic = [capture.name for capture in captures if capture.camera.matrix is None]
    if orthographic:
        raise StoreError(
            f"BOP needs a perspective camera, that of {', '.join(orthographic)} is orthographic",
            "give the captures a camera matrix in the catalogue and run them again, or use --format pcd",
        )
    unscaled = [capture.name for capture in captures if capture.camera.unit != "mm"]
    if unscaled:
        raise StoreError(
            f"BOP counts in millimetres, the scale of {', '.join(unscaled)} is unknown",
            "give the captures a pixel_size or a sphere's diameter_mm in the catalogue and run them again",
        )


def write_bop(
    folder: Path, object_id: str, version: str, captures: Sequence[ExportedCapture], model: Mesh | None
) -> None:
    """Write the dataset: one model with an image per capture, or, without a merged model, one model per capture.

    Captures that the merged model leaves out have no pose and are left out here too.

    Raises:
        StoreError: a camera is orthographic, a scale is unknown, or a pixel is too far for 16 bits.
    """
    usable = [capture for capture in captures if model is None or capture.camera.pose_source == "model"]
    check_exportable(usable)
    (folder / "models").mkdir()
    merged = None if model is None else BopObject(1, model)
    objects = [] if merged is None else [merged]
    for image, capture in enumerate(usable):
        if merged is None:
            objects.append(BopObject(image + 1, capture.surface))
        _write_image(folder, objects[-1], image, capture, posed=merged is not None)
    infos = {}
    for entry in objects:
        shape = entry.model
        write_ply(folder / "models" / f"obj_{entry.number:06d}.ply", shape)
        infos[str(entry.number)] = _model_info(shape.vertices.astype(float))
        scene = folder / "train" / f"{entry.number:06d}"
        _write_json(scene / "scene_camera.json", entry.cameras)
        _write_json(scene / "scene_gt.json", entry.poses)
        _write_json(scene / "scene_gt_info.json", entry.infos)
    _write_json(folder / "models" / "models_info.json", infos)
    _write_json(folder / "camera.json", _sensor(usable[0], objects[0].cameras))
    images = "; ".join(f"{image:06d} is capture {capture.name}" for image, capture in enumerate(usable))
    about = _ABOUT.format(
        object_id=object_id,
        version=version,
        images=images,
        slope=MAX_SLOPE_DEG,
        distances=_AT_PIXEL_SIZE if merged is None else _ON_MODEL,
    )
    (folder / "dataset_info.md").write_text(about, encoding="utf-8")


def _write_image(folder: Path, entry: BopObject, image: int, capture: ExportedCapture, posed: bool) -> None:
    """Write depth and masks of one capture, and note its camera, pose and statistics."""
    camera, scene = capture.camera, folder / "train" / f"{entry.number:06d}"
    assert camera.matrix is not None and camera.distance is not None
    is_known = capture.mask & has_surface(camera, capture.depth, capture.normals)
    ahead = np.where(is_known, camera.distance - capture.depth.astype(float), np.nan)
    if posed:
        ahead = placed_on_model(ahead, camera, entry.mesh)
    scale = _depth_scale(ahead, capture.name)
    depth = _full_frame(np.rint(np.nan_to_num(ahead) / scale).astype(np.uint16), capture)
    mask = _full_frame(capture.mask, capture)
    for name, picture in {
        f"depth/{image:06d}": depth,
        f"mask/{image:06d}_000000": mask,
        f"mask_visib/{image:06d}_000000": mask,
    }.items():
        path = scene / f"{name}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        write_png(path, picture)
    world_from_camera = camera.camera_to_world if posed and camera.camera_to_world is not None else np.eye(4)
    # OpenCV's camera frame from the mesh's frame, and from the centred model with z up.
    pose = OPENCV_FROM_CAMERA @ np.linalg.inv(world_from_camera)
    rotation = pose[:3, :3] @ _Z_UP_FROM_Y_UP.T
    translation = pose[:3, :3] @ entry.centre + pose[:3, 3]
    facts: dict[str, Any] = {"cam_K": camera.matrix.flatten().tolist(), "depth_scale": scale}
    if posed:
        facts |= {"cam_R_w2c": pose[:3, :3].flatten().tolist(), "cam_t_w2c": pose[:3, 3].tolist()}
    entry.cameras[str(image)] = facts
    entry.poses[str(image)] = [
        {"cam_R_m2c": rotation.flatten().tolist(), "cam_t_m2c": translation.tolist(), "obj_id": entry.number}
    ]
    entry.infos[str(image)] = [_visibility(mask, depth)]


def _depth_scale(ahead: np.ndarray, name: str) -> float:
    """Return the millimetres of one step of a depth image that holds the distances `ahead` (NaN: unknown)."""
    nearest, farthest = float(np.nanmin(ahead)), float(np.nanmax(ahead))
    for scale in DEPTH_SCALES_MM:
        if nearest > 0 and farthest <= scale * _MAX_DEPTH_STEP:
            return scale
    raise StoreError(
        f"{name} is {nearest:.0f} to {farthest:.0f} mm from the camera, which 16 bits cannot hold",
        "check the capture's pixel_size, its sphere's diameter_mm and its camera matrix",
    )


def _full_frame(values: np.ndarray, capture: ExportedCapture) -> np.ndarray:
    """Return values (H, W) of the region in the full frame, 0 around it."""
    width, height = capture.camera.frame_size
    frame = np.zeros((height, width), values.dtype)
    frame[capture.camera.region.rows, capture.camera.region.columns] = values
    return frame


def _visibility(mask: np.ndarray, depth: np.ndarray) -> dict[str, Any]:
    """Return an entry of scene_gt_info.json; the object is alone, so all of it is visible."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    box = [int(columns[0]), int(rows[0]), int(columns[-1] - columns[0] + 1), int(rows[-1] - rows[0] + 1)]
    pixels = int(mask.sum())
    return {
        "bbox_obj": box,
        "bbox_visib": box,
        "px_count_all": pixels,
        "px_count_valid": int(np.count_nonzero(depth[mask])),
        "px_count_visib": pixels,
        "visib_fract": 1.0,
    }


def _model_info(vertices: np.ndarray) -> dict[str, float]:
    """Return bounding box and diameter (the largest distance between two vertices) in mm."""
    low, size = vertices.min(axis=0), np.ptp(vertices, axis=0)
    hull = vertices[ConvexHull(vertices, qhull_options="QJ").vertices]
    info = {f"min_{axis}": float(low[number]) for number, axis in enumerate("xyz")}
    info |= {f"size_{axis}": float(size[number]) for number, axis in enumerate("xyz")}
    return info | {"diameter": _diameter(hull)}


def _diameter(points: np.ndarray) -> float:
    """Return the largest distance between two points (N, 3).

    Blocks of neighbours are compared, those farthest apart first, until no other two can hold a larger distance.
    """
    blocks = [points[part] for part in np.array_split(cKDTree(points).indices, -(-len(points) // _BLOCK))]
    centres = np.array([block.mean(axis=0) for block in blocks])
    radii = [np.linalg.norm(block - centre, axis=1).max() for block, centre in zip(blocks, centres, strict=True)]
    bounds = np.triu(cdist(centres, centres) + np.add.outer(radii, radii))
    largest = 0.0
    for pair in np.argsort(-bounds, axis=None):
        first, second = np.unravel_index(pair, bounds.shape)
        if bounds[first, second] <= largest:
            break
        largest = max(largest, float(cdist(blocks[first], blocks[second]).max()))
    return largest


def _sensor(capture: ExportedCapture, cameras: dict[str, Any]) -> dict[str, Any]:
    """Return the content of camera.json, which describes the sensor for rendering: that of the first image."""
    matrix, (width, height) = capture.camera.matrix, capture.camera.frame_size
    assert matrix is not None
    facts = {"fx": matrix[0, 0], "fy": matrix[1, 1], "cx": matrix[0, 2], "cy": matrix[1, 2]}
    scale = next(iter(cameras.values()))["depth_scale"]
    sensor = {name: float(value) for name, value in facts.items()}
    return sensor | {"width": width, "height": height, "depth_scale": scale}


def _write_json(path: Path, content: Any) -> None:
    path.write_text(json.dumps(content, indent=2, allow_nan=False) + "\n", encoding="utf-8")
