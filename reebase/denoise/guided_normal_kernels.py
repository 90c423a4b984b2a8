"""The guiding normals of guided normal filtering. Assumes valid input."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from reebase.denoise.exponential_kernels import FAST

__all__ = ["guiding_normals"]

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]

LEAST_SUM = 1e-9
"""Added to the sum of differences across edges, which is 0 on a plane."""


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "nnan", "nsz"})
def widest_chord(x: FloatArray, y: FloatArray, z: FloatArray, count: int) -> float:
    """The largest |n_s - n_r|^2 of the first ``count`` vectors."""
    widest = 0.0
    for one in range(count):
        a, b, c = x[one], y[one], z[one]
        for other in range(one + 1, count):
            u, v, w = x[other] - a, y[other] - b, z[other] - c
            widest = max(widest, u * u + v * v + w * w)
    return widest


@FAST
def guiding_normals(
    normals: FloatArray, areas: FloatArray, starts: IntArray, rows: IntArray, beside: IntArray
) -> FloatArray:
    """g of each face, (n, 3): the mean normal of the patch with the least H that holds it.

    rows: the faces round each face. beside: across each side the other one if it comes later, else
    the face itself, (n, 3).
    """
    count = len(normals)
    means, unevenness = np.zeros((count, 3)), np.empty(count)
    differences = chords_across(normals, beside)
    mark = np.full(count, -1, dtype=np.int32)
    longest = 0
    for t in range(count):
        longest = max(longest, starts[t + 1] - starts[t])
    xs, ys, zs = np.empty(longest + 1), np.empty(longest + 1), np.empty(longest + 1)
    for t in range(count):
        begin, end = np.uint32(starts[t]), np.uint32(starts[t + 1])
        mark[t] = t
        for k in range(begin, end):
            mark[np.uint32(rows[k])] = t
        size = starts[t + 1] - starts[t] + 1
        steepest, total = 0.0, 0.0
        x, y, z = 0.0, 0.0, 0.0
        for place in range(size):
            s = np.uint32(rows[begin + place]) if place < size - 1 else np.uint32(t)
            nx, ny, nz = normals[s, 0], normals[s, 1], normals[s, 2]
            xs[place], ys[place], zs[place] = nx, ny, nz
            x += areas[s] * nx
            y += areas[s] * ny
            z += areas[s] * nz
            for side in range(3):
                # No branch: whether the other face is in the patch is as good as random.
                phi = differences[s, side] * (mark[np.uint32(beside[s, side])] == t)
                steepest = max(steepest, phi)
                total += phi
        unevenness[t] = math.sqrt(widest_chord(xs, ys, zs, size)) * steepest / (LEAST_SUM + total)
        length = math.sqrt(x * x + y * y + z * z)
        if length > 0.0:
            means[t, 0], means[t, 1], means[t, 2] = x / length, y / length, z / length
    result = np.empty((count, 3))
    for t in range(count):
        best, least = np.uint32(t), unevenness[t]
        for k in range(np.uint32(starts[t]), np.uint32(starts[t + 1])):
            s = np.uint32(rows[k])
            better = unevenness[s] < least
            best = s if better else best
            least = min(least, unevenness[s])
        result[t, 0], result[t, 1], result[t, 2] = means[best, 0], means[best, 1], means[best, 2]
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
