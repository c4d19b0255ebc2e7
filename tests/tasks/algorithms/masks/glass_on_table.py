"""A glass ring on a textured table under a moving light, drawn from formulas: frames whose mask is known.

The table follows the light as a whole, with a soft shadow that moves around the ring; the ring shows a flash that
moves over it and refracts the table: its texture is another one, lit otherwise. A clear wall around it shows the table
as it is, but for the line of its outer face, or refracts a table of streaks. A lamp may pass through the picture.
"""

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

CENTRE, OUTER, INNER = (90.0, 90.0), 62.0, 26.0
LAMP_RADIUS, LAMP_FRAMES = 18.0, 12
CAST_PX = 16.0
"""Distance at which a shadow falls from what casts it."""
FLASH_PX = 9
"""Pixels from a flash beyond which it is darker than the darkest glass."""
LINE_DEPTH = 0.4
"""Share of the light that the outer face of a wall takes."""


@dataclass(frozen=True, slots=True)
class GlassScene:
    """frames (T, H, W) uint8, mask (H, W) bool of the ring, sphere: x, y and radius of the chrome sphere."""

    frames: np.ndarray
    mask: np.ndarray
    sphere: tuple[float, float, float]


@cache
def draw_glass(
    frames: int = 200,
    width: int = 270,
    height: int = 180,
    inner: float = INNER,
    shadow: float = 0.1,
    cast: float = 0.0,
    blur: float = 0.0,
    wall: float = 0.0,
    streaks: bool = False,
    lamp: float | None = None,
    seed: int = 0,
) -> GlassScene:
    """Draw the scene, once for each set of options: it can only be read.

    inner: radius of the ring's hole, 0 for a disc; shadow: its depth beside the ring, 0 to 1; cast: depth of the whole
    disc's shadow, which falls away from the light; blur: standard deviation in pixels of the optics' blur; wall: width
    in pixels of a clear wall around the ring; streaks: whether the table has streaks along its rows, which the wall
    turns upright, without a line; lamp: x of a lamp that passes from top to bottom, None for none.
    """
    generator = np.random.default_rng(seed)
    table, refracted = (_texture(generator, (height, width), (9.0, 2.0) if streaks else (4.0, 4.0)) for _ in range(2))
    rows, columns = np.mgrid[:height, :width].astype(np.float32)
    distance = np.hypot(columns - CENTRE[0], rows - CENTRE[1])
    if streaks:
        turned = _texture(generator, (height, width), (2.0, 9.0))
        table = np.where((distance >= OUTER) & (distance < OUTER + wall), turned, table)
    cover = np.clip(OUTER + 0.5 - distance, 0, 1) * (np.clip(distance - inner + 0.5, 0, 1) if inner else 1.0)
    sphere = (225.0, 90.0, 20.0)
    on_sphere = np.hypot(columns - sphere[0], rows - sphere[1]) < sphere[2]
    angle = np.arctan2(rows - CENTRE[1], columns - CENTRE[0])
    beside = shadow * np.exp(-(((distance - OUTER) / 25.0) ** 2))
    line = 1.0 - LINE_DEPTH * np.exp(-0.5 * (distance - OUTER - wall + 0.5) ** 2)
    pictures = []
    for number, time in enumerate(np.linspace(0.0, 1.0, frames, endpoint=False)):
        turn, light = 2.0 * np.pi * 9.0 * time, 0.75 + 0.25 * np.cos(2.0 * np.pi * 2.0 * time)
        shade = 1.0 - beside * np.clip(np.cos(angle - turn), 0, 1)
        picture = table * light * shade
        if cast:
            far = np.hypot(columns - CENTRE[0] + CAST_PX * np.cos(turn), rows - CENTRE[1] + CAST_PX * np.sin(turn))
            picture *= 1.0 - cast * np.clip(OUTER + 0.5 - far, 0, 1)
        glass = 0.5 * refracted * (0.6 + 0.4 * np.sin(2.0 * np.pi * 3.0 * time)) + 20.0
        # The flash runs around while it moves from the hole to the contour and back.
        radius = inner + (OUTER - inner) * abs(1.0 - 2.0 * time)
        x, y = CENTRE[0] + radius * np.cos(turn), CENTRE[1] + radius * np.sin(turn)
        for flash_x, flash_y in ((x, y), (CENTRE[0] + OUTER * np.cos(-turn), CENTRE[1] + OUTER * np.sin(-turn))):
            near = _around(flash_x, flash_y, FLASH_PX)
            flash = 400.0 * np.exp(-((columns[near] - flash_x) ** 2 + (rows[near] - flash_y) ** 2) / 18.0)
            glass[near] = np.maximum(glass[near], flash)
        picture = picture * (1.0 - cover) + glass * cover
        if wall and not streaks:
            picture *= line
        picture[on_sphere] = 30.0
        x, y = sphere[0] + 8 * np.cos(turn), sphere[1] + 8 * np.sin(turn)
        near = _around(x, y, 4)
        picture[near][np.hypot(columns[near] - x, rows[near] - y) < 3] = 255.0
        if lamp is not None and number < LAMP_FRAMES:
            lamp_row = height * (number + 0.5) / LAMP_FRAMES
            picture[np.hypot(columns - lamp, rows - lamp_row) < LAMP_RADIUS] = 255.0
        if blur:
            picture = cv2.GaussianBlur(picture, (0, 0), blur)
        pictures.append(picture + generator.normal(0.0, 1.5, picture.shape))
    stack = np.clip(np.rint(pictures), 0, 255).astype(np.uint8)
    mask = (cover > 0.5) | ((distance >= inner) & (distance < OUTER + wall))
    for array in (stack, mask):
        array.flags.writeable = False
    return GlassScene(stack, mask, sphere)


def _around(x: float, y: float, reach: int) -> tuple[slice, slice]:
    """Return the rows and columns up to `reach` pixels from a place inside the picture."""
    column, row = round(x), round(y)
    return slice(max(row - reach, 0), row + reach + 1), slice(max(column - reach, 0), column + reach + 1)


def _texture(generator: np.random.Generator, shape: tuple[int, int], sigmas: tuple[float, float]) -> np.ndarray:
    """Return levels (H, W) smooth over standard deviations along the rows and along the columns."""
    noise = cv2.GaussianBlur(generator.normal(0.0, 1.0, shape).astype(np.float32), (0, 0), sigmas[0], sigmaY=sigmas[1])
    return np.clip(80.0 + 25.0 * noise / noise.std(), 20.0, 160.0)
