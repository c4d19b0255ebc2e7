"""Surface: the depth as a mesh, and pictures of it, as files."""

import numpy as np

from glint.storage.export.image_files import encode_png
from glint.storage.versions.stage_results import StoredFile
from glint.tasks.algorithms.lighting.coverage import coverage, draw_coverage
from glint.tasks.algorithms.meshing.depth_mesh import glb_bytes, ply_bytes
from glint.tasks.algorithms.meshing.depth_mesh import surface as mesh_of
from glint.tasks.algorithms.meshing.shading import draw_surface, relit_pictures
from glint.tasks.engine.capture_context import Workspace
from glint.tasks.engine.stage import Outcome, Progress
from glint.tasks.stages.frames import region_of

METRES_PER_MM = 0.001


def surface(work: Workspace, progress: Progress) -> Outcome:
    """PLY, GLB, relit pictures and the picture of the lamp's sweep."""
    survey, region, labels = work.load("survey").record, region_of(work), work.load("labels")
    mask, normals = work.load("mask").read("mask"), labels.read("normals")
    depth, about = work.load("depth").read("depth"), work.load("depth").record
    pixel_size, parameters = survey["pixel_size"] or 1.0, work.parameters.surface
    mesh = mesh_of(
        depth / np.float32(pixel_size) if about["distance"] is None else np.float32(about["distance"]) - depth,
        mask,
        normals,
        origin=(region.x, region.y),
        frame=tuple(survey["frame_size"]),
        pixel_size=pixel_size,
        camera=work.camera_matrix,
        confidence=labels.read("confidence"),
        cut=parameters.cut,
        steepest=parameters.steepest,
    )
    files = {"surface.ply": StoredFile(ply_bytes(mesh), "model/ply")}
    files["surface.glb"] = StoredFile(
        glb_bytes(mesh, METRES_PER_MM if survey["pixel_size"] else 1.0), "model/gltf-binary"
    )
    swept = work.load("lights").read("half_vectors")
    pictures = relit_pictures(normals, mask) | {
        "relit_surface": draw_surface(mesh, azimuth=35.0, elevation=20.0),
        "coverage": draw_coverage(coverage(swept), swept),
    }
    files |= {f"{name}.png": StoredFile(encode_png(picture), "image/png") for name, picture in pictures.items()}
    return Outcome(
        record={"unit": survey["unit"]},
        files=files,
        counts={"vertices": len(mesh.vertices), "triangles": len(mesh.triangles)},
    )
