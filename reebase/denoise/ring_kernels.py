"""Loops over one-rings that several filters share. They assume valid input; none is on the default path."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = [
    "CROWD", "diffuse", "gaussian_weights", "gradients", "grow", "rings_within", "sums_round", "vertex_normals",
]  # fmt: skip

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]

CROWD = 128
"""Neighbourhoods do not grow through vertices with more neighbours or triangles than this.

A fan of n triangles would otherwise give each of its rim vertices a neighbourhood of n.
"""

MOST = 512
"""Neighbourhoods of more vertices than this do not grow by another ring."""


@njit(cache=True, nogil=True)
def gaussian_weights(features: FloatArray, starts: IntArray, neighbours: IntArray) -> FloatArray:
    """exp(-|x_j - x_i|^2) for each neighbour j of each i; features x: (m, k)."""
    weights = np.empty(len(neighbours))
    for i in range(len(starts) - 1):
        for k in range(starts[i], starts[i + 1]):
            j = neighbours[k]
            square = 0.0
            for axis in range(features.shape[1]):
                square += (features[j, axis] - features[i, axis]) ** 2
            weights[k] = math.exp(-square)
    return weights


@njit(cache=True, nogil=True)
def gradients(positions: FloatArray, starts: IntArray, neighbours: IntArray, weights: FloatArray) -> FloatArray:
    """sqrt(sum_j w_ij |v_j - v_i|^2) of each vertex i, (m,)."""
    result = np.zeros(len(positions))
    for i in range(len(positions)):
        total = 0.0
        for k in range(starts[i], starts[i + 1]):
            j = neighbours[k]
            x, y, z = (
                positions[j, 0] - positions[i, 0], positions[j, 1] - positions[i, 1], positions[j, 2] - positions[i, 2],
            )  # fmt: skip
            total += weights[k] * (x * x + y * y + z * z)
        result[i] = math.sqrt(total)
    return result


@njit(cache=True, nogil=True)
def diffuse(
    positions: FloatArray, starts: IntArray, neighbours: IntArray, weights: FloatArray, factors: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """sum_j w_ij (g_i + g_j) (v_j - v_i) of each vertex i, (m, 3), and the sum of w_ij (g_i + g_j), (m,)."""
    result = np.zeros((len(positions), 3))
    totals = np.zeros(len(positions))
    for i in range(len(positions)):
        x, y, z, total = 0.0, 0.0, 0.0, 0.0
        for k in range(starts[i], starts[i + 1]):
            j = neighbours[k]
            weight = weights[k] * (factors[i] + factors[j])
            total += weight
            x += weight * (positions[j, 0] - positions[i, 0])
            y += weight * (positions[j, 1] - positions[i, 1])
            z += weight * (positions[j, 2] - positions[i, 2])
        result[i, 0], result[i, 1], result[i, 2], totals[i] = x, y, z, total
    return result, totals


@njit(cache=True, nogil=True)
def vertex_normals(positions: FloatArray, faces: IntArray, uniform: bool) -> FloatArray:
    """Sum of the unit normals of the triangles round each vertex (1.3), or of those times the area, (m, 3)."""
    result = np.zeros((len(positions), 3))
    for t in range(len(faces)):
        i, j, k = faces[t, 0], faces[t, 1], faces[t, 2]
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        ux, uy, uz = positions[j, 0] - x, positions[j, 1] - y, positions[j, 2] - z
        vx, vy, vz = positions[k, 0] - x, positions[k, 1] - y, positions[k, 2] - z
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = math.sqrt(nx * nx + ny * ny + nz * nz) if uniform else 2.0
        if length > 0.0:
            for corner in range(3):
                v = faces[t, corner]
                result[v, 0] += nx / length
                result[v, 1] += ny / length
                result[v, 2] += nz / length
    return result


@njit(cache=True, nogil=True)
def grow(
    i: int, hops: int, reach: float, positions: FloatArray, starts: IntArray, neighbours: IntArray,
    mark: IntArray, found: IntArray, ends: IntArray,
) -> int:  # fmt: skip
    """The vertices within ``hops`` edges of i, along paths that stay nearer to it than ``reach``.

    They are written to ``found`` ring by ring, i first; ring k ends before ends[k]. mark: i nowhere yet.
    Returns their number. Paths do not pass through crowded vertices, and a ring that exceeds MOST is the last.
    """
    found[0], mark[i], ends[0] = i, i, 1
    count, begin = 1, 0
    for hop in range(1, hops + 1):
        end = count
        if end <= MOST:
            for position in range(begin, end):
                v = found[position]
                if v != i and starts[v + 1] - starts[v] > CROWD:
                    continue
                for k in range(starts[v], starts[v + 1]):
                    j = neighbours[k]
                    if mark[j] != i:
                        mark[j] = i
                        x, y, z = (
                            positions[j, 0] - positions[i, 0], positions[j, 1] - positions[i, 1],
                            positions[j, 2] - positions[i, 2],
                        )  # fmt: skip
                        if x * x + y * y + z * z < reach * reach:
                            found[count] = j
                            count += 1
        ends[hop] = count
        begin = end
        if count == end:
            for later in range(hop + 1, hops + 1):
                ends[later] = count
            break
    return count


@njit(cache=True, nogil=True)
def rings_within(
    hops: int, positions: FloatArray, starts: IntArray, neighbours: IntArray
) -> tuple[IntArray, IntArray]:
    """The vertices within ``hops`` edges of each vertex, itself left out, in compressed rows."""
    count = len(positions)
    mark, found = np.full(count, -1, dtype=np.int32), np.empty(count, dtype=np.int32)
    ends = np.empty(hops + 1, dtype=np.int32)
    row_starts = np.zeros(count + 1, dtype=np.int32)
    for i in range(count):
        row_starts[i + 1] = row_starts[i] + grow(
            i, hops, math.inf, positions, starts, neighbours, mark, found, ends
        ) - 1  # fmt: skip
    rows = np.empty(row_starts[count], dtype=np.int32)
    mark[:] = -1
    for i in range(count):
        size = grow(i, hops, math.inf, positions, starts, neighbours, mark, found, ends)
        for k in range(1, size):
            rows[row_starts[i] + k - 1] = found[k]
    return row_starts, rows


@njit(cache=True, nogil=True)
def sums_round(vectors: FloatArray, starts: IntArray, rows: IntArray) -> FloatArray:
    """The sum of a vertex's own vector and those of its row, (m, 3)."""
    result = np.empty_like(vectors)
    for i in range(len(vectors)):
        x, y, z = vectors[i, 0], vectors[i, 1], vectors[i, 2]
        for k in range(starts[i], starts[i + 1]):
            j = rows[k]
            x += vectors[j, 0]
            y += vectors[j, 1]
            z += vectors[j, 2]
        result[i, 0], result[i, 1], result[i, 2] = x, y, z
    return result
