"""A small store whose one object is a sphere of known geometry, as the stages would have left it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from glint.storage.locations.location import Location
from glint.storage.versions.repository import ObjectRepository
from glint.storage.versions.stage_results import WHOLE_OBJECT, StoredFile
from tests.storage.stores import PIXEL, PROVENANCE, REASONS, capture_arrays

FRAME = (64, 48)
REGION = {"x": 12, "y": 6, "width": 40, "height": 36}
MATRIX = [[500.0, 0.0, 33.0], [0.0, 480.0, 22.0], [0.0, 0.0, 1.0]]


@dataclass(frozen=True)
class Sphere:
    """A sphere as a capture shows it: centre (3,) and radius in the camera frame, in mm."""

    centre: tuple[float, float, float]
    radius: float


def sphere_points(sphere: Sphere, matrix: Any) -> np.ndarray:
    """Return the nearest points (H, W, 3) of a sphere that the region's pixels see, NaN beside it."""
    columns, rows = np.meshgrid(np.arange(40.0) + REGION["x"], np.arange(36.0) + REGION["y"])
    if matrix is None:
        x, y = (columns - 31.5) * 0.5, (23.5 - rows) * 0.5
        square = sphere.radius**2 - (x - sphere.centre[0]) ** 2 - (y - sphere.centre[1]) ** 2
        with np.errstate(invalid="ignore"):
            points = np.stack([x, y, sphere.centre[2] + np.sqrt(square)], axis=-1)
        points[np.isnan(points).any(axis=-1)] = np.nan
        return points
    (fx, _, cx), (_, fy, cy), _ = matrix
    rays = np.stack([(columns - cx) / fx, -(rows - cy) / fy, -np.ones_like(rows)], axis=-1)
    centre = np.array(sphere.centre)
    along, square = rays @ centre, (rays**2).sum(axis=-1)
    with np.errstate(invalid="ignore"):
        distance = (along - np.sqrt(along**2 - square * (centre @ centre - sphere.radius**2))) / square
    return rays * distance[..., None]


def ply_file(points: np.ndarray, normals: np.ndarray, confidence: np.ndarray) -> bytes:
    """Return the PLY file of the mesh between neighbouring pixels, by the library that the pipeline uses."""
    known = np.isfinite(points).all(axis=-1)
    number = np.cumsum(known).reshape(known.shape) - 1
    whole = known[:-1, :-1] & known[1:, :-1] & known[:-1, 1:] & known[1:, 1:]
    corners = [number[:-1, :-1][whole], number[1:, :-1][whole], number[1:, 1:][whole], number[:-1, 1:][whole]]
    a, b, c, d = corners
    triangles = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)])
    mesh = trimesh.Trimesh(points[known], triangles, vertex_normals=normals[known], process=False)
    mesh.vertex_attributes["confidence"] = confidence[known].astype(np.float32)
    return bytes(trimesh.exchange.ply.export_ply(mesh, encoding="binary", vertex_normal=True))


def save_sphere(
    repository: ObjectRepository,
    capture: str = "front",
    sphere: Sphere | None = None,
    matrix: Any = None,
    scale_known: bool = True,
    camera_recorded: bool = False,
    depth_factor: float = 1.0,
) -> dict[str, Any]:
    """Save all stages of a capture of a sphere; its arrays and points. Its camera: orthographic, or of this matrix.

    depth_factor: by which a perspective camera's distances are wrong, as one view leaves their scale open.
    """
    distance = None if matrix is None else 200.0
    sphere = sphere or Sphere((0.0, 0.0, 0.0 if matrix is None else -200.0), 6.0)
    points = sphere_points(sphere, matrix)
    mask = np.isfinite(points).all(axis=-1)
    depth = (depth_factor * points[..., 2] + (distance or 0.0)).astype(np.float32)
    normals = ((points - np.array(sphere.centre)) / sphere.radius).astype(np.float32)
    arrays = capture_arrays(height=36, width=40)
    confidence = np.where(mask, np.where(normals[..., 2] > 0.8, 0.97, 0.4), np.nan).astype(np.float32)
    arrays["mask"] = {"mask": mask}
    arrays["labels"] |= {"normals": normals, "confidence": confidence, "provenance": mask.astype(np.uint8)}
    arrays["labels"]["labels"][1:] = 0
    arrays["silhouette"] = {"rim": mask, "initial": normals}
    arrays["depth"] = {"depth": depth, "provenance": mask.astype(np.uint8)}
    unit, pixel_size = ("mm", 0.5) if scale_known else ("pixels", None)
    survey = {"frame_size": FRAME, "region": REGION, "unit": unit, "pixel_size": pixel_size}
    if camera_recorded:
        survey["camera"] = matrix
    records: dict[str, dict[str, Any]] = {
        "survey": survey,
        "depth": {
            "unit": unit,
            "pixel_size": pixel_size,
            "distance": distance,
            "provenance": ("outside", "integrated"),
        },
        "labels": {"provenance": PROVENANCE},
        "lights": {"reasons": REASONS},
        "surface": {"unit": unit},
    }
    stages: dict[str, dict[str, Any]] = {"survey": {}} | arrays
    for stage, values in stages.items():
        files = {}
        if stage == "surface":
            files = {
                "surface.ply": (ply_file(points, normals, confidence), "model/ply"),
                "relit.png": (PIXEL, "image/png"),
            }
        save(repository, capture, stage, values, records.get(stage, {}), files)
    return {"points": points, "mask": mask, "depth": depth, "normals": normals, "confidence": confidence} | arrays[
        "lights"
    ]


def save_model(repository: ObjectRepository, sphere: Sphere, views: list[dict[str, Any]]) -> None:
    """Save a model of an object: the sphere in the world frame, and the poses of the captures it was merged from."""
    mesh = trimesh.creation.icosphere(2, sphere.radius)
    normals = np.array(mesh.vertices) / sphere.radius
    mesh = trimesh.Trimesh(mesh.vertices + sphere.centre, mesh.faces, vertex_normals=normals, process=False)
    mesh.vertex_attributes["confidence"] = np.ones(len(normals), np.float32)
    data = bytes(trimesh.exchange.ply.export_ply(mesh, encoding="binary", vertex_normal=True))
    save(repository, WHOLE_OBJECT, "model", {}, {"unit": "mm", "views": views}, {"model.ply": (data, "model/ply")})


def save(
    repository: ObjectRepository,
    capture: str,
    stage: str,
    arrays: Mapping[str, Any],
    record: Mapping[str, Any],
    files: Mapping[str, tuple[bytes, str]],
) -> None:
    """Save a stage with files, given as their bytes and media types."""
    stored = {name: StoredFile(data, media) for name, (data, media) in files.items()}
    repository.save(capture, stage, f"key-{capture}-{stage}", arrays, record, stored)


def entry(matrix: Any = None, **facts: Any) -> dict[str, Any]:
    """Return a version's metadata of a capture, with the catalogue's entry."""
    return {"entry": ({"camera": {"matrix": matrix}} if matrix else {}) | facts}


def make_store(folder: Path) -> Path:
    """Make a store in a folder: `wine-glass` with the orthographic capture `front` and the perspective one `phone`."""
    repository = ObjectRepository.open(Location.parse(folder), "wine-glass")
    save_sphere(repository, "front")
    repository.publish(["front"], {"run": "r1", "captures": {"front": entry()}})
    save_sphere(repository, "phone", matrix=MATRIX)
    pose = np.eye(4)
    pose[2, 3] = 200.0
    captures = {"front": entry(), "phone": entry(MATRIX, pose={"camera_to_world": pose.tolist()})}
    repository.publish(["front", "phone"], {"run": "r2", "captures": captures})
    return folder
