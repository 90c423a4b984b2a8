"""One step of the bilateral filter of positions. Assumes valid input."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from reebase.denoise.ring_kernels import grow

__all__ = ["bilateral_step"]

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]

HOPS = 64
"""Paths have at most this many edges."""


@njit(cache=True, nogil=True)
def bilateral_step(
    positions: FloatArray, normals: FloatArray, starts: IntArray, neighbours: IntArray,
    sigma_c: float, sigma_s: float, floor: float,
) -> FloatArray:  # fmt: skip
    """The displacement of every vertex, (m, 3). normals: of any length. sigma_s: 0 for the heights' deviation."""
    count = len(positions)
    result = np.zeros((count, 3))
    mark, found = np.full(count, -1, dtype=np.int32), np.empty(count, dtype=np.int32)
    ends = np.empty(HOPS + 1, dtype=np.int32)
    heights, exponents = np.empty(count), np.empty(count)
    for i in range(count):
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        if length == 0.0:
            continue
        nx, ny, nz = nx / length, ny / length, nz / length
        size = grow(i, HOPS, 2.0 * sigma_c, positions, starts, neighbours, mark, found, ends)
        if size == 1:
            continue
        mean, square = 0.0, 0.0
        for k in range(1, size):
            j = found[k]
            x, y, z = (
                positions[j, 0] - positions[i, 0], positions[j, 1] - positions[i, 1], positions[j, 2] - positions[i, 2],
            )  # fmt: skip
            heights[k] = nx * x + ny * y + nz * z
            exponents[k] = (x * x + y * y + z * z) / (2.0 * sigma_c * sigma_c)
            mean += heights[k]
        mean /= size - 1
        sigma = sigma_s
        if sigma == 0.0:
            for k in range(1, size):
                square += (heights[k] - mean) ** 2
            sigma = math.sqrt(square / (size - 1))
        sigma = max(sigma, floor)
        least = math.inf
        for k in range(1, size):
            exponents[k] += heights[k] * heights[k] / (2.0 * sigma * sigma)
            least = min(least, exponents[k])
        total, moved = 0.0, 0.0
        for k in range(1, size):
            weight = math.exp(least - exponents[k])
            total += weight
            moved += weight * heights[k]
        moved /= total
        result[i, 0], result[i, 1], result[i, 2] = moved * nx, moved * ny, moved * nz
    return result
