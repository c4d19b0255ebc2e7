"""Clusters: candidate normals of every pixel, by tiles that any worker can take."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from glint.storage.frames.cache import FrameCache
from glint.storage.locations.location import Location
from glint.storage.versions.stage_results import StageResult
from glint.tasks.algorithms.candidates.clusters import USUAL_DISC_DEG, Clusters, cluster_pixels, inverse_density_weights
from glint.tasks.algorithms.candidates.disc_centres import DiscModel
from glint.tasks.algorithms.candidates.lit_frames import HighlightLevels
from glint.tasks.algorithms.candidates.shading import MAX_SHADING, object_shading, with_object_shading
from glint.tasks.algorithms.candidates.surround import Rings, find_rings, rings_deg
from glint.tasks.algorithms.geometry.perspective import half_vectors_for_view, rotate_to_view
from glint.tasks.algorithms.lighting.coverage import EXTRAPOLATED_ERROR_DEG, MIN_SWEEP_FRAMES
from glint.tasks.algorithms.lighting.lights import USUAL_LIGHT_DEG, light_size
from glint.tasks.engine.parameters import ClustersParameters
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import CaptureResults, StageInputs
from glint.tasks.engine.stage_warning import StageWarning
from glint.tasks.engine.tiles import Tile, tiles_of
from glint.tasks.stages.capture_geometry import OBJECT, load_geometry
from glint.tasks.stages.frames import open_frames
from glint.tasks.stages.light_distance import load_near_light

Mapper = Callable[[Callable[[Any, Any], Any], Iterable[Any], Any], Iterable[Any]]
"""Applies a function to tasks and to what they share, anywhere; yields the results in the tasks' order."""
MIN_OBSERVED_SHARE = 0.3
"""Share of the object's pixels with a highlight below which the recording is too short or too dark."""
MATTE_COST_DEG = 15.0
"""Error of normals that the silhouette alone gives, as in the evaluation."""


@dataclass(frozen=True, slots=True)
class SharedInputs:
    """What all tiles share: where the frames are, half_vectors (T, 3), weights (T,), rings of the lights, the radius of
    their discs in degrees, and what frames tell of the discs' centres."""

    store: str
    digest: str
    half_vectors: np.ndarray
    weights: np.ndarray
    rings: Rings
    disc_deg: float
    discs: DiscModel | None
    parameters: ClustersParameters


def serial_map(function: Callable[[Any, Any], Any], tasks: Iterable[Any], shared: Any) -> Iterator[Any]:
    """Map in this process alone."""
    return (function(task, shared) for task in tasks)


def clusters(inputs: StageInputs, progress: Progress, mapper: Mapper = serial_map) -> StageOutput:
    """Cluster every pixel of the mask, tile by tile ("normal clustering", section 4.2 of the paper)."""
    parameters: ClustersParameters = inputs.parameters
    cache, mask = open_frames(inputs), inputs.load("mask").read("mask")
    lights = inputs.load("lights")
    half_vectors, light_radius = lights.read("half_vectors"), lights.record["light_radius_degrees"]
    size = light_size(light_radius)
    highlights = read_highlights(inputs.load("thresholds"))
    weights = inverse_density_weights(half_vectors, parameters.dwell)
    tiles = [tile for tile in tiles_of(mask.shape, cache.frames * cache.bits // 8) if mask[tile].any()]
    rings = find_rings(half_vectors, weights, size)
    disc = USUAL_DISC_DEG * size if parameters.radius is None else parameters.radius
    if parameters.radius is not None or light_radius is None:
        light_radius = USUAL_LIGHT_DEG * disc / USUAL_DISC_DEG
    # Between the few lights of photographs all frames are dark, and tell nothing of a single lit one's disc.
    has_discs = parameters.dark_frames and np.count_nonzero(weights) >= MIN_SWEEP_FRAMES
    discs = DiscModel.of_light(light_radius, half_vectors, weights) if has_discs else None
    shared = SharedInputs(inputs.location.uri, cache.digest, half_vectors, weights, rings, disc, discs, parameters)
    tasks = [(tile, highlights._replace(thresholds=highlights.thresholds[tile])) for tile in tiles]
    result = empty_clusters(parameters.clusters, mask.shape)
    for done, (tile, part) in enumerate(zip(tiles, mapper(cluster_tile, tasks, shared), strict=True), 1):
        paste(result, tile, part)
        progress(done, len(tiles))
    observed = (result.observations > 0) & mask
    mean = object_shading(result.shading)
    result = replace(result, shading=with_object_shading(result.shading))
    return StageOutput(
        arrays=_arrays(inputs, result),
        record={"disc_degrees": round(disc, 4), "shading": None if np.isnan(mean) else round(mean, 4)},
        counts={"observed pixels": int(observed.sum()), "observations": int(result.observations.sum())},
        warnings=_warnings(observed, mask, cache.frames, mean, rings_deg(size)[0][1]),
    )


def read_highlights(saved: StageResult) -> HighlightLevels:
    """Read the levels of highlights that the stage `thresholds` saved."""
    record = saved.record
    return HighlightLevels(saved.read("thresholds"), float(record["saturation_level"]), float(record["threshold"]))


def cluster_tile(task: tuple[Tile, HighlightLevels], shared: SharedInputs) -> Clusters:
    """Cluster one tile, read from the cache of frames; the task names its place and the levels of its highlights."""
    (rows, columns), highlights = task
    cache = FrameCache.open(Location.parse(shared.store), shared.digest)
    return cluster_pixels(
        cache.read(OBJECT, rows=rows, columns=columns),
        highlights,
        shared.half_vectors,
        shared.weights,
        clusters=shared.parameters.clusters,
        radius_deg=shared.disc_deg,
        separation=shared.parameters.separation,
        rings=shared.rings,
        discs=shared.discs,
    )


def empty_clusters(count: int, shape: tuple[int, ...]) -> Clusters:
    """Return clusters (`count` per pixel) of a region (H, W) in which nothing was observed."""
    vectors, scalars = (count, *shape, 3), (count, *shape)
    return Clusters(
        np.full(vectors, np.nan, np.float32),
        np.zeros(scalars, np.float32),
        np.full(scalars, np.nan, np.float32),
        np.zeros(scalars, np.int32),
        np.zeros(shape, np.int32),
        np.full((*shape, 3), np.nan, np.float32),
        np.full(scalars, np.nan, np.float32),
    )


def paste(result: Clusters, tile: Tile, part: Clusters) -> None:
    """Write a tile's clusters into the region's."""
    for name in ("normals", "weight", "spread", "count", "shading"):
        getattr(result, name)[:, tile[0], tile[1]] = getattr(part, name)
    for name in ("observations", "winner"):
        getattr(result, name)[tile] = getattr(part, name)


def disc_deg(results: CaptureResults) -> float:
    """Return the radius in degrees of the discs in which half vectors were clustered; a record without it is of a usual
    light."""
    return float(results.load("clusters").record.get("disc_degrees", USUAL_DISC_DEG))


def load_clusters(results: CaptureResults) -> Clusters:
    """Load the clusters that were saved."""
    return read_clusters(results.load("clusters"))


def read_clusters(saved: StageResult) -> Clusters:
    """Read the clusters that the stage `clusters` saved."""
    return Clusters(**{field.name: saved.read(field.name) for field in fields(Clusters)})


def faced(clusters: Clusters, view: np.ndarray | None) -> Clusters:
    """Return clusters as seen along view vectors (H, W, 3); None: an orthographic camera's, unchanged."""
    return replace(
        clusters, normals=rotate_to_view(clusters.normals, view), winner=rotate_to_view(clusters.winner, view)
    )


def _arrays(inputs: StageInputs, result: Clusters) -> dict[str, np.ndarray]:
    """Return the arrays to save, their half vectors corrected for a near light and turned into normals."""
    geometry, near_light = load_geometry(inputs), load_near_light(inputs)
    vectors = {"normals": result.normals, "winner": result.winner}
    if near_light is not None:
        grid = np.indices(result.observations.shape)
        columns, rows = grid[1] + geometry.region.x, grid[0] + geometry.region.y
        vectors = {name: near_light.half_vectors_at(values, columns, rows) for name, values in vectors.items()}
    view = geometry.view_vectors
    if view is not None:
        vectors = {name: half_vectors_for_view(values, view) for name, values in vectors.items()}
    return {field.name: getattr(result, field.name) for field in fields(result)} | vectors


def _warnings(
    observed: np.ndarray, mask: np.ndarray, frames: int, shading: float, beside_deg: float
) -> list[StageWarning]:
    """Warn of an object that shows shading instead of highlights, and otherwise of one that shows few highlights.

    beside_deg: where shading was measured, degrees of half vector from a highlight.
    """
    if shading > MAX_SHADING:
        message = (
            f"the object shows shading, not highlights: {beside_deg:.0f} degrees of half vector beside them its"
            f" pixels keep {shading:.0%} of their rise, glass and polished metal less than {MAX_SHADING:.0%}. It is"
            " matte or rough, or overexposed: all normals come from the silhouette. Use photometric stereo for it"
        )
        return [StageWarning(message, "highlights", MATTE_COST_DEG)]
    share = observed.sum() / mask.sum()
    if share > MIN_OBSERVED_SHARE:
        return []
    if frames < MIN_SWEEP_FRAMES:
        message = (
            f"{frames} photographs show highlights on {share:.0%} of the object, the normals between are interpolated:"
            " take more, with the light in other places"
        )
    else:
        message = (
            f"only {share:.0%} of the object showed a highlight: record for longer, with a brighter light or exposure,"
            " sweep the light over the whole hemisphere before the object, and check that the mask lies on the object"
        )
    return [StageWarning(message, "coverage", EXTRAPOLATED_ERROR_DEG)]
