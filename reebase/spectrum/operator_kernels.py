"""The kernel of the operator: stiffness in CSR and mixed Voronoi areas, in three passes over the triangles.

Sides are gathered at their smaller end by a counting sort, so that each edge is summed once: C is symmetric to the
last bit. Rows come out sorted without any sorting; time is linear whatever the valences.
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
CANCELLED = 1e-3  # share of the longest edge squared below which twice the area has lost digits to cancellation


@njit(cache=True, nogil=True)
def _cross(ux: float, uy: float, uz: float, vx: float, vy: float, vz: float) -> float:
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return math.sqrt(x * x + y * y + z * z)


@njit(cache=True, nogil=True)
def _triangle(vertices: Float, i: int, j: int, k: int) -> tuple[float, float, float, float, float]:
    """Products of the two edges that leave each corner, twice the area, longest edge squared."""
    xi, yi, zi = vertices[i, 0], vertices[i, 1], vertices[i, 2]
    xj, yj, zj = vertices[j, 0], vertices[j, 1], vertices[j, 2]
    xk, yk, zk = vertices[k, 0], vertices[k, 1], vertices[k, 2]
    ax, ay, az = xk - xj, yk - yj, zk - zj
    bx, by, bz = xi - xk, yi - yk, zi - zk
    cx, cy, cz = xj - xi, yj - yi, zj - zi
    gi, gj, gk = -(bx * cx + by * cy + bz * cz), -(cx * ax + cy * ay + cz * az), -(ax * bx + ay * by + az * bz)
    a, b, c = gj + gk, gk + gi, gi + gj
    longest = max(a, b, c)
    double_area = _cross(ax, ay, az, bx, by, bz)
    if double_area < CANCELLED * longest:  # the cross product of the two shortest edges is the least cancelled one
        if a == longest:
            double_area = _cross(bx, by, bz, cx, cy, cz)
        elif b == longest:
            double_area = _cross(cx, cy, cz, ax, ay, az)
    return gi, gj, gk, double_area, longest


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
    """C in CSR (pointers, indices, values), R (m,), how many triangles are badly shaped, and the most faces at an edge.

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
        inverse = 1.0 / max(double_area, flat * longest, TINY)
        half = 0.5 * inverse
        v = min(j, k)
        at = cursor[v]
        other[at], weight[at], cursor[v] = max(j, k), gi * half, at + 1
        v = min(k, i)
        at = cursor[v]
        other[at], weight[at], cursor[v] = max(k, i), gj * half, at + 1
        v = min(i, j)
        at = cursor[v]
        other[at], weight[at], cursor[v] = max(i, j), gk * half, at + 1
        if min(gi, gj, gk) < 0.0:
            mass[i] += (0.25 if gi < 0.0 else 0.125) * double_area
            mass[j] += (0.25 if gj < 0.0 else 0.125) * double_area
            mass[k] += (0.25 if gk < 0.0 else 0.125) * double_area
        else:  # the products at its two ends sum to the squared length of an edge
            share = 0.125 * inverse if double_area > 0.0 else 0.0
            si, sj, sk = (gj + gk) * gi * share, (gk + gi) * gj * share, (gi + gj) * gk * share
            mass[i] += sj + sk
            mass[j] += sk + si
            mass[k] += si + sj
    pointers, crowd = _merge(starts, cursor, other, weight)
    indices, values = _fill(pointers, starts, cursor, other, weight)
    return pointers, indices, values, mass, bad, crowd


@njit(cache=True, nogil=True)
def _merge(starts: Int32, cursor: Int32, other: Int32, weight: Float) -> tuple[Int32, int]:
    """Make the sides at each vertex its edges to later ones, at the front of their stretch up to ``cursor``.

    Returns the pointers of C (m + 1,) and the most sides of an edge. Without a branch, as whether a side is the first
    of its edge cannot be foreseen.
    """
    m = len(cursor)
    pointers, place, sides = np.zeros(m + 1, np.int32), np.full(m, -1, np.int32), np.empty(len(other), np.int32)
    crowd = 1
    for v in range(m):
        begin = end = starts[v]
        for at in range(begin, starts[v + 1]):
            w, value = other[at], weight[at]
            known = place[w]
            new = (known < begin) & (w != v)  # a face may have a corner twice
            to = end if known < begin else known
            other[to], weight[to] = w, value if new else weight[to] + value
            sides[to] = 1 if new else sides[to] + 1
            crowd = max(crowd, sides[to] * (w != v))
            place[w] = to if w != v else known
            end += new
            pointers[w + 1] += new
        cursor[v] = end
        pointers[v + 1] += end - begin + 1
    for v in range(m):
        pointers[v + 1] += pointers[v]
    return pointers, crowd


@njit(cache=True, nogil=True)
def _fill(pointers: Int32, starts: Int32, ends: Int32, other: Int32, weight: Float) -> tuple[Int32, Float]:
    """Columns and values of C from each vertex's edges to later ones, in any order.

    Rows come sorted by taking vertices upwards: first what is before the diagonals, then, read off that, what is after.
    """
    m = len(ends)
    indices, values = np.empty(pointers[m], np.int32), np.empty(pointers[m])
    cursor, diagonal = pointers[:-1].copy(), np.zeros(m)
    for v in range(m):
        total = diagonal[v]
        for e in range(starts[v], ends[v]):
            w, value = other[e], weight[e]
            at = cursor[w]
            indices[at], values[at], cursor[w] = v, -value, at + 1
            diagonal[w] += value
            total += value
        diagonal[v] = total
    for w in range(m):
        end = cursor[w]
        indices[end], values[end], cursor[w] = w, diagonal[w], end + 1
        for e in range(pointers[w], end):
            at = cursor[indices[e]]
            indices[at], values[at], cursor[indices[e]] = w, values[e], at + 1
    return indices, values
