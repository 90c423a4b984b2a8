"""One step of kernel weighted diffusion over one-rings. Assumes valid input."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["kernel_step"]

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]


@njit(cache=True, nogil=True)
def kernel_step(positions: FloatArray, starts: IntArray, neighbours: IntArray, ridge: float) -> FloatArray:
    """The weighted mean of v_j - v_i over the ring and i itself, (m, 3), zero without neighbours."""
    result = np.zeros_like(positions)
    for i in range(len(positions)):
        begin, end = starts[i], starts[i + 1]
        if begin == end:
            continue
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        cx, cy, cz = 0.0, 0.0, 0.0
        for k in range(begin, end):
            j = neighbours[k]
            cx += positions[j, 0] - x
            cy += positions[j, 1] - y
            cz += positions[j, 2] - z
        cx, cy, cz = cx / (end - begin), cy / (end - begin), cz / (end - begin)
        a, b, c, d, e, f = ridge, 0.0, 0.0, ridge, 0.0, ridge
        for k in range(begin, end):
            j = neighbours[k]
            ux, uy, uz = positions[j, 0] - x - cx, positions[j, 1] - y - cy, positions[j, 2] - z - cz
            a += ux * ux
            b += ux * uy
            c += ux * uz
            d += uy * uy
            e += uy * uz
            f += uz * uz
        # Cofactors of ((a, b, c), (b, d, e), (c, e, f)): its inverse times its determinant.
        ia, ib, ic = d * f - e * e, c * e - b * f, b * e - c * d
        id_, ie, if_ = a * f - c * c, b * c - a * e, a * d - b * b
        determinant = a * ia + b * ib + c * ic
        total, sx, sy, sz = 1.0, 0.0, 0.0, 0.0
        for k in range(begin, end):
            j = neighbours[k]
            ux, uy, uz = positions[j, 0] - x, positions[j, 1] - y, positions[j, 2] - z
            form = ux * (ia * ux + 2.0 * (ib * uy + ic * uz)) + uy * (id_ * uy + 2.0 * ie * uz) + uz * if_ * uz
            weight = math.exp(-0.5 * max(form, 0.0) / determinant)
            total += weight
            sx += weight * ux
            sy += weight * uy
            sz += weight * uz
        result[i, 0], result[i, 1], result[i, 2] = sx / total, sy / total, sz / total
    return result
