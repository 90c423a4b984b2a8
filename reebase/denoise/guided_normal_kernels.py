"""The guiding normals of guided normal filtering. Assumes valid input."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["guiding_normals"]

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]

LEAST_SUM = 1e-9
"""Added to the sum of differences across edges, which is 0 on a plane."""


@njit(cache=True, nogil=True)
def square_chord(normals: FloatArray, s: int, r: int) -> float:
    """|n_s - n_r|^2."""
    x, y, z = normals[s, 0] - normals[r, 0], normals[s, 1] - normals[r, 1], normals[s, 2] - normals[r, 2]
    return float(x * x + y * y + z * z)


@njit(cache=True, nogil=True)
def guiding_normals(
    normals: FloatArray, areas: FloatArray, starts: IntArray, rows: IntArray, next_starts: IntArray, beside: IntArray
) -> FloatArray:
    """g of each face, (n, 3): the mean normal of the patch with the least H that holds it.

    rows: the faces round each face. beside: those across an edge, in compressed rows too.
    """
    count = len(normals)
    means, unevenness = np.zeros((count, 3)), np.empty(count)
    mark = np.full(count, -1, dtype=np.int32)
    for t in range(count):
        begin, end = starts[t], starts[t + 1]
        mark[t] = t
        for k in range(begin, end):
            mark[rows[k]] = t
        widest, steepest, total = 0.0, 0.0, 0.0
        x, y, z = 0.0, 0.0, 0.0
        for k in range(begin, end + 1):
            s = rows[k] if k < end else t
            x += areas[s] * normals[s, 0]
            y += areas[s] * normals[s, 1]
            z += areas[s] * normals[s, 2]
            for other in range(k + 1, end + 1):
                widest = max(widest, square_chord(normals, s, rows[other] if other < end else t))
            for side in range(next_starts[s], next_starts[s + 1]):
                r = beside[side]
                if r > s and mark[r] == t:
                    phi = math.sqrt(square_chord(normals, s, r))
                    steepest = max(steepest, phi)
                    total += phi
        unevenness[t] = math.sqrt(widest) * steepest / (LEAST_SUM + total)
        length = math.sqrt(x * x + y * y + z * z)
        if length > 0.0:
            means[t, 0], means[t, 1], means[t, 2] = x / length, y / length, z / length
    result = np.empty((count, 3))
    for t in range(count):
        best = t
        for k in range(starts[t], starts[t + 1]):
            if unevenness[rows[k]] < unevenness[best]:
                best = rows[k]
        result[t, 0], result[t, 1], result[t, 2] = means[best, 0], means[best, 1], means[best, 2]
    return result
