"""Geometry of a capture as the survey left it: frame, region, spheres, crops, camera, scale."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from glint.storage.catalogue.loading import Region
from glint.storage.errors import InputError
from glint.tasks.algorithms.geometry.perspective import camera_in_crop, view_vectors
from glint.tasks.algorithms.lighting.spheres import Sphere
from glint.tasks.engine.stage_inputs import CaptureResults

OBJECT = "object"
"""The object's crop."""
SPHERE_MARGIN_PX = 4
"""Pixels beyond a sphere's contour that its crop holds."""


@dataclass(frozen=True)
class CaptureGeometry:
    """Where things are in the full frame of a capture, in its pixels, and their scale.

    frame_size: (width, height).
    region: the object's.
    spheres: given or found, as they were measured.
    camera: (3, 3), the perspective camera's matrix; None: orthographic.
    pixel_size: millimetres of a pixel, None: unknown.
    unit: of depth, `mm` or `pixels`.
    """

    frame_size: tuple[int, int]
    region: Region
    spheres: tuple[Sphere, ...]
    camera: np.ndarray | None
    pixel_size: float | None
    unit: str

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> "CaptureGeometry":
        """Read the survey's record."""
        width, height = record["frame_size"]
        camera = record["camera"]
        return cls(
            (int(width), int(height)),
            Region(**record["region"]),
            tuple(
                Sphere(**{name: sphere[name] for name in ("x", "y", "radius", "score", "centre_sd", "radius_sd")})
                for sphere in record["spheres"]
            ),
            None if camera is None else np.array(camera, float),
            record["pixel_size"],
            record["unit"],
        )

    @cached_property
    def crops(self) -> dict[str, Region]:
        """Crops of the full frame by name: `object`, `sphere-0`, .."""
        return crops_of(self.region, self.spheres, self.frame_size[::-1])

    def camera_within(self, crop: Region) -> np.ndarray | None:
        """Return the perspective camera's matrix (3, 3) in the pixels of a crop; None: orthographic."""
        return None if self.camera is None else camera_in_crop(self.camera, crop.x, crop.y)

    @property
    def region_camera(self) -> np.ndarray | None:
        """The perspective camera's matrix (3, 3) in the pixels of the region; None: orthographic."""
        return self.camera_within(self.region)

    def holds(self, x: int, y: int) -> bool:
        """Return whether a pixel of the full frame lies in the region."""
        return 0 <= x - self.region.x < self.region.width and 0 <= y - self.region.y < self.region.height

    def row_and_column(self, x: int, y: int) -> tuple[int, int]:
        """Return row and column in the region of a pixel of the full frame.

        Raises:
            InputError: it lies outside the region.
        """
        if not self.holds(x, y):
            raise InputError(f"the pixel {x}, {y} lies outside the region", "choose one inside it")
        return y - self.region.y, x - self.region.x

    @cached_property
    def view_vectors(self) -> np.ndarray | None:
        """View vectors (H, W, 3) of the region's pixels under a perspective camera; None: all are (0, 0, 1)."""
        region = self.region
        return (
            None
            if self.camera is None
            else view_vectors(self.camera, (region.height, region.width), region.x, region.y)
        )


def crops_of(region: Region, spheres: Sequence[Sphere], size: tuple[int, int]) -> dict[str, Region]:
    """Return the crops of a full frame of `size` (rows, columns) by name: `object`, `sphere-0`, .."""
    return {OBJECT: region} | {
        sphere_name(number): _around_sphere(sphere, size) for number, sphere in enumerate(spheres)
    }


def _around_sphere(sphere: Sphere, size: tuple[int, int]) -> Region:
    left = max(int(sphere.x - sphere.radius) - SPHERE_MARGIN_PX, 0)
    top = max(int(sphere.y - sphere.radius) - SPHERE_MARGIN_PX, 0)
    right = min(int(sphere.x + sphere.radius) + SPHERE_MARGIN_PX + 2, size[1])
    bottom = min(int(sphere.y + sphere.radius) + SPHERE_MARGIN_PX + 2, size[0])
    return Region(x=left, y=top, width=right - left, height=bottom - top)


def sphere_name(number: int) -> str:
    """Return the name of a sphere's crop."""
    return f"sphere-{number}"


def load_geometry(results: CaptureResults) -> CaptureGeometry:
    """Load the geometry that the survey saved."""
    return CaptureGeometry.of(results.load("survey").record)
