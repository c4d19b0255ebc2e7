"""Range scans in PLY grids, with their poses, as views and depth maps."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from glint.tasks.algorithms.multiview.mesh import Model, vertex_normals
from glint.tasks.algorithms.multiview.raycast import raycast
from glint.tasks.algorithms.multiview.view import SilhouetteMask, View

PIXEL = 0.5
"""Millimetres of the depth maps' pixels, about the scans' own spacing."""
LONGEST = 3.0
"""Millimetres: longer triangles bridge a step between near and far."""


def read_scan(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (N, 3) in mm and triangles (M, 3), wound towards the scanner, of a range grid."""
    lines = path.read_text().splitlines()
    head = lines.index("end_header")
    sizes = {line.split()[-2]: int(line.split()[-1]) for line in lines[:head] if line.startswith("obj_info num_")}
    sizes |= {line.split()[1]: int(line.split()[2]) for line in lines[:head] if line.startswith("element")}
    count = sizes["vertex"]
    vertices = 1000.0 * np.array([line.split()[:3] for line in lines[head + 1 : head + 1 + count]], float)
    cells = np.full(sizes["range_grid"], -1)
    for cell, line in enumerate(lines[head + 1 + count : head + 1 + count + len(cells)]):
        said = line.split()
        if said[0] == "1":
            cells[cell] = int(said[1])
    grid = cells.reshape(sizes["num_rows"], sizes["num_cols"])
    here, right, below, across = grid[:-1, :-1], grid[:-1, 1:], grid[1:, :-1], grid[1:, 1:]
    both = np.concatenate(
        [np.stack(each, axis=-1).reshape(-1, 3) for each in ((here, across, below), (here, right, across))]
    )
    both = both[(both >= 0).all(axis=1)]
    corners = vertices[both]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    both, corners = both[longest < LONGEST], corners[longest < LONGEST]
    away = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] < 0
    both[away] = both[away][:, ::-1]
    return vertices, both


def read_poses(path: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Rotation (3, 3) and translation (3,) in mm by file name, scan to world: the quaternions' w has the other sign."""
    poses = {}
    for line in path.read_text().splitlines():
        said = line.split()
        if said and said[0] == "bmesh":
            *translation, x, y, z, w = map(float, said[2:])
            poses[said[1]] = Rotation.from_quat([x, y, z, -w]).as_matrix(), 1000.0 * np.array(translation)
    return poses


def view_of_scan(name: str, folder: Path) -> tuple[View, np.ndarray]:
    """The view of a scan and its depth map (H, W) in mm."""
    vertices, triangles = read_scan(folder / name)
    rotation, translation = read_poses(folder / "bun.conf")[name]
    reach = np.abs(vertices[:, :2]).max(axis=0)
    width, height = (2 * np.ceil(reach / PIXEL) + 3).astype(int).tolist()
    everything = SilhouetteMask(np.ones((height, width), bool))
    # The camera frame is the scanner's: the world is rotated back into it.
    view = View(name, everything, np.zeros((height, width, 3)), np.zeros((height, width)), rotation.T,
                -rotation.T @ translation, (0, 0), (width, height), PIXEL)  # fmt: skip
    unseen = np.zeros(len(vertices))
    world = vertices @ rotation.T + translation
    scan = Model(world, triangles, vertex_normals(world, triangles), unseen, unseen, PIXEL)
    depth, normals = raycast(scan, view)
    confidence = np.nan_to_num(normals[..., 2]).astype(np.float32)
    return view.with_mask(np.isfinite(depth)).with_normals(normals, confidence), depth
