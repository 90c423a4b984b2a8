"""One step of the finite-volume filter over one-rings. Assumes valid input.

Rings of up to SLOTS triangles are worked on BLOCK at a time, a ring a column, so that each operation is a loop over
columns that the compiler turns into vectors; the few larger ones are columns by themselves.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from reebase.denoise.eigenvector_kernels import minor_eigenvectors
from reebase.denoise.exponential_kernels import FAST, exponentials

__all__ = ["finite_volume_step"]

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]
Index = int | np.uint32
"""A signed index costs a test whether it counts from the end."""

BLOCK = 64
SLOTS = 8

NETWORK = (
    (0, 1), (2, 3), (4, 5), (6, 7), (0, 2), (1, 3), (4, 6), (5, 7), (1, 2), (5, 6),
    (0, 4), (1, 5), (2, 6), (3, 7), (2, 4), (3, 5), (1, 2), (3, 4), (5, 6),
)  # fmt: skip
"""Batcher's: rows that are compared, one pair after another, until all eight are sorted."""


@FAST
def median(values: FloatArray, count: int) -> float:
    """The median of the first ``count`` values, which are sorted in place (Shell's sort: rings are short)."""
    gap = 1
    while 3 * gap + 1 < count:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, count):
            value = values[i]
            j = i
            while j >= gap and values[j - gap] > value:
                values[j] = values[j - gap]
                j -= gap
            values[j] = value
        gap //= 3
    middle = count // 2
    if count % 2:
        return float(values[middle])
    return float(0.5 * (values[middle - 1] + values[middle]))


@FAST
def areas_of_rings(positions: FloatArray, faces: IntArray) -> FloatArray:
    """a_j: the area of the triangles round each vertex, (m,)."""
    areas = np.zeros(len(positions))
    for t in range(len(faces)):
        i, j, k = np.uint32(faces[t, 0]), np.uint32(faces[t, 1]), np.uint32(faces[t, 2])
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        ux, uy, uz = positions[j, 0] - x, positions[j, 1] - y, positions[j, 2] - z
        vx, vy, vz = positions[k, 0] - x, positions[k, 1] - y, positions[k, 2] - z
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        area = 0.5 * math.sqrt(nx * nx + ny * ny + nz * nz)
        areas[i] += area
        areas[j] += area
        areas[k] += area
    return areas


@FAST
def triangles_of_ring(
    positions: FloatArray, i: Index, ring: IntArray, begin: Index, size: int, centroids: FloatArray,
    normals: FloatArray, column: int,
) -> None:  # fmt: skip
    """Fills a column: c_j - v_i of the triangles round i, (3, slots, columns), and their area-weighted normal."""
    px, py, pz = positions[i, 0], positions[i, 1], positions[i, 2]
    nx, ny, nz = 0.0, 0.0, 0.0
    for k in range(size):
        j, h = np.uint32(ring[begin + k, 0]), np.uint32(ring[begin + k, 1])
        ux, uy, uz = positions[j, 0] - px, positions[j, 1] - py, positions[j, 2] - pz
        vx, vy, vz = positions[h, 0] - px, positions[h, 1] - py, positions[h, 2] - pz
        nx += uy * vz - uz * vy
        ny += uz * vx - ux * vz
        nz += ux * vy - uy * vx
        centroids[0, k, column] = (ux + vx) * (1.0 / 3.0)
        centroids[1, k, column] = (uy + vy) * (1.0 / 3.0)
        centroids[2, k, column] = (uz + vz) * (1.0 / 3.0)
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    scale = 1.0 / length if length > 0.0 else 0.0
    normals[0, column], normals[1, column], normals[2, column] = scale * nx, scale * ny, scale * nz


@FAST
def spread_of_neighbours(
    positions: FloatArray, i: Index, neighbours: IntArray, begin: Index, end: Index, areas: FloatArray,
    deviators: FloatArray, means: FloatArray, column: int,
) -> None:  # fmt: skip
    """Fills a column: the deviator of C_i (3.2) about mu_i (3.1), xx, xy, xz, yy, yz, zz, and a third of C_i's trace.

    With u_j = v_j - v_i and m the mean by areas, C = sum u u^T - (sum u) m^T - m (sum u)^T + d m m^T.
    """
    x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
    total, mx, my, mz, sx, sy, sz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(begin, end):
        j = np.uint32(neighbours[k])
        area = areas[j]
        ux, uy, uz = positions[j, 0] - x, positions[j, 1] - y, positions[j, 2] - z
        total += area
        mx += area * ux
        my += area * uy
        mz += area * uz
        sx += ux
        sy += uy
        sz += uz
        xx += ux * ux
        xy += ux * uy
        xz += ux * uz
        yy += uy * uy
        yz += uy * uz
        zz += uz * uz
    if total > 0.0:
        mx, my, mz = mx / total, my / total, mz / total
    count = float(end - begin)
    xx += mx * (count * mx - 2.0 * sx)
    yy += my * (count * my - 2.0 * sy)
    zz += mz * (count * mz - 2.0 * sz)
    xy += count * mx * my - sx * my - mx * sy
    xz += count * mx * mz - sx * mz - mx * sz
    yz += count * my * mz - sy * mz - my * sz
    mean = (xx + yy + zz) / 3.0
    means[column] = mean
    deviators[0, column], deviators[1, column], deviators[2, column] = xx - mean, xy, xz
    deviators[3, column], deviators[4, column], deviators[5, column] = yy - mean, yz, zz - mean


@FAST
def directions(
    deviators: FloatArray, means: FloatArray, minor: bool, anisotropic: bool, normals: FloatArray, result: FloatArray
) -> None:
    """FA (3.4) of each column, or 1; where asked for, minor eigenvectors take the place of the normals.

    deviators: (6, columns). means: a third of the trace of C.
    """
    columns = len(means)
    roots = np.empty(columns)
    for v in range(columns):
        xx, xy, xz = deviators[0, v], deviators[1, v], deviators[2, v]
        yy, yz, zz = deviators[3, v], deviators[4, v], deviators[5, v]
        # |C - mean I|_F^2 / 6; |C|_F^2 is six times this plus 3 mean^2.
        square = (xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0
        roots[v] = math.sqrt(square)
        result[v] = math.sqrt(3.0 * square / (2.0 * square + means[v] * means[v])) if anisotropic else 1.0
    if minor:
        minor_eigenvectors(deviators, roots, normals)


@FAST
def medians(values: FloatArray, sizes: IntArray, result: FloatArray) -> None:
    """The median of each column's first ``sizes`` numbers, below which are infinite ones; sorts the columns."""
    if len(values) == SLOTS:
        for one, other in NETWORK:
            for v in range(len(sizes)):
                a, b = values[one, v], values[other, v]
                values[one, v], values[other, v] = min(a, b), max(a, b)
        for v in range(len(sizes)):
            size = sizes[v]
            result[v] = 0.5 * (values[(size - 1) // 2, v] + values[size // 2, v])
    else:
        result[0] = median(values[:, 0], sizes[0])


@FAST
def scales(
    offsets: FloatArray, squares: FloatArray, sizes: IntArray, robust: bool, floor: float, scratch: FloatArray,
    result: FloatArray,
) -> None:  # fmt: skip
    """1 / (2 sigma^2) of each column: of the scaled median absolute deviation of its offsets, or of the root of the
    mean of its squares."""
    slots, columns = offsets.shape
    if robust:
        for k in range(slots):
            for v in range(columns):
                scratch[k, v] = offsets[k, v] if k < sizes[v] else math.inf
        medians(scratch, sizes, result)
        for k in range(slots):
            for v in range(columns):
                scratch[k, v] = abs(offsets[k, v] - result[v]) if k < sizes[v] else math.inf
        medians(scratch, sizes, result)
        for v in range(columns):
            result[v] *= 1.4826
    else:
        for v in range(columns):
            total = 0.0
            for k in range(sizes[v]):
                total += squares[k, v]
            result[v] = math.sqrt(total / sizes[v])
    for v in range(columns):
        sigma = max(result[v], floor)
        result[v] = 0.5 / (sigma * sigma)


@FAST
def weighted_offsets(
    centroids: FloatArray, normals: FloatArray, sizes: IntArray, robust: bool, floor: float, work: FloatArray,
    bits: npt.NDArray[np.int64], result: FloatArray,
) -> None:  # fmt: skip
    """sum w r / sum w of each column, with the weights of (3.3), their exponents relative to the least: one is 1.

    work: (3, slots, columns) and more; bits: the memory of its last part as integers, flat.
    """
    slots, columns = work.shape[1:]
    offsets, weights, scratch = work[0], work[1], work[2]
    least, factor = np.full(columns, math.inf), np.empty(columns)
    for k in range(slots):
        for v in range(columns):
            x, y, z = centroids[0, k, v], centroids[1, k, v], centroids[2, k, v]
            square = x * x + y * y + z * z
            weights[k, v] = square
            offsets[k, v] = -(x * normals[0, v] + y * normals[1, v] + z * normals[2, v])
            least[v] = min(least[v], square if k < sizes[v] else math.inf)
    scales(offsets, weights, sizes, robust, floor, scratch, factor)
    for k in range(slots):
        for v in range(columns):
            weights[k, v] = (least[v] - weights[k, v]) * factor[v] if k < sizes[v] else -math.inf
    exponentials(weights.reshape(-1), scratch.reshape(-1), bits, slots * columns)
    for v in range(columns):
        least[v], factor[v] = 0.0, 0.0
    for k in range(slots):
        for v in range(columns):
            least[v] += weights[k, v]
            factor[v] += weights[k, v] * offsets[k, v]
    for v in range(columns):
        result[v] = factor[v] / least[v]


@FAST
def finite_volume_step(
    positions: FloatArray, faces: IntArray, corner_starts: IntArray, ring: IntArray,
    neighbour_starts: IntArray, neighbours: IntArray, floor: float,
    minor: bool, robust: bool, anisotropic: bool,
) -> FloatArray:  # fmt: skip
    """The displacement of every vertex in one step of (3.1)-(3.5), (m, 3); see finite_volume.py."""
    displacements = np.zeros((len(positions), 3))
    areas = areas_of_rings(positions, faces)
    members, large = np.empty(len(positions), dtype=np.int32), np.empty(len(positions), dtype=np.int32)
    count, others, longest = 0, 0, 1
    for i in range(len(positions)):
        size = corner_starts[i + 1] - corner_starts[i]
        if areas[i] > 0.0 and size <= SLOTS:
            members[count] = i
            count += 1
        elif areas[i] > 0.0:
            large[others] = i
            others += 1
            longest = max(longest, size)
    for turn in range(2):
        if turn == 1:
            members, count = large, others
        columns, slots = (BLOCK, SLOTS) if turn == 0 else (1, max(longest, SLOTS + 1))
        centroids, work = np.zeros((3, slots, columns)), np.zeros((3, slots, columns))
        bits = work[2].reshape(-1).view(np.int64)
        normals, deviators, means = np.zeros((3, columns)), np.zeros((6, columns)), np.zeros(columns)
        sizes, fractions, moved = np.ones(columns, dtype=np.int32), np.zeros(columns), np.zeros(columns)
        for start in range(0, count, columns):
            filled = min(columns, count - start)
            for v in range(filled):
                w = np.uint32(members[start + v])
                begin, end = np.uint32(corner_starts[w]), np.uint32(corner_starts[w + 1])
                sizes[v] = end - begin
                triangles_of_ring(positions, w, ring, begin, sizes[v], centroids, normals, v)
                first, last = np.uint32(neighbour_starts[w]), np.uint32(neighbour_starts[w + 1])
                spread_of_neighbours(positions, w, neighbours, first, last, areas, deviators, means, v)
            directions(deviators, means, minor, anisotropic, normals, fractions)
            weighted_offsets(centroids, normals, sizes, robust, floor, work, bits, moved)
            for v in range(filled):
                w = np.uint32(members[start + v])
                step = -fractions[v] * moved[v]
                displacements[w, 0] = step * normals[0, v]
                displacements[w, 1] = step * normals[1, v]
                displacements[w, 2] = step * normals[2, v]
    return displacements
