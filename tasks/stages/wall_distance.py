"""The light's distance by the wall of a body of revolution, where a single sphere leaves it uncertain.

What the background shows, or that nothing shows the distance, is known beforehand (`light_distance`); the labels add
what the accepted normals of a wall show.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.candidates.markup import Marks
from glint.tasks.algorithms.labelling.results import Reconstruction, exterior_normals
from glint.tasks.algorithms.near_light.distance_by_wall import (
    DistanceChange,
    distance_by_wall,
    moved_by_light,
    wall_normals,
)
from glint.tasks.algorithms.near_light.half_vector_error import depth_error, light_distance_error, mean_position
from glint.tasks.engine.stage_inputs import CaptureResults
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.stages.capture_geometry import CaptureGeometry, load_geometry
from glint.tasks.stages.light_distance import region_pixels

CONTRADICTED_DEVIATIONS = 3.0
"""Standard deviations by which the wall contradicts what was known of the distance."""
MIN_CORRECTION_DEG = 0.2
"""Angle per axis by which the change must turn half vectors at the farthest pixel, for labels to be made again: smaller
ones, and those within a standard deviation, are left and count as an error."""
MAX_CORRECTIONS = 3
"""Times that labels are made again: where the light was far off, the wall is found better with each."""


@dataclass(frozen=True, slots=True)
class WallDistance:
    """What a wall adds to what is known of the light's distance.

    change: of its inverse distance, 1/pixels, by which half vectors are corrected, 0: they stay. variance_change: (H,
    W), of the variance per axis of half vectors, radians squared. warnings: where the wall contradicts what was known.
    """

    change: float
    variance_change: np.ndarray
    warnings: Sequence[StageWarning] = ()


def wall_distance(
    results: CaptureResults, normals: np.ndarray, labelled: Reconstruction, applied: float
) -> WallDistance | None:
    """Measure the light's distance by the wall that a reconstruction found; None where it is known, or without a wall.

    normals: (K, H, W, 3), candidates of the reconstruction in the camera frame; applied: change of the inverse
    distance, 1/pixels, that they are corrected for.
    """
    lights, geometry = results.load("lights").record, load_geometry(results)
    known_sd = lights["inverse_distance_sd"]
    if known_sd is None or labelled.wall is None:
        return None
    wall = wall_normals(
        exterior_normals(normals, labelled.labels),
        labelled.wall.normals,
        labelled.wall.tangents,
        sphere_offsets(geometry),
        geometry.view_vectors,
    )
    measured = distance_by_wall(wall, float(lights["spheres_error"]))
    if measured is None:
        return None
    near = lights["near_light"]
    known = 0.0 if near is None else 1.0 / float(near["distance"])
    measured = measured._replace(change=applied + measured.change)
    return combined_distance(geometry, known, float(known_sd), measured, applied)


def combined_distance(
    geometry: CaptureGeometry, inverse: float, inverse_sd: float, measured: DistanceChange, applied: float = 0.0
) -> WallDistance:
    """Return what follows from two independent measurements of a light's distance.

    inverse, inverse_sd: its inverse distance as it was known, 1/pixels, and its standard deviation; measured: change of
    it by the wall; applied: change that half vectors are corrected for.
    """
    pixels, spheres = region_pixels(geometry), geometry.spheres
    known_error = light_distance_error(pixels, spheres, inverse_sd)
    if abs(measured.change) > CONTRADICTED_DEVIATIONS * np.hypot(inverse_sd, measured.standard_deviation):
        error = light_distance_error(pixels, spheres, abs(measured.change))
        message = (
            "the wall of the body of revolution contradicts what the background shows of the light's distance: the body"
            " may be oval, or the camera near and its matrix missing. Use two spheres, one on either side, or give the"
            " distance in millimetres, `parameters: {lights: {distance: ..}}`"
        )
        warning = StageWarning(message, "light", float(np.degrees(np.sqrt(2.0) * np.median(error))))
        return WallDistance(0.0, np.square(error), [warning])
    precision = inverse_sd**-2 + measured.standard_deviation**-2
    # A light behind the frame's plane would be in the picture.
    change = max(measured.change / (measured.standard_deviation**2 * precision), -inverse)
    deviation, remaining = float(precision**-0.5), 0.0
    turn_deg = np.degrees(light_distance_error(pixels, spheres, abs(change - applied)).max())
    if turn_deg < MIN_CORRECTION_DEG or abs(change - applied) < deviation:
        change, remaining = applied, change - applied
    error = light_distance_error(pixels, spheres, float(np.hypot(deviation, remaining)))
    heights = np.square(depth_error(pixels, inverse + change)) - np.square(depth_error(pixels, inverse))
    return WallDistance(change, np.square(error) - np.square(known_error) + heights)


def sphere_offsets(geometry: CaptureGeometry) -> np.ndarray:
    """Return the positions (H, W, 2) of the region's pixels from the spheres' mean, in pixels, y up."""
    pixels, (x, y) = region_pixels(geometry), mean_position(geometry.spheres)
    return np.stack([pixels.columns - x, y - pixels.rows], axis=-1)


def with_distance(
    clusters: Clusters, marks: Marks | None, geometry: CaptureGeometry, change: float
) -> tuple[Clusters, Marks | None]:
    """Return candidates and marks, in the camera frame, as they are with another inverse distance of the light.

    change: of the inverse distance, 1/pixels.
    """
    if change == 0.0:
        return clusters, marks
    view, motion = _view_and_motion(geometry, change)
    normals, winner = (moved_by_light(vectors, view, motion) for vectors in (clusters.normals, clusters.winner))
    clusters = replace(clusters, normals=normals.astype(np.float32), winner=winner.astype(np.float32))
    return clusters, None if marks is None else marks_with_distance(marks, geometry, change)


def marks_with_distance(marks: Marks, geometry: CaptureGeometry, change: float) -> Marks:
    """Return marks as they are with another inverse distance of the light, changed by so much, 1/pixels."""
    return replace(marks, half_vectors=half_vectors_with_distance(marks.half_vectors, marks.pixels, geometry, change))


def half_vectors_with_distance(
    half_vectors: np.ndarray, pixels: np.ndarray, geometry: CaptureGeometry, change: float
) -> np.ndarray:
    """Return half vectors (N, 3) float32 at pixels (N, 2) of the region with another inverse distance of the light."""
    if change == 0.0:
        return half_vectors
    rows, columns = pixels.T
    view, motion = _view_and_motion(geometry, change)
    return moved_by_light(half_vectors, view[rows, columns], motion[rows, columns]).astype(np.float32)


def _view_and_motion(geometry: CaptureGeometry, change: float) -> tuple[np.ndarray, np.ndarray]:
    """Return view vectors and motions (H, W, 3) of the vector to the light, by a change of its inverse distance."""
    offsets = sphere_offsets(geometry)
    motion = -change * np.concatenate([offsets, np.zeros((*offsets.shape[:2], 1))], axis=-1)
    view = geometry.view_vectors
    return np.broadcast_to([0.0, 0.0, 1.0], motion.shape) if view is None else view, motion
