"""Kernels of the Reeb graph: a mesh cut by the levels u = 0, 1, ..., N, in time linear in faces plus pieces.

u is the scalar field in units of the band width, from 0 to N; a value is on a level exactly or clearly off
it. Band b is b <= u <= b + 1. The pieces of face f lie in consecutive bands from ``first[f]`` on and have the
numbers ``offset[f]`` to ``offset[f + 1] - 1``.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["adjacent_faces", "cut_faces", "extreme_rings", "join_pieces", "measure_components"]

Float = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]
Int64 = npt.NDArray[np.int64]

NOTHING = 1e-200  # the weight of a piece without area in its component's centroid


@njit(cache=True, nogil=True)
def _bands_met(low: float, high: float, bands: int) -> tuple[int, int]:
    """First and last band that [low, high] meets in more than a point; for low = high those that hold it."""
    band = int(np.floor(low))
    if low < high:
        return band, int(np.ceil(high)) - 1
    if low == band:  # a level belongs to the band on either side of it
        return max(band - 1, 0), min(band, bands - 1)
    return band, band


@njit(cache=True, nogil=True)
def _find(parent: Int64, x: int) -> int:
    while parent[x] != x:
        parent[x] = parent[parent[x]]
        x = parent[x]
    return x


@njit(cache=True, nogil=True)
def _join(parent: Int64, x: int, y: int) -> bool:
    """Whether the two were apart."""
    x, y = _find(parent, x), _find(parent, y)
    parent[max(x, y)] = min(x, y)
    return x != y


@njit(cache=True, nogil=True)
def _half_edges(m: int, faces: Int32) -> tuple[Int32, Int32]:
    """Face and larger end (3 n, 2) of all sides of faces, by their smaller end, and where each end starts (m + 1,)."""
    start = np.zeros(m + 1, np.int32)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        start[min(a, b)] += 1
        start[min(b, c)] += 1
        start[min(c, a)] += 1
    total = 0
    for v in range(m):
        total += start[v]
        start[v] = total
    start[m] = total
    half_edges = np.empty((total, 2), np.int32)
    for f in range(len(faces) - 1, -1, -1):  # backwards, so that each end's sides are in the order of the faces
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        for v, w in ((c, a), (b, c), (a, b)):
            low = min(v, w)
            start[low] -= 1
            half_edges[start[low], 0] = f
            half_edges[start[low], 1] = max(v, w)
    return half_edges, start


@njit(cache=True, nogil=True)
def cut_faces(u: Float, faces: Int32, bands: int) -> tuple[Int32, Int64]:
    """``first`` (n,) and ``offset`` (n + 1,): the bands that each face meets; two if it lies in a level."""
    n = len(faces)
    first = np.empty(n, np.int32)
    offset = np.zeros(n + 1, np.int64)
    for f in range(n):
        a, b, c = u[faces[f, 0]], u[faces[f, 1]], u[faces[f, 2]]
        low, high = _bands_met(min(a, b, c), max(a, b, c), bands)
        first[f] = low
        offset[f + 1] = offset[f] + high - low + 1
    return first, offset


@njit(cache=True, nogil=True)
def _chain(
    f: int, v: int, w: int, below: bool, above: bool, owner: Int32, pairs: Int32, ends: Int32, count: int
) -> int:
    """Pair face f with the last ones below and above at the edge (v, w), and put it in their place."""
    for side in range(2):
        g = owner[side]
        if g >= 0 and g != f and (side == 0 or g != owner[0]):
            pairs[count, 0], pairs[count, 1] = g, f
            ends[count, 0], ends[count, 1] = v, w
            count += 1
    if below:
        owner[0] = f
    if above:
        owner[1] = f
    return count


@njit(cache=True, nogil=True)
def adjacent_faces(  # noqa: PLR0912 - one pass over edges, one over vertices
    u: Float, faces: Int32, first: Int32, offset: Int64
) -> tuple[Int32, Int32, int]:
    """Pairs of faces that touch (p, 2), the ends of what they share (p, 2), and the number of separate parts.

    The faces round an edge are chained in the order of the file; round an edge within a level those above
    and those below each have their chain, so that what is joined does not depend on that order. A vertex at
    which parts of the surface hang together that share no edge counts as an edge without length.
    """
    m, n = len(u), len(faces)
    half_edges, start = _half_edges(m, faces)
    pairs, ends = np.empty((12 * n, 2), np.int32), np.empty((12 * n, 2), np.int32)
    count = 0
    owner = np.full((m, 2), -1, np.int32)
    part = np.arange(n)
    for v in range(m):
        for h in range(start[v], start[v + 1]):
            owner[half_edges[h, 1]] = -1
        for h in range(start[v], start[v + 1]):
            f, w = half_edges[h, 0], half_edges[h, 1]
            if u[v] == u[w]:
                below, above = first[f] < u[v], first[f] + offset[f + 1] - offset[f] > u[v]
                count = _chain(f, v, w, below, above, owner[w], pairs, ends, count)
                continue
            g = owner[w, 0]
            owner[w, 0] = f
            if g >= 0 and g != f:
                pairs[count, 0], pairs[count, 1] = g, f
                ends[count, 0], ends[count, 1] = v, w
                count += 1
    parts = n
    for p in range(count):
        parts -= _join(part, pairs[p, 0], pairs[p, 1])
    if parts == 1:
        return pairs[:count], ends[:count], parts
    for f in range(n):
        part[f] = _find(part, f)
    some, hanging = np.full(m, -1, np.int64), np.zeros(m, np.bool_)
    for f in range(n):
        for v in faces[f]:
            hanging[v] |= some[v] >= 0 and some[v] != part[f]
            some[v] = part[f]
    owner[:] = -1
    by_edges = count
    for f in range(n):
        for v in faces[f]:
            if hanging[v]:
                below, above = first[f] < u[v], first[f] + offset[f + 1] - offset[f] > u[v]
                count = _chain(f, v, v, below, above, owner[v], pairs, ends, count)
    for p in range(by_edges, count):
        parts -= _join(part, pairs[p, 0], pairs[p, 1])
    return pairs[:count], ends[:count], parts


@njit(cache=True, nogil=True)
def join_pieces(
    u: Float, bands: int, first: Int32, offset: Int64, pairs: Int32, ends: Int32
) -> tuple[Int64, Int32, Int64]:
    """Component of each piece (P,), band of each component (c,), and adjacent components (q, 2).

    Components are numbered by their first piece. Adjacent ones share a stretch of level curve: two pieces of
    one face, or an edge within a level that has one face above and one below. The lower comes first in its
    row; rows may repeat.
    """
    parent = np.arange(offset[-1])
    across = np.empty((len(pairs), 2), np.int64)
    crossings = 0
    for p in range(len(pairs)):
        f, g = pairs[p, 0], pairs[p, 1]
        if first[f] == first[g] and offset[f + 1] - offset[f] == 1 and offset[g + 1] - offset[g] == 1:
            _join(parent, offset[f], offset[g])  # both lie in one band, and so does what they share
            continue
        s, t = u[ends[p, 0]], u[ends[p, 1]]
        low, high = _bands_met(min(s, t), max(s, t), bands)
        shared = False
        for band in range(low, high + 1):
            x, y = offset[f] + band - first[f], offset[g] + band - first[g]
            if offset[f] <= x < offset[f + 1] and offset[g] <= y < offset[g + 1]:
                _join(parent, x, y)
                shared = True
        if not shared:  # the edge lies in the level between bands low and high = low + 1
            below, above = (f, g) if first[g] == high else (g, f)
            across[crossings, 0], across[crossings, 1] = offset[below + 1] - 1, offset[above]
            crossings += 1
    component = np.empty(len(parent), np.int64)
    count = 0
    for x in range(len(parent)):
        if parent[x] == x:
            component[x] = count
            count += 1
        else:  # a root is the smallest of its component, so it is numbered by now
            component[x] = component[_find(parent, x)]
    band_of = np.empty(count, np.int32)
    adjacent = np.empty((len(parent) - len(first) + crossings, 2), np.int64)
    q = 0
    for f in range(len(first)):
        for x in range(offset[f], offset[f + 1]):
            band_of[component[x]] = first[f] + x - offset[f]
            if x > offset[f]:
                adjacent[q, 0], adjacent[q, 1] = component[x - 1], component[x]
                q += 1
    for p in range(crossings):
        adjacent[q + p, 0], adjacent[q + p, 1] = component[across[p, 0]], component[across[p, 1]]
    return component, band_of, adjacent


@njit(cache=True, nogil=True)
def _between(start: float, end: float, bottom: float, top: float) -> tuple[float, float]:
    """Share and centroid of what lies between two levels, 0 at the corner to 1 at the far side.

    The level lines widen from a corner at ``start`` to a side at ``end``.
    """
    height = abs(end - start)
    near, far = (bottom - start, top - start) if start < end else (start - top, start - bottom)
    p, q = max(near, 0.0) / height, min(far / height, 1.0)
    return (q - p) * (q + p), (p * p + p * q + q * q) / (1.5 * (p + q))


@njit(cache=True, nogil=True)
def _add(
    weight: float, a: Float, b: Float, c: Float, shares: tuple[float, float, float], moments: Float
) -> float:
    """Add a piece with the given barycentric centroid to its component's moments; returns its weight."""
    weight = max(weight, NOTHING)
    for axis in range(3):
        moments[axis] += weight * (shares[0] * a[axis] + shares[1] * b[axis] + shares[2] * c[axis])
    return weight


@njit(cache=True, nogil=True)
def measure_components(
    vertices: Float, faces: Int32, u: Float, first: Int32, offset: Int64, component: Int64, count: int
) -> tuple[Float, Float, Float]:
    """Area (c,) and area centroid (c, 3) of each component, and area of the ring of each vertex (m,).

    With corners in the order u0 <= u1 <= u2, the level lines of a face have their middles on two straight
    lines, and lengths that grow in proportion to u - u0 up to u1, then shrink in proportion to u2 - u: area
    and centroid between two levels follow in closed form, without a difference of large areas.
    """
    areas, moments = np.zeros(count), np.zeros((count, 3))
    rings = np.zeros(len(vertices))
    third = 1.0 / 3.0
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        if u[i] > u[j]:
            i, j = j, i
        if u[j] > u[k]:
            j, k = k, j
        if u[i] > u[j]:
            i, j = j, i
        a, b, c = vertices[i], vertices[j], vertices[k]
        x = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
        y = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
        z = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        area = 0.5 * np.sqrt(x * x + y * y + z * z)
        rings[i] += area
        rings[j] += area
        rings[k] += area
        low, middle, high = u[i], u[j], u[k]
        pieces = offset[f + 1] - offset[f]
        for n in range(offset[f], offset[f + 1]):
            node, bottom = component[n], float(first[f] + n - offset[f])
            if pieces == 1 or low == high:  # whole, or halved between the two sides of a level
                areas[node] += _add(area / pieces, a, b, c, (third, third, third), moments[node])
                continue
            if low < middle and bottom < middle:  # the part that widens from a
                part = (middle - low) / (high - low)
                share, along = _between(low, middle, bottom, bottom + 1.0)
                weights = 1.0 - 0.5 * along * (1.0 + part), 0.5 * along, 0.5 * along * part
                areas[node] += _add(area * part * share, a, b, c, weights, moments[node])
            if middle < high and middle < bottom + 1.0:  # the part that narrows to c
                part = (high - middle) / (high - low)
                share, along = _between(high, middle, bottom, bottom + 1.0)
                weights = 0.5 * along * part, 0.5 * along, 1.0 - 0.5 * along * (1.0 + part)
                areas[node] += _add(area * part * share, a, b, c, weights, moments[node])
    return areas, moments / areas.reshape(-1, 1), rings


@njit(cache=True, nogil=True)
def extreme_rings(
    faces: Int32, u: Float, first: Int32, offset: Int64, component: Int64, rings: Float, count: int
) -> tuple[Float, Float]:
    """Lowest and highest value at a vertex of each component (c, 2), and the largest ring there (c, 2)."""
    values, areas = np.empty((count, 2)), np.zeros((count, 2))
    values[:, 0], values[:, 1] = np.inf, -np.inf
    for f in range(len(faces)):
        pieces = offset[f + 1] - offset[f]
        for i in range(3):
            v = faces[f, i]
            for x in range(offset[f], offset[f + 1]):
                node, band = component[x], first[f] + x - offset[f]
                if pieces == 1 or band <= u[v] <= band + 1:
                    if u[v] < values[node, 0] or (u[v] == values[node, 0] and rings[v] > areas[node, 0]):
                        values[node, 0], areas[node, 0] = u[v], rings[v]
                    if u[v] > values[node, 1] or (u[v] == values[node, 1] and rings[v] > areas[node, 1]):
                        values[node, 1], areas[node, 1] = u[v], rings[v]
    return values, areas
