"""Clusters: candidate normals of every pixel, by tiles that any worker can take."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from glint.storage.frames.cache import FrameCache
from glint.storage.locations.location import Location
from glint.tasks.algorithms.candidates.clusters import Clusters, cluster_pixels, inverse_density_weights
from glint.tasks.algorithms.geometry.perspective import half_vectors_for_view, rotate_to_view
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.parameters import Clusters as Parameters
from glint.tasks.engine.stage import Outcome, Progress
from glint.tasks.stages.frames import OBJECT, bars_of, open_frames, region_of, views_of
from glint.tasks.stages.lights import near_lamp_of

Mapper = Callable[[Callable[[Any, Any], Any], Iterable[Any], Any], Iterable[Any]]
"""Applies a function to each of the tasks and to what they have in common, anywhere; gives results in their order."""
TILE = 64
TILE_BYTES = 96 << 20
"""Most bytes of frames that one tile holds."""

Tile = tuple[slice, slice]


@dataclass(frozen=True, slots=True)
class Common:
    """What all tiles share: where the frames are, half_vectors (T, 3) and shares (T,) of the lights."""

    store: str
    digest: str
    half_vectors: np.ndarray
    shares: np.ndarray
    parameters: Parameters


def one_by_one(function: Callable[[Any, Any], Any], tasks: Iterable[Any], common: Any) -> Iterator[Any]:
    """The mapper of this process alone."""
    return (function(task, common) for task in tasks)


def clusters(work: Workspace, progress: Progress, mapper: Mapper = one_by_one) -> Outcome:
    """Cluster every pixel of the mask, tile by tile.

    Raises:
        UnusableCapture: the object never glints, or is saturated all the time.
    """
    cache, mask = open_frames(work), work.load("mask").read("mask")
    half_vectors = work.load("lights").read("half_vectors")
    parameters = work.parameters.clusters
    bars = bars_of(work, cache, mask)
    shares = inverse_density_weights(half_vectors, parameters.within)
    tiles = [tile for tile in tiles_of(mask.shape, cache.frames * cache.bits // 8) if mask[tile].any()]
    common = Common(work.store, cache.digest, half_vectors, shares, parameters)
    tasks = [(tile, bars[tile]) for tile in tiles]
    result = empty(parameters.clusters, mask.shape)
    for done, (tile, found) in enumerate(zip(tiles, mapper(cluster_tile, tasks, common), strict=True), 1):
        place(result, tile, found)
        progress(done, len(tiles))
    region, lamp = region_of(work), near_lamp_of(work)
    seen = {"normals": result.normals, "winner": result.winner}
    if lamp is not None:
        grid = np.indices(mask.shape)
        columns, rows = grid[1] + region.x, grid[0] + region.y
        seen = {name: lamp.half_vectors_at(found, columns, rows) for name, found in seen.items()}
    view = views_of(work)
    if view is not None:
        seen = {name: half_vectors_for_view(found, view) for name, found in seen.items()}
    arrays = {each.name: getattr(result, each.name) for each in fields(result)} | seen
    observed = (result.observations > 0) & mask
    return Outcome(
        arrays=arrays,
        counts={"observed pixels": int(observed.sum()), "observations": int(result.observations.sum())},
        warnings=_warnings(observed, mask),
    )


def cluster_tile(task: tuple[Tile, np.ndarray], common: Common) -> Clusters:
    """Clusters of one tile, read from the cache of frames; the task names its place and bars."""
    (rows, columns), bars = task
    cache = FrameCache.open(Location.parse(common.store), common.digest)
    return cluster_pixels(
        cache.read(OBJECT, rows=rows, columns=columns),
        bars,
        common.half_vectors,
        common.shares,
        clusters=common.parameters.clusters,
        radius_deg=common.parameters.radius,
        separation=common.parameters.apart,
    )


def tiles_of(shape: tuple[int, ...], pixel_bytes: int) -> Iterator[Tile]:
    """Tiles of a region (H, W) of `pixel_bytes` over all frames: whole rows of chunks, or less where that is too much.

    Chunks are 64 pixels wide; a video so long that one of them exceeds the memory of a tile is cut finer.
    """
    height, width = shape
    tall = TILE
    while tall > 1 and tall * min(TILE, width) * pixel_bytes > TILE_BYTES:
        tall //= 2
    wide = TILE * max(1, min(-(-width // TILE), TILE_BYTES // (tall * TILE * pixel_bytes)))
    for top in range(0, height, tall):
        for left in range(0, width, wide):
            yield slice(top, min(top + tall, height)), slice(left, min(left + wide, width))


def empty(count: int, shape: tuple[int, ...]) -> Clusters:
    """Clusters (`count` per pixel) of a region (H, W) in which nothing was observed."""
    vectors, scalars = (count, *shape, 3), (count, *shape)
    return Clusters(
        np.full(vectors, np.nan, np.float32),
        np.zeros(scalars, np.float32),
        np.full(scalars, np.nan, np.float32),
        np.zeros(scalars, np.int32),
        np.zeros(shape, np.int32),
        np.full((*shape, 3), np.nan, np.float32),
    )


def place(result: Clusters, tile: Tile, found: Clusters) -> None:
    """Write a tile's clusters into the region's."""
    for each in ("normals", "weight", "spread", "count"):
        getattr(result, each)[:, tile[0], tile[1]] = getattr(found, each)
    for each in ("observations", "winner"):
        getattr(result, each)[tile] = getattr(found, each)


def load_clusters(work: Workspace) -> Clusters:
    """What was saved."""
    saved = work.load("clusters")
    return Clusters(**{each.name: saved.read(each.name) for each in fields(Clusters)})


def faced(clusters: Clusters, view: np.ndarray) -> Clusters:
    """Clusters as seen along view vectors (H, W, 3)."""
    return replace(
        clusters, normals=rotate_to_view(clusters.normals, view), winner=rotate_to_view(clusters.winner, view)
    )


def _warnings(observed: np.ndarray, mask: np.ndarray) -> list[str]:
    share = observed.sum() / mask.sum()
    if share > 0.3:
        return []
    return [
        f"only {share:.0%} of the object glinted: film for longer, with a brighter lamp or exposure, and sweep the lamp"
        " over the whole hemisphere before the object"
    ]
