"""Cotangent weights over one-rings. Assumes valid input."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["cotangent_weights"]

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]


@njit(cache=True, nogil=True)
def cotangent(positions: FloatArray, apex: int, i: int, j: int) -> float:
    """The cotangent of the angle at ``apex`` of the triangle (apex, i, j); 0 for one without area."""
    ax, ay, az = positions[apex, 0], positions[apex, 1], positions[apex, 2]
    ux, uy, uz = positions[i, 0] - ax, positions[i, 1] - ay, positions[i, 2] - az
    vx, vy, vz = positions[j, 0] - ax, positions[j, 1] - ay, positions[j, 2] - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    doubled = math.sqrt(nx * nx + ny * ny + nz * nz)
    return (ux * vx + uy * vy + uz * vz) / doubled if doubled > 0.0 else 0.0


@njit(cache=True, nogil=True)
def cotangent_weights(
    positions: FloatArray, corner_starts: IntArray, ring: IntArray, starts: IntArray, neighbours: IntArray,
    largest: float,
) -> FloatArray:  # fmt: skip
    """The sum of the cotangents opposite the edge to each neighbour, clamped to [0, largest]."""
    weights = np.empty(len(neighbours))
    sums = np.zeros(len(positions))
    for i in range(len(positions)):
        for c in range(corner_starts[i], corner_starts[i + 1]):
            j, k = ring[c, 0], ring[c, 1]
            sums[j] += cotangent(positions, k, i, j)
            sums[k] += cotangent(positions, j, i, k)
        sums[i] = 0.0  # a triangle that names i twice
        for c in range(starts[i], starts[i + 1]):
            weights[c] = min(max(sums[neighbours[c]], 0.0), largest)
            sums[neighbours[c]] = 0.0
    return weights
