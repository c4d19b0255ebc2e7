"""One view as its labelling finds it: candidates and mask, and all that follows from these alone."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from glint.tasks.algorithms.angular_bodies.angular_normals import AngularVesselSearch
from glint.tasks.algorithms.candidates.shading import shading_log_ratio
from glint.tasks.algorithms.facets.faceted_normals import FacetSearch
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.labelling.graph_cut import GraphCut
from glint.tasks.algorithms.labelling.weights import GraphCutWeights, LabellingOptions
from glint.tasks.algorithms.prior.smooth_normals import (
    MAX_NODES,
    SmoothNormalField,
    contour_normals,
    smooth_normal_field,
    thickness,
)
from glint.tasks.algorithms.prisms.prismatic_normals import PrismSearch
from glint.tasks.algorithms.prisms.rounded_normals import RoundedPrismSearch
from glint.tasks.algorithms.sheets.integrability import shape_log_ratio
from glint.tasks.algorithms.sheets.sheet_graph import sheet_graph
from glint.tasks.algorithms.vessels.rotational_normals import RotationalSymmetry

if TYPE_CHECKING:
    from glint.tasks.algorithms.candidates.clusters import Clusters

DRAFT_NODES, HELD_OUT_NODES = 7_000, 5_000
"""Grid nodes of coarser fields: a draft's (a third of the time, 1% more squared error), one that predicts a sheet."""


@dataclass(frozen=True, slots=True)
class CandidateView:
    """What the labelling of a view never changes.

    normals: (K, H, W, 3) float32, candidates, relative to the view rays, NaN outside the mask and without cluster.
    weights: (K, H, W), of the clusters.
    observations: (H, W), number of frames in which a pixel is lit.
    mask: (H, W) bool.
    camera: (3, 3), the perspective camera's matrix in pixels of the mask; None for parallel rays.
    is_draft: whether the field is that of a draft.
    inradius: of the mask, in pixels.
    thickness: (H, W), of the object, in pixels.
    evidence: (K, H, W), log-likelihood ratio of a true against a false highlight, by the sheet's shape and by shading,
        nats.
    surface, coarse: interpolants of the field, and of the predictions of what is held out.
    rim: (H, W) bool, pixels of the occluding contour.
    outward: (H, W, 3), their normals, NaN elsewhere.
    graph: of the nodes, to be cut.
    sheets: numbers of the nodes and their ties, see `sheet_graph`.
    symmetry, angular, prism, rounded, facets: searches for bodies, which keep what they compute.
    """

    normals: np.ndarray
    weights: np.ndarray
    observations: np.ndarray
    mask: np.ndarray
    camera: np.ndarray | None
    is_draft: bool
    inradius: float
    thickness: np.ndarray
    evidence: np.ndarray
    surface: SmoothNormalField
    coarse: SmoothNormalField
    rim: np.ndarray
    outward: np.ndarray
    graph: GraphCut
    sheets: tuple[np.ndarray, sparse.csr_matrix]
    symmetry: RotationalSymmetry
    angular: AngularVesselSearch
    prism: PrismSearch
    rounded: RoundedPrismSearch
    facets: FacetSearch

    @classmethod
    def of(
        cls,
        clusters: "Clusters",
        mask: np.ndarray,
        options: LabellingOptions,
        *,
        camera: np.ndarray | None = None,
        is_draft: bool = False,
    ) -> "CandidateView":
        """Prepare the labelling of a view; for the arguments see `reconstruct_normals`, for is_draft `settle`.

        Raises:
            ValueError: clusters and mask differ in size.
        """
        normals = np.asarray(clusters.normals, dtype=np.float32)
        if normals.shape[1:3] != mask.shape:
            raise ValueError(f"clusters of {normals.shape[1:3]} pixels do not fit a mask of {mask.shape}")
        normals = np.where(mask[None, :, :, None], normals, np.nan)
        tension, weights, inradius = options.field.tension_length, options.graph_cut, inradius_of(mask)
        rim, outward = contour_normals(mask)
        return cls(
            normals=normals,
            weights=clusters.weight,
            observations=clusters.observations,
            mask=mask,
            camera=camera,
            is_draft=is_draft,
            inradius=inradius,
            thickness=thickness(mask),
            evidence=candidate_evidence(normals, clusters.shading, inradius, weights),
            surface=smooth_normal_field(mask, tension, DRAFT_NODES if is_draft else MAX_NODES),
            coarse=smooth_normal_field(mask, tension, HELD_OUT_NODES),
            rim=rim,
            outward=outward,
            graph=GraphCut(normals, weights.strength, weights.contrast),
            sheets=sheet_graph(normals),
            symmetry=RotationalSymmetry(mask, camera),
            angular=AngularVesselSearch(normals, mask, camera),
            prism=PrismSearch(normals, mask, camera),
            rounded=RoundedPrismSearch(normals, mask, camera),
            facets=FacetSearch(normals, mask, camera),
        )


def candidate_evidence(
    normals: np.ndarray, shading: np.ndarray, inradius: float, weights: GraphCutWeights
) -> np.ndarray:
    """Return the log-likelihood ratio (K, H, W) of a true against a false highlight by shape and shading, nats.

    normals: (K, H, W, 3) unit, NaN without cluster. shading: (K, H, W) of `Clusters`. inradius: of the mask, in pixels.
    """
    evidence = weights.shape_weight * shape_log_ratio(normals, inradius)
    evidence += weights.shading_weight * shading_log_ratio(shading)
    return evidence
