"""Sheets that fill the picture, seen orthographically: steps that fade out of a slope, and risers, which are none."""

import numpy as np

from tests.benchmarks.integration_scenes import Scene

FADE = 0.05, 0.7
"""Rows, as shares of the picture, between which the steps of stairs fade out. The upper end is the nearer one to the
picture's edge: by their normals, steps that fade out upwards and have their full height below would be as good."""


def stairs(size: int, step: float, count: int = 3, bend: float = 0.0, tilt: float = 0.0) -> Scene:
    """Draw treads that rise out of one slope: `step` is the height of each step in sizes of the picture.

    The steps have their full height along the upper edge and fade out towards the lower one: to cut across a tread
    would take a longer step than to continue the true ones. `bend` and `tilt` shape the slope.
    """
    rows, columns = np.indices((size, size)) / size
    share = np.clip((FADE[1] - rows) / (FADE[1] - FADE[0]), 0.0, 1.0)
    rise, slope = share * share * (3 - 2 * share), 6 * share * (share - 1) / (FADE[1] - FADE[0])
    tread = np.minimum((columns * count).astype(int), count - 1)
    # Treads rise in an uneven order, so that steps lead up and down.
    level = np.array([0.0, 2.0, 1.0, 3.0, 2.0, 0.0, 1.0, 3.0])[tread] * step
    height = level * rise + bend * ((columns - 0.5) ** 2 + (rows - 0.5) ** 2) + tilt * columns
    p, q = 2 * bend * (columns - 0.5) + tilt, level * slope + 2 * bend * (rows - 0.5)
    borders = [int(np.argmax(tread[0] == k)) for k in range(1, count)]
    steps = tuple((slice(0, size // 20), border - 1) for border in borders)
    return _sheet(height * size, p, q, steps)


def flap(size: int, lift: float, bend: float = 0.3) -> Scene:
    """Draw a sheet with a flap that is cut out on three sides and bends up by `lift` sizes: its steps fade out."""
    rows, columns = np.indices((size, size)) / size
    inside = (columns > 0.3) & (columns < 0.68) & (rows > 0.2) & (rows < 0.7)
    share = np.where(inside, (0.7 - rows) / 0.5, 0.0)
    height = lift * share**2 + bend * ((columns - 0.5) ** 2 + (rows - 0.5) ** 2)
    p, q = 2 * bend * (columns - 0.5), -4 * lift * share + 2 * bend * (rows - 0.5)
    return _sheet(height * size, p, q)


def risers(size: int, width: int, slope: float, count: int = 4) -> Scene:
    """Draw treads between risers that are seen: `width` pixels wide, with borders half-way between two pixels."""
    period = size // count
    across = np.where(np.arange(size) % period >= period - width, slope, 0.1)
    height = np.concatenate([[0.0], np.cumsum((across[1:] + across[:-1]) / 2)])
    down = 0.05 * np.arange(size)[:, None]
    return _sheet(height + down, np.broadcast_to(across, (size, size)), np.full((size, size), 0.05))


def _sheet(height: np.ndarray, p: np.ndarray, q: np.ndarray, steps: tuple[tuple[slice, int], ...] = ()) -> Scene:
    """Complete an orthographic scene that fills the picture by its height and its slopes to the right and downwards."""
    normals = np.stack([-p, q, np.ones_like(p)], axis=-1)
    whole = np.ones(height.shape, bool)
    return Scene(normals / np.linalg.norm(normals, axis=-1, keepdims=True), whole, None, height, whole, steps)
