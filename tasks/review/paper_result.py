"""The literal paper's normals of a version, beside its own: computed at the first request."""

from functools import lru_cache

import numpy as np

from glint.storage.versions.stage_results import StageResult
from glint.tasks.engine.parameters import LabelsParameters, SilhouetteParameters
from glint.tasks.review.stored import VersionReference
from glint.tasks.stages.capture_geometry import CaptureGeometry
from glint.tasks.stages.clusters import read_clusters
from glint.tasks.stages.labels import LabelledView, reconstruct
from glint.tasks.stages.markup import tracked_marks

PAPER_NEEDS = ("survey", "mask", "markup", "silhouette", "clusters")
"""Stages of a version that the paper's labelling reads."""


@lru_cache(maxsize=2)
def paper_normals(version: VersionReference, capture: str) -> np.ndarray:
    """Return the normals (H, W, 3) that the literal paper's method gives a capture of a version; it takes seconds.

    Raises:
        StoreError: no such object, version or capture, or a result is damaged.
    """
    repository = version.repository
    stages: dict[str, StageResult] = {stage: repository.load(capture, stage, version.snapshot) for stage in PAPER_NEEDS}
    view = LabelledView(
        read_clusters(stages["clusters"]),
        stages["mask"].read("mask"),
        stages["silhouette"].read("initial"),
        tracked_marks(stages["markup"]),
        CaptureGeometry.of(stages["survey"].record).region_camera,
    )
    return reconstruct(view, LabelsParameters(method="paper"), SilhouetteParameters()).normals
