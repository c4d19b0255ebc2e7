"""Surface: the depth as a mesh, and pictures of it."""

import numpy as np

from glint.storage.export.image_files import encode_png
from glint.storage.versions.stage_results import StoredFile
from glint.tasks.algorithms.lighting.coverage import coverage
from glint.tasks.algorithms.meshing.depth_mesh import RegionCamera, mesh_from_depth
from glint.tasks.algorithms.meshing.mesh_encoding import glb_bytes, ply_bytes
from glint.tasks.algorithms.meshing.shading import draw_surface, relit_pictures
from glint.tasks.engine.parameters import SurfaceParameters
from glint.tasks.engine.stage import Progress, StageOutput
from glint.tasks.engine.stage_inputs import StageInputs
from glint.tasks.figures.coverage_map import draw_coverage
from glint.tasks.stages.capture_geometry import load_geometry


def surface(inputs: StageInputs, progress: Progress) -> StageOutput:
    """Make the mesh as PLY and GLB, relit pictures, and a picture of where the lights have been."""
    parameters: SurfaceParameters = inputs.parameters
    geometry, labels, depth = load_geometry(inputs), inputs.load("labels"), inputs.load("depth")
    mask, normals, heights = inputs.load("mask").read("mask"), labels.read("normals"), depth.read("depth")
    region, pixel_size, distance = geometry.region, geometry.pixel_size or 1.0, depth.record["distance"]
    mesh = mesh_from_depth(
        heights / np.float32(pixel_size) if distance is None else np.float32(distance) - heights,
        mask,
        normals,
        RegionCamera((region.x, region.y), geometry.frame_size, pixel_size, geometry.camera),
        confidence=labels.read("confidence"),
        max_step=parameters.max_step,
        max_slope=parameters.max_slope,
    )
    files = {
        "surface.ply": StoredFile(ply_bytes(mesh), "model/ply"),
        "surface.glb": StoredFile(glb_bytes(mesh, geometry.unit), "model/gltf-binary"),
    }
    half_vectors = inputs.load("lights").read("half_vectors")
    pictures = relit_pictures(normals, mask) | {
        "relit_surface": draw_surface(mesh, azimuth=35.0, elevation=20.0),
        "coverage": draw_coverage(coverage(half_vectors), half_vectors),
    }
    files |= {f"{name}.png": StoredFile(encode_png(picture), "image/png") for name, picture in pictures.items()}
    return StageOutput(
        record={"unit": geometry.unit},
        files=files,
        counts={"vertices": len(mesh.vertices), "triangles": len(mesh.triangles)},
    )
