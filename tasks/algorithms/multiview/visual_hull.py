"""The visual hull: the largest body that agrees with all silhouettes (Laurentini 1994, shape from silhouette).

A point's signed distance to a view's silhouette, negative inside, bounds the surface from outside. The maximum over all
views is the hull's implicit function; its zero set is the hull.
"""

from collections.abc import Callable, Sequence

import numpy as np

from glint.tasks.algorithms.errors import UnusableCapture
from glint.tasks.algorithms.meshing.implicit import surface_nets
from glint.tasks.algorithms.multiview.mesh import Model, largest_component, vertex_normals
from glint.tasks.algorithms.multiview.view import View

COARSE_SAMPLES = 48
"""Samples along each side of the coarse grid on which the hull is located."""
SPHERE_MARGIN = 1.2
"""Radius of the bounding sphere relative to half the largest diagonal of the masks' bounding boxes."""
MAX_VERTICES = 24_000
"""Vertices of the mesh that is refined; detail below its edges comes from the last Poisson reconstruction."""
FIRST_CELLS = 40
"""Cells along an edge of a cube of the bounding box's volume in the mesh by which the size of the cells is chosen."""
MAX_CELL_LOG_RATIO = 0.1
"""Logarithm of the ratio of the chosen cells to the first up to which the first mesh is kept."""
MIN_HULL_EDGE_PX = 1.0
"""Finest edge of a mesh in pixels: the masks hold nothing finer."""


def hull_field(views: Sequence[View], base: float | None = None) -> Callable[[np.ndarray], np.ndarray]:
    """Return the hull as a function of points (N, 3): signed distance (N,) in world units, negative inside.

    base: the height y of a plane on which the object stands; it bounds the hull too.
    """

    def field(points: np.ndarray) -> np.ndarray:
        value = np.full(len(points), -np.inf) if base is None else base - points[:, 1]
        for view in views:
            distance = view.silhouette.distance.at(*view.project(points))
            np.maximum(value, distance * view.footprint(points), out=value)
        return value

    return field


def bounding_box(views: Sequence[View], base: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return the lower and upper corners (3,) of a box that contains the hull with a small margin, world units.

    base: as of `hull_field`.

    Raises:
        UnusableCapture: the silhouettes have no point in common.
    """
    centre, radius = bounding_sphere(views)
    field = hull_field(views, base)
    low, high = centre - radius, centre + radius
    # The second grid lies in the box of the first, so that its cells are small against the object.
    for _ in range(2):
        axes = [np.linspace(start, end, COARSE_SAMPLES) for start, end in zip(low, high, strict=True)]
        cell = (high - low) / (COARSE_SAMPLES - 1)
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        # A hull thinner than a cell still has samples within a cell's diagonal.
        inside = grid[field(grid) < np.linalg.norm(cell)]
        if not len(inside):
            raise UnusableCapture(
                "the silhouettes of the views have no point in common", "check the poses, and the masks"
            )
        low, high = np.maximum(inside.min(axis=0) - cell, low), np.minimum(inside.max(axis=0) + cell, high)
    return low, high


def bounding_sphere(views: Sequence[View]) -> tuple[np.ndarray, float]:
    """Return centre (3,) and radius, world units, of a sphere that contains the object.

    The centre is the point nearest to the rays through the centres of the masks' bounding boxes, by least squares.
    """
    matrix, right_side = np.zeros((3, 3)), np.zeros(3)
    half_diagonals = []
    for view in views:
        rows, columns = np.nonzero(view.mask)
        centre = np.array([(columns.min() + columns.max()) / 2]), np.array([(rows.min() + rows.max()) / 2])
        start, direction = (vectors[0] for vectors in view.rays(*centre))
        across = np.eye(3) - np.outer(direction, direction)
        matrix, right_side = matrix + across, right_side + across @ start
        half_diagonals.append(float(np.hypot(np.ptp(columns), np.ptp(rows)) / 2))
    # Parallel rays leave the position along them open; the small multiple of the identity keeps it at the origin.
    centre_point = np.linalg.solve(matrix + 1e-9 * np.eye(3), right_side)
    radii = [
        half_diagonal * float(view.footprint(centre_point[None])[0])
        for view, half_diagonal in zip(views, half_diagonals, strict=True)
    ]
    return centre_point, SPHERE_MARGIN * max(radii)


def hull_model(views: Sequence[View], max_vertices: int = MAX_VERTICES, base: float | None = None) -> Model:
    """Mesh the hull with about `max_vertices` vertices; confidence 0 and source -1 everywhere.

    base: as of `hull_field`.

    Raises:
        UnusableCapture: the silhouettes have no point, or hardly one, in common.
    """
    low, high = bounding_box(views, base)
    pixel = float(np.median([view.footprint((low + high)[None] / 2)[0] for view in views]))
    field = hull_field(views, base)
    cell = max(MIN_HULL_EDGE_PX * pixel, float(np.prod(high - low) ** (1 / 3)) / FIRST_CELLS)
    vertices, triangles = surface_nets(field, low, high, cell)
    # The number of vertices of a surface grows with the inverse square of the cell.
    finer_cell = cell * np.sqrt(len(vertices) / max_vertices)
    if len(vertices) and abs(np.log(finer_cell / cell)) > MAX_CELL_LOG_RATIO:
        cell = max(MIN_HULL_EDGE_PX * pixel, float(finer_cell))
        vertices, triangles = surface_nets(field, low, high, cell)
    if len(vertices) < 4:
        raise UnusableCapture("the silhouettes of the views have hardly a point in common", "check the poses")
    vertices, triangles = largest_component(vertices, triangles)
    unseen = np.zeros(len(vertices))
    return Model(vertices, triangles, vertex_normals(vertices, triangles), unseen, np.full(len(vertices), -1), cell)
