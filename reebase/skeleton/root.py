"""The root node: where the middle of a skeleton is, by name.

The thesis takes the node nearest to the area centroid (Figure 4.12). But the centroid of a bent body lies beside it,
and which node is nearest changes with the pose, and where nodes of several limbs are about as near, with the mesh: all
features are shares of the distances from the root, so that D jumps. The median needs no positions in space.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reebase.errors import unknown_name
from reebase.skeleton.graph import Skeleton

__all__ = ["ROOTS", "rooted"]

ROOTS = ("median", "centroid")
"""The node with the shortest mean way to the whole surface, or the one nearest to the area centroid."""

ROUNDING = 1e-9
"""Relative, of sums of lengths of paths; generous."""

MOST_VISITS = 20_000_000
"""Nodes whose ways are looked at in all, ten seconds' work: enough for 10,000 nodes of a lattice. Beyond, the best of
those measured is taken: those are measured first whose sum is the least by what is known."""


def rooted(skeleton: Skeleton, root: str = "median") -> Skeleton:
    """The skeleton with its root chosen anew; "centroid" leaves that of ``reeb_graph`` and ``prune``.

    median: the node n with the least sum of area times length of the shortest path from n, over all nodes; of equal
    ones that with the largest area. In a tree that is the node without which no piece has more than half of the area,
    whatever the lengths are (Goldman, "Optimal Center Location in Simple Networks", Transportation Science 5, 1971).
    Raises UnknownName.
    """
    if root not in ROOTS:
        raise unknown_name("root", root, ROOTS)
    if root == "centroid":
        return skeleton
    return replace(skeleton, root=_of_tree(skeleton) if skeleton.cycles == 0 else _of_graph(skeleton))


def _of_tree(skeleton: Skeleton) -> int:
    from scipy.sparse.csgraph import breadth_first_order

    order, before = breadth_first_order(skeleton.adjacency, 0, directed=False)
    below: list[float] = skeleton.areas.tolist()
    half = sum(below) / 2
    parents: list[int] = before.tolist()
    for node in reversed(order.tolist()):
        if below[node] >= half:
            return int(node)
        below[parents[node]] += below[node]
    return int(order[0])


def _of_graph(skeleton: Skeleton) -> int:
    """Exact up to ``MOST_VISITS``, though few nodes are measured: a lattice has 100,000, and no memory holds all ways.

    With the sum E(i) of a node known and d the way to another, the whole area A has E(j) >= |A d - E(i)|, as ways keep
    the triangle inequality; nodes beyond the least sum are passed over (trimed; Newling and Fleuret, "A Sub-Quadratic
    Exact Medoid Algorithm", AISTATS 2017).
    """
    from scipy.sparse.csgraph import dijkstra

    adjacency, areas = skeleton.adjacency, skeleton.areas
    total = areas.sum()
    sums, most = np.full(len(areas), np.inf), np.full(len(areas), np.inf)
    least = np.zeros(len(areas))
    node = skeleton.root
    for _ in range(max(1, MOST_VISITS // len(areas))):
        ways = np.asarray(dijkstra(adjacency, directed=False, indices=np.array([node]))[0], dtype=np.float64)
        sums[node] = ways @ areas
        least = np.fmax(least, np.abs(total * ways - sums[node]))
        most = np.fmin(most, total * ways + sums[node])
        left = np.flatnonzero(np.isinf(sums) & (least <= sums.min() * (1 + ROUNDING)))
        if len(left) == 0:
            break
        node = int(left[np.argmin(least[left] + most[left])])
    nearest = np.flatnonzero(sums <= sums.min() * (1 + 1e-12))
    return int(nearest[np.argmax(areas[nearest])])
