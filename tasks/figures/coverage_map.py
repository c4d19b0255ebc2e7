"""Draw a capture's coverage: the light hemisphere as seen from the camera."""

import cv2
import numpy as np

from glint.tasks.algorithms.geometry.vectors import equal_area
from glint.tasks.algorithms.lighting.coverage import (
    CAP_MAP_RADIUS,
    Coverage,
    cap_directions,
    nearest_half_vector_deg,
)

Colour = tuple[int, int, int]
WHITE, GREY, BLACK, RED = (255, 255, 255), (60, 60, 60), (20, 20, 20), (225, 60, 50)
HATCHED_DEG = 6.0
"""Angle to the nearest half vector beyond which the map is hatched."""
RING_LABELS_DEG = (30, 60, 90)
"""Angles of the light from the camera axis that are drawn as rings."""
MAX_DOTS = 3000
"""Frames that are drawn as dots; of more frames, every n-th."""


def draw_coverage(result: Coverage, half_vectors: np.ndarray, *, size: int = 640) -> np.ndarray:
    """Return a picture (size, size, 3) uint8 RGB of the density, with frames as dots and gaps hatched in red.

    The radius is the equal-area distance of the half vector; rings name the light's angle from the camera axis.

    Args:
        result: coverage by the half vectors.
        half_vectors: (T, 3), NaN where the frame was rejected.
        size: edge of the picture in pixels.
    """
    picture = np.full((size, size, 3), 255, np.uint8)
    half = int(size * 0.40)
    middle = (size // 2, size // 2)
    left, upper = middle[0] - half, middle[1] - half
    _draw_density(picture[upper : upper + 2 * half, left : left + 2 * half], result, half_vectors)
    _draw_rings(picture, middle, half)
    known = half_vectors[np.isfinite(half_vectors).all(axis=-1)]
    flat = equal_area(known) / CAP_MAP_RADIUS * half
    for x, y in flat[:: max(1, len(flat) // MAX_DOTS)]:
        cv2.circle(picture, (int(middle[0] + x), int(middle[1] - y)), 1, WHITE, -1, cv2.LINE_AA)
    for text, x, y in (("top", 0, -1), ("bottom", 0, 1), ("left", -1, 0), ("right", 1, 0)):
        position = (middle[0] + int(x * half * 1.11), middle[1] + int(y * half * 1.06))
        _write(picture, text, position, GREY, is_centred=True)
    shares = ", ".join(f"{share:.0%} within {limit:g} degrees" for limit, share in result.covered_shares.items())
    _write(picture, f"{result.frames} lights; of the observable normals {shares}", (12, 22), BLACK)
    legend = "rings: light's angle from the camera axis, degrees; red: no light"
    _write(picture, legend, (12, size - 12), BLACK)
    return picture


def _draw_density(area: np.ndarray, result: Coverage, half_vectors: np.ndarray) -> None:
    """Draw the density and the hatched gaps into the cap's square (N, N, 3) of the picture, in place."""
    edge = len(area)
    density = cv2.resize(np.nan_to_num(result.density), (edge, edge), interpolation=cv2.INTER_LINEAR)
    directions = cap_directions(edge)
    inside = np.isfinite(directions[..., 0])
    peak = np.percentile(density[inside], 98.0) if inside.any() and density.max() > 0 else 1.0
    levels = (np.clip(density / peak, 0, 1) ** 0.5 * 255).astype(np.uint8)
    area[inside] = cv2.applyColorMap(levels, cv2.COLORMAP_VIRIDIS)[..., ::-1][inside]
    distance = nearest_half_vector_deg(directions, half_vectors)
    rows, columns = np.mgrid[:edge, :edge]
    area[inside & (distance > HATCHED_DEG) & ((rows + columns) % 10 < 3)] = RED


def _draw_rings(picture: np.ndarray, middle: tuple[int, int], half: int) -> None:
    """Draw rings of equal angles of the light; the outermost is the edge of the cap."""
    for light_deg in RING_LABELS_DEG:
        is_edge = light_deg == RING_LABELS_DEG[-1]
        radius = int(half * 2.0 * np.sin(np.radians(light_deg) / 4.0) / CAP_MAP_RADIUS)
        cv2.circle(picture, middle, radius, GREY if is_edge else WHITE, 1, cv2.LINE_AA)
        position = (middle[0] + int(0.72 * radius) + 3, middle[1] + int(0.72 * radius) + (12 if is_edge else 0))
        _write(picture, f"{light_deg}", position, GREY if is_edge else WHITE)


def _write(
    picture: np.ndarray, text: str, position: tuple[int, int], colour: Colour, *, is_centred: bool = False
) -> None:
    """Write a text whose size follows the picture's, with its lower left corner or its centre at `position`."""
    scale = len(picture) / 1400.0
    if is_centred:
        width, height = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)[0]
        position = (position[0] - width // 2, position[1] + height // 2)
    cv2.putText(picture, text, position, cv2.FONT_HERSHEY_SIMPLEX, scale, colour, 1, cv2.LINE_AA)
