"""Kernels of ``links``: the nearest points of other parts, and the minimum spanning tree of all parts.

Points carry the number of their part, and those of one part are joined beforehand.

Boruvka's rounds on a k-d tree: in each round every cluster finds its nearest point of another cluster, and all these
pairs are joined. A box whose points all lie in one cluster is passed over by that cluster (March, Ram, Gray,
"Fast Euclidean Minimum Spanning Tree", KDD 2010, without the second tree).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["spanning_tree", "touching"]

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

LEAF = 16


@njit(cache=True, nogil=True)
def _tree(points: Array) -> tuple[Indices, Indices, Indices, Array]:
    """order (p,), start and end of each node's points in it (t, 2), its children or -1 (t, 2), and its box (t, 6)."""
    count = len(points)
    order = np.arange(count)
    most = 4 * (count // LEAF + 1) + 1
    spans, children, boxes = np.zeros((most, 2), np.int64), np.full((most, 2), -1, np.int64), np.empty((most, 6))
    spans[0, 1] = count
    made = 1
    node = 0
    while node < made:
        start, end = spans[node]
        for axis in range(3):
            low, high = np.inf, -np.inf
            for i in range(start, end):
                low, high = min(low, points[order[i], axis]), max(high, points[order[i], axis])
            boxes[node, axis], boxes[node, 3 + axis] = low, high
        if end - start > LEAF:
            axis = int(np.argmax(boxes[node, 3:] - boxes[node, :3]))
            own = order[start:end].copy()
            order[start:end] = own[np.argsort(points[own, axis], kind="mergesort")]
            middle = (start + end) // 2
            spans[made], spans[made + 1] = (start, middle), (middle, end)
            children[node] = made, made + 1
            made += 2
        node += 1
    return order, spans[:made], children[:made], boxes[:made]


@njit(cache=True, nogil=True)
def _away(box: Array, x: float, y: float, z: float) -> float:
    """Squared distance of a point from a box."""
    a = max(box[0] - x, x - box[3], 0.0)
    b = max(box[1] - y, y - box[4], 0.0)
    c = max(box[2] - z, z - box[5], 0.0)
    return float(a * a + b * b + c * c)


@njit(cache=True, nogil=True)
def _own(order: Indices, spans: Indices, children: Indices, cluster: Indices) -> Indices:
    """The cluster that all points of each node are in, (t,), or -1. cluster: of each point, (p,)."""
    owner = np.empty(len(spans), np.int64)
    for node in range(len(spans) - 1, -1, -1):
        if children[node, 0] >= 0:
            left, right = owner[children[node, 0]], owner[children[node, 1]]
            owner[node] = left if left == right else -1
        else:
            owner[node] = cluster[order[spans[node, 0]]]
            for i in range(spans[node, 0] + 1, spans[node, 1]):
                if cluster[order[i]] != owner[node]:
                    owner[node] = -1
    return owner


@njit(cache=True, nogil=True)
def _nearest(
    p: int, within: float, points: Array, cluster: Indices, owner: Indices,
    order: Indices, spans: Indices, children: Indices, boxes: Array, stack: Indices,
) -> tuple[int, float]:  # fmt: skip
    """The nearest point of another cluster, at less than ``within`` squared, or -1; and how far, squared."""
    own, found = cluster[p], -1
    x, y, z = points[p]
    stack[0] = 0
    depth = 1
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if owner[node] == own or _away(boxes[node], x, y, z) >= within:
            continue
        if children[node, 0] >= 0:
            near, far = children[node]
            if _away(boxes[far], x, y, z) < _away(boxes[near], x, y, z):
                near, far = far, near
            stack[depth], stack[depth + 1] = far, near
            depth += 2
            continue
        for i in range(spans[node, 0], spans[node, 1]):
            q = order[i]
            if cluster[q] != own:
                dx, dy, dz = points[q, 0] - x, points[q, 1] - y, points[q, 2] - z
                square = dx * dx + dy * dy + dz * dz
                if square < within:
                    within, found = square, q
    return found, within


@njit(cache=True, nogil=True)
def touching(points: Array, part: Indices, reach: float) -> Indices:
    """Each point (p, 3) that has one of another part nearer than ``reach``, with the nearest such, (l, 2)."""
    order, spans, children, boxes = _tree(points)
    owner = _own(order, spans, children, part)
    stack = np.empty(128, np.int64)
    pairs = np.empty((len(points), 2), np.int64)
    count = 0
    for p in range(len(points)):
        q, _ = _nearest(p, reach * reach, points, part, owner, order, spans, children, boxes, stack)
        if q >= 0:
            pairs[count, 0], pairs[count, 1] = p, q
            count += 1
    return pairs[:count]


@njit(cache=True, nogil=True)
def spanning_tree(points: Array, part: Indices, count: int) -> tuple[Indices, Array]:
    """Pairs of points (count - 1, 2) that join all parts, and their squared distances; every part has a point."""
    order, spans, children, boxes = _tree(points)
    root, cluster = np.arange(count), np.empty(len(points), np.int64)
    pairs, squares = np.empty((count - 1, 2), np.int64), np.empty(count - 1)
    joined = 0
    stack = np.empty(128, np.int64)
    while joined < count - 1:
        for p in range(len(points)):
            cluster[p] = root[part[p]]
        owner = _own(order, spans, children, cluster)
        best, pair = np.full(count, np.inf), np.full((count, 2), -1, np.int64)
        for at in range(len(order)):
            p = order[at]
            q, square = _nearest(
                p, best[cluster[p]], points, cluster, owner, order, spans, children, boxes, stack
            )
            if q >= 0:
                best[cluster[p]] = square
                pair[cluster[p], 0], pair[cluster[p], 1] = p, q
        for c in range(count):
            if pair[c, 0] >= 0:
                a, b = _root(root, part[pair[c, 0]]), _root(root, part[pair[c, 1]])
                if a != b:
                    root[max(a, b)] = min(a, b)
                    pairs[joined] = pair[c]
                    squares[joined] = best[c]
                    joined += 1
        for c in range(count):
            root[c] = _root(root, c)
    return pairs, squares


@njit(cache=True, nogil=True)
def _root(root: Indices, one: int) -> int:
    while root[one] != one:
        root[one] = root[root[one]]
        one = root[one]
    return one
