"""Encode the mesh of a depth map as PLY and GLB (binary glTF 2.0)."""

from typing import Any

import trimesh
from trimesh.exchange.gltf import export_glb
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from glint.tasks.algorithms.meshing.depth_mesh import Surface

METRES_PER_MM = 0.001
VERTEX_BUFFER, INDEX_BUFFER = 34962, 34963
"""Targets of buffer views (glTF 2.0, section 5.11.5), so that viewers need not infer them."""
MATERIAL = PBRMaterial(
    name="glass", baseColorFactor=[200, 212, 219, 255], metallicFactor=0.0, roughnessFactor=0.4, doubleSided=True
)
"""Opaque, since viewers draw transparent meshes without the depth that they are here for. Seen from both sides: the
surface of one view has no back."""


def ply_bytes(surface: Surface) -> bytes:
    """Encode as binary PLY with normals and the vertex property `confidence`."""
    mesh = _trimesh(surface)
    mesh.vertex_attributes["confidence"] = surface.confidence
    return bytes(trimesh.exchange.ply.export_ply(mesh, encoding="binary", vertex_normal=True))


def glb_bytes(surface: Surface, unit: str) -> bytes:
    """Encode as binary glTF with normals, the vertex attribute `_confidence` and a material seen from both sides.

    unit: of the surface. "mm" is written as metres, the unit of glTF; any other is left as it is, and the file's asset
    says that its scale is unknown.
    """
    mesh = _trimesh(surface)
    is_scaled = unit == "mm"
    if is_scaled:
        mesh.apply_scale(METRES_PER_MM)
    mesh.vertex_attributes["_confidence"] = surface.confidence
    mesh.visual = TextureVisuals(material=MATERIAL)
    facts = {"unit": "m" if is_scaled else unit, "scale": "known" if is_scaled else "unknown"}

    def complete(tree: dict[str, Any]) -> None:
        tree["asset"] |= {"generator": "Glint", "extras": facts}
        for primitive in (primitive for item in tree["meshes"] for primitive in item["primitives"]):
            views = dict.fromkeys(primitive["attributes"].values(), VERTEX_BUFFER)
            for accessor, target in (views | {primitive["indices"]: INDEX_BUFFER}).items():
                tree["bufferViews"][tree["accessors"][accessor]["bufferView"]]["target"] = target

    scene = trimesh.Scene(mesh)
    return bytes(export_glb(scene, include_normals=True, tree_postprocessor=complete))


def _trimesh(surface: Surface) -> trimesh.Trimesh:
    return trimesh.Trimesh(surface.vertices, surface.triangles, vertex_normals=surface.normals, process=False)
