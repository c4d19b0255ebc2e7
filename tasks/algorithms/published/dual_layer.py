"""The paper's dual-layer graph cut, taken literally (section 4.2, Eqn 1 to 3).

Each pixel has two nodes, for its first two clusters. Label 1 means that a node's normal is that of the exterior
surface. The likelihood term E1 compares a node's gradient with that of the initial normal and with that of the counter
normal, to which a highlight from the far side would point; the prior term E2 charges neighbours of different labels by
how alike their gradients are.
"""

from dataclasses import dataclass
from typing import Literal

import maxflow
import numpy as np

from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.candidates.markup import Marks, mark_constraints
from glint.tasks.algorithms.geometry.connected_parts import neighbours
from glint.tasks.algorithms.geometry.distance import inradius_of
from glint.tasks.algorithms.geometry.vectors import angles, gradients
from glint.tasks.algorithms.labelling.confidence import (
    OCCLUDING_CONTOUR_SHARE,
    observed_confidence,
)
from glint.tasks.algorithms.labelling.results import (
    MARKED,
    OBSERVED,
    OUTSIDE,
    SILHOUETTE,
    Iteration,
    Reconstruction,
)

Connectivity = Literal["layers", "surface"]
"""The two readings of "up to 9 edges" of a node (Figure 6): the four neighbours in both layers, or the eight in its own
layer; and in either reading the pixel's second node."""
FORBIDDEN_COST = 1e6
"""Stands for the infinite cost that a mark sets on the opposite label (Eqn 2)."""
LABEL_PRECISION = 0.9
"""Share of accepted normals in good sheets that are right: the cut accepts whole false sheets, too."""


@dataclass(frozen=True, slots=True)
class NodeTerms:
    """Gradients p, q (2, H, W) of the nodes, and their likelihood costs (2, H, W): exterior_cost = E1(1), false_cost =
    E1(0)."""

    p: np.ndarray
    q: np.ndarray
    exterior_cost: np.ndarray
    false_cost: np.ndarray


def node_terms(normals: np.ndarray, initial: np.ndarray, mask: np.ndarray, pins: np.ndarray) -> NodeTerms:
    """Compute gradients and likelihood terms of the two nodes of each pixel (Eqn 2).

    A pixel with one cluster holds it in both nodes; one with none holds the initial normal in both.

    Args:
        normals: (2, H, W, 3) unit, camera frame, NaN where a pixel has no such cluster.
        initial: (H, W, 3) normals from the silhouette.
        mask: (H, W) bool; terms are 0 outside.
        pins: (2, H, W), +1 marked true, -1 marked false, 0 unmarked.
    """
    observed = np.isfinite(normals[..., 0])
    first = np.where(observed[0][..., None], normals[0], initial)
    nodes = np.stack([first, np.where(observed[1][..., None], normals[1], first)])
    p, q = gradients(nodes)
    # The counter normal has the opposite gradient, so its differences are sums.
    front_p, front_q = gradients(initial)
    front = np.abs(p - front_p) + np.abs(q - front_q)
    counter = np.abs(p + front_p) + np.abs(q + front_q)
    total = front + counter
    exterior_cost = np.where(observed[0] & (total > 0), front / np.maximum(total, 1e-12), 0.5)
    false_cost = 1.0 - exterior_cost
    # A single cluster stands in both nodes, so its mark holds for both.
    node_pins = np.stack([pins[0], np.where(observed[1], pins[1], pins[0])])
    exterior_cost = np.where(node_pins > 0, 0.0, np.where(node_pins < 0, FORBIDDEN_COST, exterior_cost))
    false_cost = np.where(node_pins > 0, FORBIDDEN_COST, np.where(node_pins < 0, 0.0, false_cost))
    return NodeTerms(*(np.where(mask, values, 0.0) for values in (p, q, exterior_cost, false_cost)))


def label_dual_layer(nodes: NodeTerms, mask: np.ndarray, *, connectivity: Connectivity, weight: float) -> np.ndarray:
    """Return the labelling (2, H, W) uint8 of minimum energy sum E1 + weight sum E2 (Eqn 1), 1 = exterior.

    mask (H, W) bool; weight: of the prior term, which the paper leaves at 1.

    Raises:
        ValueError: the weight is negative.
    """
    if weight < 0:
        raise ValueError(f"weight {weight} is negative: a graph cut needs non-negative edge costs")
    count = int(mask.sum())
    numbers = np.full(nodes.p.shape, -1)
    numbers[:, mask] = np.arange(2 * count).reshape(2, count)
    # Edges between neighbouring pixels, then those between the two nodes of each pixel.
    ends = [edge_ends(numbers, connectivity, offset) for offset in neighbour_offsets(connectivity)]
    first, second = (np.concatenate(parts) for parts in zip(*ends, (numbers[0][mask], numbers[1][mask]), strict=True))
    p, q = (np.concatenate([values[0][mask], values[1][mask]]) for values in (nodes.p, nodes.q))
    costs = weight / (np.abs(p[first] - p[second]) + np.abs(q[first] - q[second]) + 1.0)
    graph = maxflow.GraphFloat(2 * count, len(first))
    graph.add_nodes(2 * count)
    graph.add_edges(first, second, costs, costs)
    exterior_cost, false_cost = (
        np.concatenate([cost[0][mask], cost[1][mask]]) for cost in (nodes.exterior_cost, nodes.false_cost)
    )
    # A node on the source's side is exterior: cutting it off the source costs what calling it false does.
    graph.add_grid_tedges(np.arange(2 * count), false_cost, exterior_cost)
    graph.maxflow()
    labels = np.zeros(nodes.p.shape, np.uint8)
    labels[:, mask] = ~graph.get_grid_segments(np.arange(2 * count)).reshape(2, count)
    return labels


def neighbour_offsets(connectivity: Connectivity) -> list[tuple[int, int]]:
    """Return the steps (rows, columns) to the neighbours, so that each pair of pixels is taken once."""
    return [(0, 1), (1, 0)] if connectivity == "layers" else [(0, 1), (1, 0), (1, 1), (1, -1)]


def edge_ends(
    numbers: np.ndarray, connectivity: Connectivity, offset: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the node numbers at either end of all edges between pixels an offset apart, two (E,).

    numbers (2, H, W): those of the nodes, -1 outside the mask.
    """
    pixel, neighbour = (numbers[:, *window] for window in neighbours(numbers.shape[1:], *offset))
    layers = ((0, 0), (1, 1), (0, 1), (1, 0)) if connectivity == "layers" else ((0, 0), (1, 1))
    inside = (pixel[0] >= 0) & (neighbour[0] >= 0)
    return (
        np.concatenate([pixel[a][inside] for a, _ in layers]),
        np.concatenate([neighbour[b][inside] for _, b in layers]),
    )


def reconstruct_dual_layer(
    clusters: Clusters,
    mask: np.ndarray,
    initial: np.ndarray,
    *,
    marks: Marks | None = None,
    connectivity: Connectivity = "layers",
    weight: float = 0.1,
) -> Reconstruction:
    """Reconstruct normals as the paper does: the cluster labelled 1 (of two, the better one), else the initial normal.

    Args:
        clusters: candidates of the region; `normals` (K, H, W, 3), of which the first two layers are used.
        mask: (H, W) bool, the object.
        initial: (H, W, 3) normals from the silhouette.
        marks: true and false highlights marked by a user.
        connectivity, weight: see `Connectivity` and `label_dual_layer`.

    Raises:
        ValueError: clusters and mask differ in size, or the weight is negative.
    """
    if clusters.normals.shape[1:3] != mask.shape:
        raise ValueError(f"clusters of {clusters.normals.shape[1:3]} pixels do not fit a mask of {mask.shape}")
    normals = np.where(mask[None, :, :, None], clusters.normals[:2], np.nan)
    marked, marked_normals, pins = mark_constraints(marks, normals, mask)
    nodes = node_terms(normals, initial, mask, pins)
    labels = label_dual_layer(nodes, mask, connectivity=connectivity, weight=weight)
    labels[~np.isfinite(normals[..., 0])] = 0
    best = np.where(labels == 1, nodes.exterior_cost, np.inf).argmin(axis=0)
    chosen = np.take_along_axis(normals, best[None, :, :, None], axis=0)[0]
    chosen = np.where(labels.any(axis=0)[..., None], chosen, marked_normals)
    accepted = np.isfinite(chosen[..., 0])
    observed = np.where(marked, 1.0, LABEL_PRECISION * observed_confidence(chosen, inradius_of(mask)))
    confidence = np.where(accepted, observed, _initial_accuracy(initial, chosen))
    kept = np.zeros(clusters.normals.shape[:3], np.uint8)
    kept[:2] = labels
    provenance = np.select([~mask, marked, accepted], [OUTSIDE, MARKED, OBSERVED], SILHOUETTE)
    return Reconstruction(
        labels=kept,
        normals=np.where(accepted[..., None], chosen, initial).astype(np.float32),
        initial=initial,
        provenance=provenance.astype(np.uint8),
        confidence=np.where(mask, confidence, np.nan).astype(np.float32),
        iterations=(Iteration(int(accepted.sum()), int(accepted.sum())),),
    )


def _initial_accuracy(initial: np.ndarray, accepted: np.ndarray) -> float:
    """Return the share of accepted normals (H, W, 3; NaN elsewhere) within 5 degrees of the initial ones (H, W, 3).

    Accepted normals did not shape the initial ones, so they are an independent check; 0 if nothing was accepted. The
    share is bounded by that of occluding contours, since the initial normals rest on the silhouette alone.
    """
    known = np.isfinite(accepted[..., 0])
    if not known.any():
        return 0.0
    return min(OCCLUDING_CONTOUR_SHARE, float((angles(initial[known], accepted[known]) < 5.0).mean()))
