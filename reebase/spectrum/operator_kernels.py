"""The kernel of the operator: stiffness in CSR and mixed Voronoi areas, in three passes over the triangles.

Edges are gathered at their smaller end by a counting sort, so that each is summed once: C is symmetric to the last
bit, and rows come out sorted.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["assemble"]

Float = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]

TINY = np.finfo(np.float64).tiny


@njit(cache=True, nogil=True, error_model="numpy")
def _triangle(vertices: Float, i: int, j: int, k: int) -> tuple[float, float, float, float, float]:
    """Products of the two edges that leave each corner, twice the area, longest edge squared."""
    xi, yi, zi = vertices[i, 0], vertices[i, 1], vertices[i, 2]
    xj, yj, zj = vertices[j, 0], vertices[j, 1], vertices[j, 2]
    xk, yk, zk = vertices[k, 0], vertices[k, 1], vertices[k, 2]
    ax, ay, az = xk - xj, yk - yj, zk - zj
    bx, by, bz = xi - xk, yi - yk, zi - zk
    cx, cy, cz = xj - xi, yj - yi, zj - zi
    a, b, c = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz, cx * cx + cy * cy + cz * cz
    gi, gj, gk = -(bx * cx + by * cy + bz * cz), -(cx * ax + cy * ay + cz * az), -(ax * bx + ay * by + az * bz)
    # The cross product of the two shortest edges is the least cancelled one.
    if a >= b and a >= c:
        ax, ay, az = cx, cy, cz
    elif b >= c:
        bx, by, bz = cx, cy, cz
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return gi, gj, gk, math.sqrt(nx * nx + ny * ny + nz * nz), max(a, b, c)


@njit(cache=True, nogil=True, error_model="numpy")
def _cells(gi: float, gj: float, gk: float, double_area: float) -> tuple[float, float, float]:
    """The mixed Voronoi areas of the corners of a triangle."""
    if gi < 0.0 or gj < 0.0 or gk < 0.0:
        quarter, eighth = 0.25 * double_area, 0.125 * double_area
        return quarter if gi < 0.0 else eighth, quarter if gj < 0.0 else eighth, quarter if gk < 0.0 else eighth
    if double_area == 0.0:
        return 0.0, 0.0, 0.0
    # the products at its two ends sum to the squared length of an edge
    share = 0.125 / double_area
    si, sj, sk = (gj + gk) * gi * share, (gk + gi) * gj * share, (gi + gj) * gk * share
    return sj + sk, sk + si, si + sj


@njit(cache=True, nogil=True)
def _side_starts(m: int, faces: Int32) -> Int32:
    """Where the sides at each vertex, the smaller of their ends, begin, (m + 1,)."""
    starts = np.zeros(m + 1, np.int32)
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        starts[min(i, j) + 1] += 1
        starts[min(j, k) + 1] += 1
        starts[min(k, i) + 1] += 1
    for v in range(m):
        starts[v + 1] += starts[v]
    return starts


@njit(cache=True, nogil=True, error_model="numpy")
def assemble(
    vertices: Float, faces: Int32, flat: float, thin: float
) -> tuple[Int32, Int32, Float, Float, int, int]:
    """C in CSR (pointers, indices, values), R (m,), the number of badly shaped triangles, and of edges with more
    than two faces.

    Heights below ``flat`` of the longest edge count as that in C; a triangle is badly shaped when its height is
    below ``thin`` of its longest edge.
    """
    m = len(vertices)
    starts = _side_starts(m, faces)
    cursor = starts[:-1].copy()
    other, weight = np.empty(3 * len(faces), np.int32), np.empty(3 * len(faces))
    mass = np.zeros(m)
    bad = 0
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        gi, gj, gk, double_area, longest = _triangle(vertices, i, j, k)
        bad += double_area <= thin * longest
        half = 0.5 / max(double_area, flat * longest, TINY)
        v = min(j, k)
        at = cursor[v]
        other[at], weight[at], cursor[v] = max(j, k), gi * half, at + 1
        v = min(k, i)
        at = cursor[v]
        other[at], weight[at], cursor[v] = max(k, i), gj * half, at + 1
        v = min(i, j)
        at = cursor[v]
        other[at], weight[at], cursor[v] = max(i, j), gk * half, at + 1
        si, sj, sk = _cells(gi, gj, gk, double_area)
        mass[i] += si
        mass[j] += sj
        mass[k] += sk
    pointers, crowded = _merge(starts, cursor, other, weight)
    indices, values = _fill(pointers, starts, cursor, other, weight)
    return pointers, indices, values, mass, bad, crowded


@njit(cache=True, nogil=True)
def _merge(starts: Int32, cursor: Int32, other: Int32, weight: Float) -> tuple[Int32, int]:
    """Make the sides at each vertex its edges to later ones, sorted, at the front of their stretch up to ``cursor``.

    Returns the pointers of C (m + 1,) and the number of edges that have more than two sides.
    """
    m = len(cursor)
    pointers = np.zeros(m + 1, np.int32)
    sides = np.zeros(len(other), np.int8)
    crowded = 0
    for v in range(m):
        begin = end = starts[v]
        for at in range(begin, starts[v + 1]):
            w, value = other[at], weight[at]
            if w == v:  # a face with a corner twice
                continue
            place = end
            while place > begin and other[place - 1] > w:
                place -= 1
            if place > begin and other[place - 1] == w:
                weight[place - 1] += value
                sides[place - 1] = min(sides[place - 1] + 1, 4)
                crowded += sides[place - 1] == 3
                continue
            for later in range(end, place, -1):
                other[later], weight[later], sides[later] = other[later - 1], weight[later - 1], sides[later - 1]
            other[place], weight[place], sides[place] = w, value, 1
            end += 1
            pointers[w + 1] += 1
        cursor[v] = end
        pointers[v + 1] += end - begin + 1
    for v in range(m):
        pointers[v + 1] += pointers[v]
    return pointers, crowded


@njit(cache=True, nogil=True)
def _fill(pointers: Int32, starts: Int32, ends: Int32, other: Int32, weight: Float) -> tuple[Int32, Float]:
    """Columns and values of C from each vertex's edges to later ones.

    Rows are taken upwards, so that what is before the diagonal of a row has come in order when its turn comes.
    """
    m = len(ends)
    indices, values = np.empty(pointers[m], np.int32), np.empty(pointers[m])
    cursor, diagonal = pointers[:-1].copy(), np.zeros(m)
    for v in range(m):
        at, total = cursor[v] + 1, diagonal[v]
        for e in range(starts[v], ends[v]):
            w, value = other[e], weight[e]
            indices[at], values[at] = w, -value
            at += 1
            indices[cursor[w]], values[cursor[w]] = v, -value
            cursor[w] += 1
            diagonal[w] += value
            total += value
        indices[cursor[v]], values[cursor[v]] = v, total
    return indices, values
