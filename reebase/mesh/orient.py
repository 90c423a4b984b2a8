"""Consistent orientation, by flood fill over the edges that two faces share, without walking.

Idea: give every face two nodes, as read and turned over, and join the nodes of neighbouring faces that
would agree along their edge. A part is orientable exactly when a face's two nodes end in different
components, and then the faces whose as-read nodes are in one component agree with each other. One
union-find, linear time, no recursion.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.mesh.topology import Edges

__all__ = ["faces_to_turn"]

FLAT = 1e-12
"""A volume below this times area^1.5 is rounding: such a part has no outside."""


def faces_to_turn(vertices: npt.NDArray[np.float64], edges: Edges) -> npt.NDArray[np.bool_]:
    """Which faces to turn over, bool, (n,), so that neighbours agree and closed components face outward.

    vertices: (m, 3), of order 1 and near the origin. Parts are grown over edges with exactly two faces;
    each keeps the orientation that more of its faces have as read, ties to its first face. A component
    whose faces then run along every edge as often one way as the other is turned as a whole when its signed
    volume is negative. A part that cannot be oriented (a Möbius strip) stays as read.
    """
    from reebase.mesh.topology_kernels import label

    count = len(edges.faces)
    first, second = edges.pairs
    # Nodes 2f (face f as read) and 2f + 1 (turned): neighbours that already agree join like with like.
    clash = (edges.forward[first] == edges.forward[second]).astype(np.int32)
    one, other = 2 * (first // np.int32(3)), 2 * (second // np.int32(3))
    nodes, labels = label(
        np.concatenate([one, one + np.int32(1)]),
        np.concatenate([other + clash, other + np.int32(1) - clash]), 2 * count,
    )  # fmt: skip
    as_read, turned = labels[0::2], labels[1::2]
    orientable = as_read != turned
    # Of the two components of a part, the one with the smaller number holds its first face as read.
    turn = orientable & (as_read > turned)
    part = np.minimum(as_read, turned)
    faces_of = np.bincount(part, minlength=nodes)
    turned_of = np.bincount(part, weights=turn, minlength=nodes)
    turn ^= orientable & (2 * turned_of > faces_of)[part]
    return np.asarray(turn ^ inward(vertices, edges, turn))


def inward(
    vertices: npt.NDArray[np.float64], edges: Edges, turn: npt.NDArray[np.bool_]
) -> npt.NDArray[np.bool_]:
    """Faces of the components that are closed cycles, once ``turn`` is done, with negative volume; bool,
    (n,)."""
    from reebase.mesh.topology_kernels import triangle_measures

    count, component = edges.components
    along = np.where(edges.forward ^ np.repeat(turn, 3), 1.0, -1.0)
    balance = np.bincount(edges.of_side, weights=along, minlength=len(edges))
    closed = np.ones(count, dtype=bool)
    closed[component[edges.sides[edges.starts[:-1]][balance != 0] // 3]] = False
    # About the component's own first vertex, so that parts far apart do not lose digits to each other.
    anchor = np.empty(count, dtype=np.int32)
    anchor[component[::-1]] = edges.faces[::-1, 0]
    area, _, _, volumes = triangle_measures(vertices, edges.faces, anchor[component]).T
    volume = np.bincount(component, weights=np.where(turn, -volumes, volumes), minlength=count)
    area = np.bincount(component, weights=area, minlength=count)
    return np.asarray((closed & (volume < -FLAT * area**1.5))[component])
