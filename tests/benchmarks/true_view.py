"""A view with its truth: the candidates, mask and true surface of a capture, and the errors of normals beside it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from glint.storage.catalogue.loading import Capture
from glint.storage.inputs.masks_and_truth import read_truth
from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.candidates.shading import without_shading
from glint.tasks.algorithms.evaluation.metrics import squared_errors
from glint.tasks.engine.capture_context import CaptureContext
from glint.tasks.engine.parameters import Parameters
from glint.tasks.stages.clusters import load_clusters
from tests.tasks.make_context import perform_all


@dataclass(frozen=True, slots=True)
class TrueView:
    """A simulated capture, performed up to its candidates.

    clusters: without those that show shading. mask (H, W) bool. normals (H, W, 3), depth (H, W): the true ones, depth
    towards the camera and NaN outside the mask.
    """

    work: CaptureContext
    clusters: Clusters
    mask: np.ndarray
    normals: np.ndarray
    depth: np.ndarray

    @classmethod
    def of(cls, capture: Capture, store: Path) -> "TrueView":
        """Return the view of a capture whose results are kept in a store."""
        work = CaptureContext(str(store), "object", capture, Parameters(), "benchmark")
        perform_all(work, "clusters")
        mask = work.load("mask").read("mask")
        assert capture.truth is not None
        truth = read_truth(capture.truth, mask.shape)
        assert truth.normals is not None and truth.depth is not None
        clusters = without_shading(load_clusters(work))
        return cls(work, clusters, mask, truth.normals, np.where(mask, truth.depth, np.nan))

    def errors(self, normals: np.ndarray) -> str:
        """Return the squared errors of normals (H, W, 3) in words: observed pixels / whole mask."""
        observed = squared_errors(normals, self.normals, self.mask & (self.clusters.observations > 0))
        return f"{observed:.4f} / {squared_errors(normals, self.normals, self.mask):.4f}"
