"""Labelling of few pixels by many labels: expansion moves by graph cuts (Boykov, Veksler and Zabih 2001)."""

from collections.abc import Callable

import maxflow
import numpy as np

FORBIDDEN_NATS = 50.0
"""Cost of a label at a node where it is not allowed but has been from the start."""


def expand(
    labels: np.ndarray,
    unary: np.ndarray,
    allowed: np.ndarray,
    edges: np.ndarray,
    predict: Callable[[np.ndarray, np.ndarray], np.ndarray],
    difference: Callable[[np.ndarray, np.ndarray], np.ndarray],
    sweeps: int,
) -> np.ndarray:
    """Return labels (N,) of low energy: each move lets all nodes that gain by it take one label.

    Args:
        labels: (N,) int, at the start.
        unary: (L, N), cost of each label at each node.
        allowed: (L, N) bool, labels that a node may take.
        edges: (E, 2) int, pairs of nodes.
        predict: what labels (M,) predict (M, F) at edges (M,).
        difference: cost (M,) of an edge whose ends have these predictions (M, F); 0 if they are the same. Where it
            violates the triangle inequality, a move may raise the energy a little.
        sweeps: over all labels; ends earlier if nothing changes.
    """
    labels = labels.copy()
    unary = np.where(allowed, unary, unary + FORBIDDEN_NATS)
    everywhere = np.arange(len(edges))
    ends = [predict(labels[edges[:, end]], everywhere) for end in (0, 1)]
    for _ in range(sweeps):
        changed = False
        for label in range(len(unary)):
            movable = allowed[label] & (labels != label)
            touched = np.flatnonzero(movable[edges].any(axis=1))
            if not touched.size:
                continue
            new = predict(np.full(len(touched), label), touched)
            first, second = ends[0][touched], ends[1][touched]
            costs = difference(first, second), difference(first, new), difference(new, second)
            moved = _move(movable, unary[labels, np.arange(len(labels))], unary[label], edges[touched], costs)
            if moved.any():
                labels[moved], changed = label, True
                for end in (0, 1):
                    is_new = moved[edges[touched, end]]
                    ends[end][touched[is_new]] = new[is_new]
        if not changed:
            break
    return labels


def _move(
    movable: np.ndarray,
    present: np.ndarray,
    new: np.ndarray,
    edges: np.ndarray,
    costs: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> np.ndarray:
    """Return the nodes (N,) bool that take the new label.

    movable: (N,) bool, nodes that may; present, new: (N,), costs of their present and of the new label. edges: (E, 2).
    costs: (E,) each, of an edge whose ends stay, whose second one moves, and whose first one moves.
    """
    count = int(movable.sum())
    numbers = np.cumsum(movable) - 1
    stay, move = present[movable].astype(float), new[movable].astype(float)
    both_stay, second_moves, first_moves = costs
    free = movable[edges]
    first_only = free[:, 0] & ~free[:, 1]
    np.add.at(stay, numbers[edges[first_only, 0]], both_stay[first_only])
    np.add.at(move, numbers[edges[first_only, 0]], first_moves[first_only])
    second_only = free[:, 1] & ~free[:, 0]
    np.add.at(stay, numbers[edges[second_only, 1]], both_stay[second_only])
    np.add.at(move, numbers[edges[second_only, 1]], second_moves[second_only])
    pair = free.all(axis=1)
    head, tail = numbers[edges[pair, 0]], numbers[edges[pair, 1]]
    # What violates the triangle inequality is cut off, so that the move is a minimum cut.
    kept = np.minimum(both_stay[pair], second_moves[pair] + first_moves[pair])
    np.add.at(move, head, first_moves[pair] - kept)
    np.add.at(move, tail, -first_moves[pair])
    least = np.minimum(stay, move)
    graph = maxflow.GraphFloat(count, len(head))
    graph.add_nodes(count)
    if len(head):
        graph.add_edges(head, tail, second_moves[pair] + first_moves[pair] - kept, np.zeros(len(head)))
    graph.add_grid_tedges(np.arange(count), move - least, stay - least)
    graph.maxflow()
    moved = np.zeros(len(movable), bool)
    moved[movable] = graph.get_grid_segments(np.arange(count))
    return moved
