"""The guiding normals of guided normal filtering. Assumes valid input."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

from reebase.denoise.exponential_kernels import FAST

__all__ = ["guiding_normals", "within_patches"]

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]

LEAST_SUM = 1e-9
"""Added to the sum of differences across edges, which is 0 on a plane."""


BLOCK = 64
"""Patches of as many faces are worked on so many at a time, a patch a column: loops over columns become vectors."""


@FAST
def within_patches(starts: IntArray, rows: IntArray, beside: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Faces by the size of their patch, (n,); and the sides 3s + k of each patch across which another face of it comes
    later, in compressed rows.

    starts, rows, beside: as for ``guiding_normals``.
    """
    count = len(starts) - 1
    longest = 0
    for t in range(count):
        longest = max(longest, starts[t + 1] - starts[t])
    ends = np.zeros(longest + 2, dtype=np.int64)
    for t in range(count):
        ends[starts[t + 1] - starts[t] + 1] += 1
    for size in range(longest + 1):
        ends[size + 1] += ends[size]
    order = np.empty(count, dtype=np.int32)
    for t in range(count):
        size = starts[t + 1] - starts[t]
        order[ends[size]] = t
        ends[size] += 1
    mark = np.full(count, -1, dtype=np.int32)
    side_starts, sides = np.zeros(count + 1, dtype=np.int32), np.empty(3 * (len(rows) + count), dtype=np.int32)
    filled: Any = np.uint32(0)
    for t in range(count):
        begin, end = np.uint32(starts[t]), np.uint32(starts[t + 1])
        mark[t] = t
        for k in range(begin, end):
            mark[np.uint32(rows[k])] = t
        for k in range(begin, end + 1):
            s = np.uint32(rows[k]) if k < end else np.uint32(t)
            for side in range(3):
                # Written either way, and kept if the other face is in the patch: that is as good as random.
                other = np.uint32(beside[s, side])
                sides[filled] = 3 * s + side
                filled += np.uint32((mark[other] == t) & (other != s))
        side_starts[t + 1] = filled
    return order, side_starts, sides[:filled].copy()


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz"})
def widest_chords(members: FloatArray, size: int, filled: int, widest: FloatArray) -> None:
    """The largest |n_s - n_r|^2 in each of the first ``filled`` columns of members, (3, slots, columns)."""
    for v in range(filled):
        widest[v] = 0.0
    for one in range(size):
        for other in range(one + 1, size):
            for v in range(filled):
                x = members[0, one, v] - members[0, other, v]
                y = members[1, one, v] - members[1, other, v]
                z = members[2, one, v] - members[2, other, v]
                widest[v] = max(widest[v], x * x + y * y + z * z)


@FAST
def guiding_normals(
    normals: FloatArray, areas: FloatArray, starts: IntArray, rows: IntArray, beside: IntArray, order: IntArray,
    side_starts: IntArray, sides: IntArray,
) -> FloatArray:  # fmt: skip
    """g of each face, (n, 3): the mean normal of the patch with the least H that holds it.

    rows: the faces round each face. beside: across each side the other one if it comes later, else
    the face itself, (n, 3). order, side_starts, sides: of ``within_patches``.
    """
    count = len(normals)
    means, unevenness = np.zeros((count, 3)), np.empty(count)
    differences = chords_across(normals, beside).reshape(-1)
    longest = 1 + (starts[order[-1] + 1] - starts[order[-1]] if count else 0)
    members, widest = np.empty((3, longest, BLOCK)), np.empty(BLOCK)
    first = 0
    while first < count:
        size = starts[order[first] + 1] - starts[order[first]] + 1
        filled = 0
        while filled < BLOCK and first + filled < count:
            t = np.uint32(order[first + filled])
            begin, end = np.uint32(starts[t]), np.uint32(starts[t + np.uint32(1)])
            if end - begin != size - 1:
                break
            x, y, z = 0.0, 0.0, 0.0
            for place in range(size):
                s = np.uint32(rows[begin + np.uint32(place)]) if place < size - 1 else t
                nx, ny, nz = normals[s, 0], normals[s, 1], normals[s, 2]
                members[0, place, filled], members[1, place, filled], members[2, place, filled] = nx, ny, nz
                x += areas[s] * nx
                y += areas[s] * ny
                z += areas[s] * nz
            length = math.sqrt(x * x + y * y + z * z)
            if length > 0.0:
                means[t, 0], means[t, 1], means[t, 2] = x / length, y / length, z / length
            filled += 1
        widest_chords(members, size, filled, widest)
        for v in range(filled):
            t = np.uint32(order[first + v])
            steepest, total = 0.0, 0.0
            for k in range(np.uint32(side_starts[t]), np.uint32(side_starts[t + np.uint32(1)])):
                phi = differences[np.uint32(sides[k])]
                steepest = max(steepest, phi)
                total += phi
            unevenness[t] = math.sqrt(widest[v]) * steepest / (LEAST_SUM + total)
        first += filled
    result = np.empty((count, 3))
    for face in range(count):
        best, least = np.uint32(face), unevenness[face]
        for k in range(np.uint32(starts[face]), np.uint32(starts[face + 1])):
            s = np.uint32(rows[k])
            better = unevenness[s] < least
            best = s if better else best
            least = min(least, unevenness[s])
        result[face, 0], result[face, 1], result[face, 2] = means[best, 0], means[best, 1], means[best, 2]
    return result


@FAST
def chords_across(normals: FloatArray, beside: IntArray) -> FloatArray:
    """|n_s - n_r| of each face s and each r beside it, (n, 3)."""
    result = np.empty((len(normals), 3))
    for s in range(len(normals)):
        for side in range(3):
            r = np.uint32(beside[s, side])
            x, y, z = normals[s, 0] - normals[r, 0], normals[s, 1] - normals[r, 1], normals[s, 2] - normals[r, 2]
            result[s, side] = math.sqrt(x * x + y * y + z * z)
    return result
