"""The layout of a simulated frame: the object's region and the spheres beside it, in pixels and in the scene."""

from dataclasses import dataclass

import numpy as np

from glint.storage.catalogue.loading import Camera, Region
from glint.tasks.algorithms.geometry.perspective import Cone
from glint.tasks.algorithms.geometry.vectors import to_camera
from glint.tasks.algorithms.near_light.table_plane import TablePlane
from glint.tasks.algorithms.simulation.camera_poses import FREE_POSE_SCALE, CameraPose
from glint.tasks.algorithms.simulation.options import CaptureOptions
from glint.tasks.algorithms.simulation.shapes import REGION_MARGIN_PX, build_solids
from glint.tasks.algorithms.simulation.solids import CHROME, Solid, sphere

FRAME_MARGIN_PX = 16
"""Pixels around the object's region, and around each sphere."""
CODEC_BLOCK_PX = 16
"""Frames are whole blocks of the video codec, which makes the encoder's choices repeatable."""
FITTING_ROUNDS = 12
"""Rounds in which a shape's size and place are fitted to the region under perspective."""


@dataclass(frozen=True, slots=True)
class FrameLayout:
    """Layout of a frame, in pixels of the full frame.

    width, height: the frame's size; region: the object's; radius, sphere_row: of all chrome spheres, and their centres'
    row; sphere_columns: their centres' columns.
    """

    width: int
    height: int
    region: Region
    radius: float
    sphere_row: float
    sphere_columns: tuple[float, ...]


def frame_layout(width: int, height: int, options: CaptureOptions) -> FrameLayout:
    """Lay out a frame around an object's region of this width and height: one sphere on its right, or two beside it."""
    radius = options.sphere_radius
    full_height = max(height + 2 * FRAME_MARGIN_PX, int(2 * radius) + 2 * FRAME_MARGIN_PX)
    full_height += -full_height % CODEC_BLOCK_PX
    left = FRAME_MARGIN_PX + (options.spheres - 1) * (int(2 * radius) + FRAME_MARGIN_PX)
    full_width = left + width + 2 * FRAME_MARGIN_PX + int(2 * radius) + FRAME_MARGIN_PX
    full_width += -full_width % CODEC_BLOCK_PX
    # Centres lie between pixels, as in real captures.
    right_column = float(left + width + FRAME_MARGIN_PX + radius + 0.37)
    left_column = float(FRAME_MARGIN_PX + radius + 0.18)
    return FrameLayout(
        full_width,
        full_height,
        Region(x=left, y=(full_height - height) // 2, width=width, height=height),
        radius=radius,
        sphere_row=float(full_height * 0.55 + 0.21),
        sphere_columns=(right_column,) if options.spheres == 1 else (right_column, left_column),
    )


def region_centre(layout: FrameLayout) -> tuple[float, float]:
    """Return x and y of the region's centre in the camera frame, pixels."""
    column = np.array(layout.region.x + (layout.region.width - 1) / 2)
    row = np.array(layout.region.y + (layout.region.height - 1) / 2)
    x, y = to_camera(column, row, layout.width, layout.height)
    return float(x), float(y)


def object_size(layout: FrameLayout, options: CaptureOptions) -> tuple[int, int]:
    """Return the width and height in pixels that the object of several views may fill at z = 0.

    Less than the region if it is seen from above too, or if a near camera magnifies what the turntable turns to it.
    """
    share = FREE_POSE_SCALE if options.free_poses else 1.0
    distance = camera_distance(layout, options)
    if distance is not None:
        # What reaches as far to the camera as to the side still lies in the region.
        reach = max(layout.region.width, layout.region.height) / 2
        share *= distance / (distance + reach + float(np.abs(region_centre(layout)).max()))
    return round(layout.region.width * share), round(layout.region.height * share)


def mm_per_pixel(layout: FrameLayout, options: CaptureOptions) -> float:
    """Return the millimetres that a pixel covers at the object."""
    return options.sphere_diameter / (2.0 * layout.radius)


def camera_distance(layout: FrameLayout, options: CaptureOptions) -> float | None:
    """Return the camera's distance from z = 0, which is its focal length, in pixels; None: orthographic."""
    return None if options.focal is None else options.focal * layout.width


def camera_of(layout: FrameLayout, options: CaptureOptions) -> Camera | None:
    """Return the camera as the catalogue gives it; None: orthographic."""
    focal = camera_distance(layout, options)
    if focal is None:
        return None
    x, y = (layout.width - 1) / 2, (layout.height - 1) / 2
    return Camera(matrix=((focal, 0.0, x), (0.0, focal, y), (0.0, 0.0, 1.0)))


def sphere_contour(column: float, layout: FrameLayout, camera: Camera | None) -> tuple[float, float, float]:
    """Return the centre column, row, and radius of a sphere's contour in pixels, as the catalogue gives them.

    column: of the sphere's projected centre, which is at z = 0.
    """
    if camera is None:
        return column, layout.sphere_row, layout.radius
    x, y = to_camera(np.array(column), np.array(layout.sphere_row), layout.width, layout.height)
    centre = np.array([float(x), float(y), -camera.matrix[0][0]])
    distance = float(np.linalg.norm(centre))
    return Cone(centre / distance, layout.radius / distance).project(np.array(camera.matrix))


def object_solids(shape: str, layout: FrameLayout, options: CaptureOptions, placement: CameraPose) -> list[Solid]:
    """Return the solids of a shape, in the camera frame, as the camera of one view sees them."""
    distance = camera_distance(layout, options)
    if distance is not None and options.views == 1:
        return _fitted_solids(shape, layout, distance)
    x, y = region_centre(layout)
    # The object is built about its own centre; the world's origin is on its axis, in the frame's centre row.
    origin = placement.rotation @ np.array([0.0, y, 0.0]) + np.array([x + placement.offset, 0.0, 0.0])
    width, height = object_size(layout, options)
    solids = build_solids(shape, width, height, placement.turn, level=options.views > 1)
    return [solid.transformed(placement.rotation, origin) for solid in solids]


def sphere_solids(layout: FrameLayout) -> list[Solid]:
    """Return the chrome spheres in the camera frame, their centres at z = 0."""
    solids = []
    for column in layout.sphere_columns:
        x, y = to_camera(np.array(column), np.array(layout.sphere_row), layout.width, layout.height)
        solids.append(sphere(np.array([float(x), float(y), 0.0]), layout.radius, CHROME))
    return solids


def stood(solid: Solid, table: TablePlane, height: float) -> Solid:
    """Return a solid moved along the line of sight until its lowest point is this many pixels above the table."""
    gap = float((solid.vertices @ table.normal).min()) - table.offset - height
    return solid.transformed(np.eye(3), np.array([0.0, 0.0, -gap / table.normal[2]]))


def _fitted_solids(shape: str, layout: FrameLayout, distance: float) -> list[Solid]:
    """Return the solids of a shape, sized and placed so that a camera at z = distance sees them fill the region.

    A fixed-point iteration: project, compare with the region, correct place and size.
    """
    width, height = float(layout.region.width), float(layout.region.height)
    centre = np.array([*region_centre(layout), 0.0])
    available = np.array([width, height]) - 2.0 * REGION_MARGIN_PX
    for _ in range(FITTING_ROUNDS):
        solids = [solid.transformed(np.eye(3), centre) for solid in build_solids(shape, round(width), round(height))]
        points = np.concatenate([solid.vertices for solid in solids if not solid.inner])
        projected = points[:, :2] * distance / (distance - points[:, 2:])
        low, high = projected.min(axis=0), projected.max(axis=0)
        centre[:2] += np.array(region_centre(layout)) - (low + high) / 2.0
        share = float((available / (high - low)).min())
        width = 2.0 * REGION_MARGIN_PX + (width - 2.0 * REGION_MARGIN_PX) * share
        height = 2.0 * REGION_MARGIN_PX + (height - 2.0 * REGION_MARGIN_PX) * share
    return solids
