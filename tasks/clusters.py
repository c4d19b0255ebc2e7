"""Clusters: candidate normals of every pixel, by tiles that any worker can take."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields
from typing import Any

import numpy as np

from storage.frames import FrameCache
from storage.location import Location
from tasks.algorithms.clusters import Clusters, cluster_pixels, light_shares
from tasks.algorithms.perspective import towards
from tasks.frames import OBJECT, bars_of, open_frames, region_of
from tasks.parameters import Clusters as Parameters
from tasks.stage import Outcome, Progress
from tasks.workspace import Workspace

Mapper = Callable[[Callable[..., Any], Iterable[Any]], Iterable[Any]]
"""Applies a function to each task, anywhere, in any order of execution, and gives the results in the tasks' order."""
TILE = 64
TILE_BYTES = 96 << 20
"""Most bytes of frames that one tile holds."""

Tile = tuple[slice, slice]


def clusters(work: Workspace, progress: Progress, mapper: Mapper = map) -> Outcome:
    """Cluster every pixel of the mask, tile by tile.

    Raises:
        UnusableCapture: the object never glints, or is saturated all the time.
    """
    cache, mask = open_frames(work), work.load("mask").read("mask")
    half_vectors = work.load("lights").read("half_vectors")
    parameters = work.parameters.clusters
    bars = bars_of(work, cache, mask)
    shares = light_shares(half_vectors, parameters.within)
    tiles = [tile for tile in tiles_of(mask.shape, cache.frames * cache.bits // 8) if mask[tile].any()]
    tasks = [(work.store, cache.digest, tile, bars[tile], half_vectors, shares, parameters) for tile in tiles]
    result = empty(parameters.clusters, mask.shape)
    for done, (tile, found) in enumerate(zip(tiles, mapper(cluster_tile, tasks), strict=True), 1):
        place(result, tile, found)
        progress(done, len(tiles))
    normals = towards(result.normals, work.camera_matrix, region_of(work).x, region_of(work).y)
    arrays = {each.name: getattr(result, each.name) for each in fields(result)} | {"normals": normals}
    observed = (result.observations > 0) & mask
    return Outcome(
        arrays=arrays,
        counts={"observed pixels": int(observed.sum()), "observations": int(result.observations.sum())},
        warnings=_warnings(observed, mask),
    )


def cluster_tile(task: tuple[str, str, Tile, np.ndarray, np.ndarray, np.ndarray, Parameters]) -> Clusters:
    """Clusters of one tile, read from the cache of frames."""
    store, digest, (rows, columns), bars, half_vectors, shares, parameters = task
    frames = FrameCache.open(Location.parse(store), digest).read(OBJECT, rows=rows, columns=columns)
    return cluster_pixels(
        frames,
        bars,
        half_vectors,
        shares,
        clusters=parameters.clusters,
        radius=parameters.radius,
        apart=parameters.apart,
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


def _warnings(observed: np.ndarray, mask: np.ndarray) -> list[str]:
    share = observed.sum() / mask.sum()
    if share > 0.3:
        return []
    return [
        f"only {share:.0%} of the object glinted: film for longer, with a brighter lamp or exposure, and sweep the lamp"
        " over the whole hemisphere before the object"
    ]
