"""The paper's dual-layer graph cut, taken literally (paper 4.2, Eqn 2; METHOD 6).

Each pixel has two nodes, one for each of its two heaviest clusters. Label 1 says that a node's normal is the exterior
surface's. A node's own term compares its gradient with that of the initial normal and with that of the counter normal,
to which a highlight from the far side would point; neighbours with different labels pay for how alike they are.
"""

from dataclasses import dataclass
from typing import Literal

import maxflow
import numpy as np

from glint.tasks.algorithms.candidates.clusters import Clusters
from glint.tasks.algorithms.candidates.markup import Marks, mark_constraints
from glint.tasks.algorithms.geometry.vectors import NZ_FLOOR, angles, gradients
from glint.tasks.algorithms.labelling.confidence import RIM_TRUST, field_confidence, field_growth, observed_confidence
from glint.tasks.algorithms.labelling.reconstruction import (
    FILLED,
    MARKED,
    OBSERVED,
    OUTSIDE,
    SILHOUETTE,
    Reconstruction,
    Round,
)
from glint.tasks.algorithms.prior.smooth_normals import contour_normals, inradius, smooth_normal_field

Edges = Literal["layers", "surface"]
"""The two readings of a node's nine edges: the four neighbours in both layers, or the eight in its own; and in both the
pixel's other node."""
FORBIDDEN = 1e6
"""Stands for the infinite cost that a mark sets on the other label."""
LABEL_TRUST = 0.9
"""Share of accepted normals in good sheets that are right: the cut takes whole false sheets for exterior ones too."""


@dataclass(frozen=True, slots=True)
class Nodes:
    """p, q (2, H, W) gradients of the nodes; one, zero (2, H, W) costs E1(1) and E1(0) of labelling them so."""

    p: np.ndarray
    q: np.ndarray
    one: np.ndarray
    zero: np.ndarray


def nodes_of(
    normals: np.ndarray, initial: np.ndarray, mask: np.ndarray, pins: np.ndarray, floor: float = NZ_FLOOR
) -> Nodes:
    """Gradients and own terms of the two nodes of each pixel.

    normals (2, H, W, 3), NaN where a pixel has no such cluster; initial (H, W, 3); pins (2, H, W): +1 marked true, -1
    marked false. A pixel with one cluster holds it in both nodes; one with none holds the initial normal in both.
    """
    seen = np.isfinite(normals[..., 0])
    first = np.where(seen[0][..., None], normals[0], initial)
    both = np.stack([first, np.where(seen[1][..., None], normals[1], first)])
    p, q = gradients(both, floor)
    front_p, front_q = gradients(initial, floor)
    front = np.abs(p - front_p) + np.abs(q - front_q)
    counter = np.abs(p + front_p) + np.abs(q + front_q)
    total = front + counter
    one = np.where(seen[0] & (total > 0), front / np.maximum(total, 1e-12), 0.5)
    zero = 1.0 - one
    both_pins = np.stack([pins[0], np.where(seen[1], pins[1], pins[0])])
    one = np.where(both_pins > 0, 0.0, np.where(both_pins < 0, FORBIDDEN, one))
    zero = np.where(both_pins > 0, FORBIDDEN, np.where(both_pins < 0, 0.0, zero))
    return Nodes(*(np.where(mask, values, 0.0) for values in (p, q, one, zero)))


def label_dual_layer(nodes: Nodes, mask: np.ndarray, *, edges: Edges = "layers", weight: float = 0.1) -> np.ndarray:
    """Labels (2, H, W) uint8 of least energy sum E1 + weight sum E2, 1 = exterior.

    mask (H, W) bool; weight: of the neighbours' terms, which the paper leaves at 1.
    """
    if weight < 0:
        raise ValueError(f"weight {weight} is negative: a graph cut needs ties that cost")
    count = int(mask.sum())
    numbers = np.full(nodes.p.shape, -1)
    numbers[:, mask] = np.arange(2 * count).reshape(2, count)
    ends = [edge_ends(numbers, edges, shift) for shift in shifts_of(edges)]
    first, second = (np.concatenate(parts) for parts in zip(*ends, (numbers[0][mask], numbers[1][mask]), strict=True))
    p, q = (np.concatenate([values[0][mask], values[1][mask]]) for values in (nodes.p, nodes.q))
    ties = weight / (np.abs(p[first] - p[second]) + np.abs(q[first] - q[second]) + 1.0)
    graph = maxflow.GraphFloat(2 * count, len(first))
    graph.add_nodes(2 * count)
    graph.add_edges(first, second, ties, ties)
    one, zero = (np.concatenate([cost[0][mask], cost[1][mask]]) for cost in (nodes.one, nodes.zero))
    graph.add_grid_tedges(np.arange(2 * count), zero, one)
    graph.maxflow()
    labels = np.zeros(nodes.p.shape, np.uint8)
    labels[:, mask] = ~graph.get_grid_segments(np.arange(2 * count)).reshape(2, count)
    return labels


def shifts_of(edges: Edges) -> list[tuple[int, int]]:
    """Steps (rows, columns) to the neighbours; each pair of pixels is taken once."""
    return [(0, 1), (1, 0)] if edges == "layers" else [(0, 1), (1, 0), (1, 1), (1, -1)]


def edge_ends(numbers: np.ndarray, edges: Edges, shift: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the nodes at both ends of all edges between pixels a step apart; numbers (2, H, W), -1 outside."""
    down, right = shift
    height, width = numbers.shape[1:]
    here = numbers[:, : height - down, max(0, -right) : width - max(0, right)]
    there = numbers[:, down:, max(0, right) : width - max(0, -right)]
    layers = ((0, 0), (1, 1), (0, 1), (1, 0)) if edges == "layers" else ((0, 0), (1, 1))
    inside = (here[0] >= 0) & (there[0] >= 0)
    return (
        np.concatenate([here[a][inside] for a, _ in layers]),
        np.concatenate([there[b][inside] for _, b in layers]),
    )


def reconstruct_dual_layer(
    clusters: Clusters,
    mask: np.ndarray,
    initial: np.ndarray,
    *,
    marks: Marks | None = None,
    edges: Edges = "layers",
    weight: float = 0.1,
    rounds: int = 0,
    rim_weight: float = 1.0,
    normal_weight: float = 0.1,
    tension_length: float = 0.12,
) -> Reconstruction:
    """Normals as the paper has them: the cluster labelled 1 (of two, the one that fits better), else the initial one.

    clusters of the region's (H, W); mask (H, W) bool; initial (H, W, 3). rounds: how often the rejected and unobserved
    pixels are filled afresh from the accepted normals and the rim, and between two fillings labelled anew against
    them; none is the paper's method. The last three are those of `rounds` and shape that filling.
    """
    if clusters.normals.shape[1:3] != mask.shape:
        raise ValueError(f"clusters of {clusters.normals.shape[1:3]} pixels do not fit a mask of {mask.shape}")
    normals = np.where(mask[None, :, :, None], clusters.normals[:2], np.nan)
    marked, marked_normals, pins = mark_constraints(marks, normals, mask)
    rim, outward = contour_normals(mask)
    scale, surface = inradius(mask), smooth_normal_field(mask, tension_length) if rounds else None

    def labelled(field: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        nodes = nodes_of(normals, field, mask, pins)
        labels = label_dual_layer(nodes, mask, edges=edges, weight=weight)
        labels[~np.isfinite(normals[..., 0])] = 0
        best = np.where(labels == 1, nodes.one, np.inf).argmin(axis=0)
        chosen = np.take_along_axis(normals, best[None, :, :, None], axis=0)[0]
        return labels, np.where(labels.any(axis=0)[..., None], chosen, marked_normals)

    def filled(known: np.ndarray) -> np.ndarray:
        assert surface is not None
        weights = np.where(known, normal_weight, np.where(rim, rim_weight, 0.0))
        return surface.solve(np.where(known[..., None], chosen, outward), weights)

    field, changes = initial, []
    labels, chosen = labelled(field)
    for number in range(rounds):
        if number:
            previous, (labels, chosen) = labels, labelled(field)
            changes.append(int((previous != labels).any(axis=0).sum()))
        field = filled(np.isfinite(chosen[..., 0]))
    accepted = np.isfinite(chosen[..., 0])
    if rounds:
        expected = field_confidence(accepted, rim, field_growth(filled, chosen, scale), scale)
    else:
        expected = np.full(mask.shape, _agreement(initial, chosen))
    sure = np.where(marked, 1.0, LABEL_TRUST * observed_confidence(chosen, scale))
    kept = np.zeros(clusters.normals.shape[:3], np.uint8)
    kept[:2] = labels
    elsewhere = np.where(rim, SILHOUETTE, FILLED) if rounds else SILHOUETTE
    provenance = np.select([~mask, marked, accepted], [OUTSIDE, MARKED, OBSERVED], elsewhere)
    return Reconstruction(
        labels=kept,
        normals=np.where(accepted[..., None], chosen, field).astype(np.float32),
        initial=initial,
        provenance=provenance.astype(np.uint8),
        confidence=np.where(mask, np.where(accepted, sure, expected), np.nan).astype(np.float32),
        rounds=tuple(Round(int(accepted.sum()), changed) for changed in [int(accepted.sum()), *changes]),
    )


def _agreement(initial: np.ndarray, accepted: np.ndarray) -> float:
    """Share of the accepted normals (H, W, 3; NaN elsewhere) within 5 degrees of the initial ones (H, W, 3).

    They did not shape the initial normals, so they are the one place where those can be checked. Where nothing was
    accepted nothing speaks for them, and however many agree, they are no surer than the rim.
    """
    known = np.isfinite(accepted[..., 0])
    if not known.any():
        return 0.0
    return min(RIM_TRUST, float((angles(initial[known], accepted[known]) < 5.0).mean()))
