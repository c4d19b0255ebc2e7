"""One capture of a version: arrays, camera, report, mesh and point cloud, each read at its first access."""

import warnings
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from glint.storage.errors import StoreError
from glint.storage.export.camera import CaptureCamera, PixelRegion, camera_of
from glint.storage.export.mesh_files import Mesh
from glint.storage.export.point_cloud import PointCloud, point_cloud_of
from glint.storage.export.report import capture_report, code_names
from glint.storage.export.stored_capture import ARRAYS, entry_of, mesh_of, model_result, ordered_stages
from glint.storage.versions.repository import ObjectRepository, Version
from glint.storage.versions.stage_results import StageResult

CONFIDENT = 0.95
"""Confidence from which a point cloud takes a pixel by default."""


@dataclass(frozen=True, eq=False, repr=False)
class StoredCapture:
    """The results of one capture in a version; they never change.

    Arrays are (H, W) of the region, row 0 at the top, or (T, ..) of the video's frames. Vectors are in the camera
    frame: x right, y up, z towards the camera. Arrays are read at the first access, kept, and cannot be written to.
    Every property may raise a StoreError: a result is missing or damaged, or the store cannot be read.
    """

    id: str
    _repository: ObjectRepository
    _version: Version
    _arrays: dict[str, np.ndarray] = field(default_factory=dict, init=False)

    @cached_property
    def normals(self) -> np.ndarray:
        """Surface normals (H, W, 3) float32, unit length; NaN outside the mask."""
        return self._array("normals")

    @cached_property
    def confidence(self) -> np.ndarray:
        """Probability (H, W) float32 that the normal's angular error is below 5 degrees; NaN outside the mask."""
        return self._array("confidence")

    @cached_property
    def depth(self) -> np.ndarray:
        """Depth (H, W) float32 towards the camera in `unit`, NaN outside the mask; each connected component has a free
        offset (orthographic camera) or scale (perspective camera)."""
        return self._array("depth")

    @cached_property
    def mask(self) -> np.ndarray:
        """Pixels of the object, (H, W) bool."""
        return self._array("mask")

    @cached_property
    def observed(self) -> np.ndarray:
        """Pixels of the object with a highlight, true or false, in at least one frame, (H, W) bool."""
        return _frozen((self._array("observations") > 0) & self.mask)

    @cached_property
    def provenance(self) -> np.ndarray:
        """Codes (H, W) uint8 of where each normal comes from, named by `provenance_names`; 0 outside the mask."""
        return self._array("provenance")

    @cached_property
    def provenance_names(self) -> dict[int, str]:
        """Names of the provenance codes: only what is called observed or marked was seen."""
        return code_names(self._stage("labels").record.get("provenance"))

    @cached_property
    def depth_provenance(self) -> np.ndarray:
        """Codes (H, W) uint8 of where each depth comes from, named by `depth_provenance_names`; 0 outside the mask."""
        return self._array("depth_provenance")

    @cached_property
    def depth_provenance_names(self) -> dict[int, str]:
        """Names of these codes: integrated from normals, or extrapolated beside the contour."""
        return code_names(self._stage("depth").record.get("provenance"))

    @cached_property
    def initial_normals(self) -> np.ndarray:
        """The smooth normals (H, W, 3) float32 that follow from the silhouette and the annotations alone."""
        return self._array("initial_normals")

    @cached_property
    def candidates(self) -> np.ndarray:
        """Candidate normals of each pixel, (K, H, W, 3) float32, unit length; NaN where there are fewer than K."""
        return self._array("candidates")

    @cached_property
    def accepted_candidates(self) -> np.ndarray:
        """Which of the `candidates` are taken for normals of the outer surface, (K, H, W) bool."""
        return _frozen(self._array("labels") > 0)

    @cached_property
    def accepted(self) -> np.ndarray:
        """Frames with a usable light, (T,) bool."""
        return _frozen(self._array("reason") == 0)

    @cached_property
    def lights(self) -> np.ndarray:
        """Light directions (T, 3) float32, unit length, towards the light; NaN where the frame was rejected."""
        return self._array("lights")

    @cached_property
    def half_vectors(self) -> np.ndarray:
        """Unit vectors (T, 3) float32 between the light and (0, 0, 1); NaN where the frame was rejected."""
        return self._array("half_vectors")

    @cached_property
    def camera(self) -> CaptureCamera:
        """Matrix or orthographic scale, region, distance and pose together, and `points(depth)`."""
        model = model_result(self._repository, self._version)
        camera = camera_of(self._stages, entry_of(self._version, self.id), model.record if model else None)
        if camera is None:
            raise StoreError(f"{self.id} has no survey in {self._version.name}", "run the object again")
        for matrix in (camera.matrix, camera.camera_to_world):
            if matrix is not None:
                _frozen(matrix)
        return camera

    @property
    def camera_matrix(self) -> np.ndarray | None:
        """Camera matrix (3, 3) float64 in pixels of the full frame, without distortion; None: orthographic camera."""
        return self.camera.matrix

    @property
    def pixel_size(self) -> float | None:
        """Millimetres per pixel (under perspective, at the object's distance); None where the scale is unknown."""
        return self.camera.pixel_size

    @property
    def unit(self) -> str:
        """The unit of depth, mesh and point cloud: "mm", or "pixels" where the scale is unknown."""
        return self.camera.unit

    @property
    def region(self) -> PixelRegion:
        """The part of the full frame that the arrays cover: x, y, width, height in pixels; `rows`, `columns` slices."""
        return self.camera.region

    @property
    def pose(self) -> np.ndarray | None:
        """Matrix (4, 4) from the camera frame to the world frame (y up), in `unit`; None where it is unknown."""
        return self.camera.camera_to_world

    @cached_property
    def report(self) -> dict[str, Any]:
        """All figures of the capture: the content of an export's report.json."""
        stages = self._stages
        names = [name for name, (stage, array) in ARRAYS.items() if stage in stages and array in stages[stage].arrays]
        used = {"mask", "depth", "depth_provenance", "confidence", "provenance", "reason"}
        arrays = {name: self._array(name) for name in names if name in used}
        arrays["observed"] = self.observed if "observations" in names else np.zeros_like(self.mask)
        version = self._version
        about: dict[str, Any] = {
            "name": version.name,
            "snapshot": version.snapshot,
            "time": version.time.isoformat(timespec="seconds"),
        }
        about |= {"metadata": version.metadata}
        return capture_report(self._repository.object_id, self.id, about, stages, arrays)

    @cached_property
    def mesh(self) -> Mesh:
        """The depth as a triangle mesh in the camera frame, cut where the surface steps."""
        return frozen_mesh(mesh_of(self._stage("surface"), "surface.ply"))

    def point_cloud(self, min_confidence: float = CONFIDENT) -> PointCloud:
        """Return the points of all pixels of at least this confidence, in the camera frame and in `unit`.

        A cloud without points comes with a warning that names the highest confidence.

        Raises:
            ValueError: `min_confidence` is not in 0..1.
        """
        if not 0.0 <= min_confidence <= 1.0:
            raise ValueError(f"min_confidence is {min_confidence}: a probability, 0 to 1")
        cloud = point_cloud_of(self.camera, self.depth, self.normals, self.confidence, min_confidence)
        if not len(cloud):
            highest = float(np.nanmax(self.confidence, initial=0.0))
            # As many digits as show that it is below.
            shown = next(
                (text for text in (f"{highest:.{n}f}" for n in range(2, 9)) if float(text) < min_confidence), "0"
            )
            name = f"{self._repository.object_id}/{self.id}"
            warnings.warn(
                f"no pixel of {name} has a confidence of {min_confidence:g}; the highest is {shown}: "
                f"pass a lower min_confidence",
                stacklevel=2,
            )
        return cloud

    def __repr__(self) -> str:
        """Return id, object, version, size, camera and scale."""
        camera = self.camera
        lens = "orthographic" if camera.matrix is None else "perspective"
        scale = "scale unknown" if camera.pixel_size is None else f"{camera.pixel_size:.4g} mm per pixel"
        size = f"{camera.region.height} x {camera.region.width} pixels"
        owner = f"{self._repository.object_id!r} {self._version.name}"
        return f"<StoredCapture {self.id!r} of {owner}: {size}, {lens}, {scale}>"

    @cached_property
    def _stages(self) -> dict[str, StageResult]:
        """The results of all stages, in the order in which they ran; arrays and files are not read yet."""
        results = self._repository.load_capture(self.id, self._version.snapshot)
        return {stage: results[stage] for stage in ordered_stages(results, self._version)}

    def _stage(self, name: str) -> StageResult:
        """Return the stage's result."""
        if name not in self._stages:
            owner = f"{self._repository.object_id}/{self.id}"
            raise StoreError(f"{owner} has no {name} in {self._version.name}", "run the object again")
        return self._stages[name]

    def _array(self, name: str) -> np.ndarray:
        """Return the array of this name in ARRAYS, read once."""
        if name not in self._arrays:
            stage, array = ARRAYS[name]
            self._arrays[name] = _frozen(self._stage(stage).read(array))
        return self._arrays[name]


def frozen_mesh(mesh: Mesh) -> Mesh:
    """Return the mesh with arrays that cannot be written to."""
    for values in (mesh.vertices, mesh.triangles, mesh.normals, mesh.confidence):
        _frozen(values)
    return mesh


def _frozen(values: np.ndarray) -> np.ndarray:
    values.flags.writeable = False
    return values
