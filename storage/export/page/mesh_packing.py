"""A mesh for the page: decimated if it is large, quantized, packed."""

from typing import Any

import numpy as np

from glint.storage.export.mesh_files import Mesh
from glint.storage.export.page.packing import Part, confidence_codes, octahedral, pack

CELL_GROWTH = 1.15
"""Factor by which the cells of the decimation grow until few enough triangles are left."""


def pack_mesh(mesh: Mesh, max_triangles: int) -> tuple[dict[str, Any], dict[str, Part]]:
    """Return what the viewer must know of a mesh, and its packed arrays by name.

    Positions are rounded to 1/65535 of the mesh's longest side.
    """
    shown = decimated(mesh, max_triangles)
    low, high = shown.vertices.min(axis=0).astype(float), shown.vertices.max(axis=0).astype(float)
    step = max(float((high - low).max()), 1e-9) / 65535.0
    positions = np.rint((shown.vertices - low) / step).astype(np.uint16)
    # Every corner as the difference from the triangle's first one, which `pack` follows from triangle to triangle.
    corners = shown.triangles.astype(np.uint32)
    corners[:, 1:] -= corners[:, :1]
    parts = {
        "positions": pack(positions[None]),
        "vertex_normals": pack(octahedral(shown.normals)[None]),
        "triangles": pack(corners[None]),
    }
    if np.isfinite(shown.confidence).any():
        parts["vertex_confidence"] = pack(confidence_codes(shown.confidence)[None])
    facts = {
        "origin": low.tolist(),
        "step": step,
        "unit": mesh.unit,
        "vertices": len(mesh.vertices),
        "triangles": len(mesh.triangles),
        "shown_triangles": len(shown.triangles),
    }
    return facts, parts


def decimated(mesh: Mesh, max_triangles: int) -> Mesh:
    """Return the mesh with at most `max_triangles` triangles: vertices of a cell become one (Rossignac 1993).

    A cell takes the mean of its vertices' positions and normals, and the lowest of their confidences.
    """
    if len(mesh.triangles) <= max_triangles:
        return mesh
    corners = mesh.vertices[mesh.triangles].astype(float)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1).sum() / 2.0
    cell = float(np.sqrt(2.0 * area / max_triangles))
    while True:
        merged = _clustered(mesh, cell)
        if len(merged.triangles) <= max_triangles:
            return merged
        cell *= CELL_GROWTH


def _clustered(mesh: Mesh, cell: float) -> Mesh:
    """Return the mesh whose vertices of each cubic cell of this edge are merged."""
    keys = np.floor((mesh.vertices - mesh.vertices.min(axis=0)) / cell).astype(np.int64)
    size = keys.max(axis=0) + 1
    _, first, groups = np.unique(
        np.ravel_multi_index(tuple(keys.T), tuple(size)), return_index=True, return_inverse=True
    )
    # Cells in the order of their first vertices, which follows the surface and so packs well.
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    groups = rank[groups]
    counts = np.bincount(groups)[:, None]

    def mean(values: np.ndarray) -> np.ndarray:
        return np.stack([np.bincount(groups, column) for column in values.T.astype(float)], axis=-1) / counts

    normals = mean(mesh.normals)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    confidence = np.full(len(first), np.inf)
    np.minimum.at(confidence, groups, np.nan_to_num(mesh.confidence, nan=0.0))
    if not np.isfinite(mesh.confidence).any():
        confidence[:] = np.nan
    triangles = groups[mesh.triangles]
    a, b, c = triangles.T
    kept = triangles[(a != b) & (b != c) & (c != a)]
    kept = np.take_along_axis(kept, (kept.argmin(axis=1)[:, None] + np.arange(3)) % 3, axis=1)
    kept = np.unique(kept, axis=0)
    return Mesh(
        mean(mesh.vertices).astype(np.float32),
        kept.astype(np.int32),
        normals.astype(np.float32),
        confidence.astype(np.float32),
        mesh.unit,
    )
