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
    sums = skeleton.path_lengths(np.arange(len(skeleton.positions))) @ skeleton.areas
    nearest = np.flatnonzero(sums <= sums.min() * (1 + 1e-12))
    return int(nearest[np.argmax(skeleton.areas[nearest])])
