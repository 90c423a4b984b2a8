"""One step of the finite-volume filter over one-rings. Assumes valid input.

Rings of as many triangles, up to SLOTS, are worked on BLOCK at a time, a ring a column, so that each operation is a
loop over columns that the compiler turns into vectors; the few larger ones are columns by themselves.
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
def fans(
    positions: FloatArray, areas: FloatArray, members: IntArray, starts: IntArray, neighbours: IntArray,
    corners: FloatArray,
) -> None:  # fmt: skip
    """v_j - v_i and a_j of the neighbours of each i, as the fan round i meets them: (4, slots, columns)."""
    for v in range(len(members)):
        i = np.uint32(members[v])
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        begin = np.uint32(starts[i])
        for k in range(corners.shape[1]):
            j = np.uint32(neighbours[begin + np.uint32(k)])
            corners[0, k, v] = positions[j, 0] - x
            corners[1, k, v] = positions[j, 1] - y
            corners[2, k, v] = positions[j, 2] - z
            corners[3, k, v] = areas[j]


@FAST
def triangles_of_fans(corners: FloatArray, centroids: FloatArray, normals: FloatArray) -> None:
    """``triangles_of_ring`` of all columns."""
    slots, columns = corners.shape[1:]
    for v in range(columns):
        normals[0, v], normals[1, v], normals[2, v] = 0.0, 0.0, 0.0
    for k in range(slots):
        h = k + 1 if k + 1 < slots else 0
        for v in range(columns):
            ux, uy, uz = corners[0, k, v], corners[1, k, v], corners[2, k, v]
            vx, vy, vz = corners[0, h, v], corners[1, h, v], corners[2, h, v]
            normals[0, v] += uy * vz - uz * vy
            normals[1, v] += uz * vx - ux * vz
            normals[2, v] += ux * vy - uy * vx
            centroids[0, k, v] = (ux + vx) * (1.0 / 3.0)
            centroids[1, k, v] = (uy + vy) * (1.0 / 3.0)
            centroids[2, k, v] = (uz + vz) * (1.0 / 3.0)
    for v in range(columns):
        nx, ny, nz = normals[0, v], normals[1, v], normals[2, v]
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        scale = 1.0 / length if length > 0.0 else 0.0
        normals[0, v], normals[1, v], normals[2, v] = scale * nx, scale * ny, scale * nz


@FAST
def spreads_of_fans(corners: FloatArray, sums: FloatArray, deviators: FloatArray, means: FloatArray) -> None:
    """``spread_of_neighbours`` of all columns. sums: (7, columns), for use here."""
    slots, columns = corners.shape[1:]
    sums[:] = 0.0
    deviators[:] = 0.0
    for k in range(slots):
        for v in range(columns):
            ux, uy, uz, area = corners[0, k, v], corners[1, k, v], corners[2, k, v], corners[3, k, v]
            sums[0, v] += area
            sums[1, v] += area * ux
            sums[2, v] += area * uy
            sums[3, v] += area * uz
            sums[4, v] += ux
            sums[5, v] += uy
            sums[6, v] += uz
        for v in range(columns):
            ux, uy, uz = corners[0, k, v], corners[1, k, v], corners[2, k, v]
            deviators[0, v] += ux * ux
            deviators[1, v] += ux * uy
            deviators[2, v] += ux * uz
            deviators[3, v] += uy * uy
            deviators[4, v] += uy * uz
            deviators[5, v] += uz * uz
    for v in range(columns):
        scale = 1.0 / sums[0, v] if sums[0, v] > 0.0 else 0.0
        mx, my, mz = scale * sums[1, v], scale * sums[2, v], scale * sums[3, v]
        sx, sy, sz = sums[4, v], sums[5, v], sums[6, v]
        xx = deviators[0, v] + mx * (slots * mx - 2.0 * sx)
        yy = deviators[3, v] + my * (slots * my - 2.0 * sy)
        zz = deviators[5, v] + mz * (slots * mz - 2.0 * sz)
        mean = (xx + yy + zz) / 3.0
        means[v] = mean
        deviators[0, v], deviators[3, v], deviators[5, v] = xx - mean, yy - mean, zz - mean
        deviators[1, v] += slots * mx * my - sx * my - mx * sy
        deviators[2, v] += slots * mx * mz - sx * mz - mx * sz
        deviators[4, v] += slots * my * mz - sy * mz - my * sz


@FAST
def medians(values: FloatArray, result: FloatArray) -> None:
    """The median of each column, which is sorted."""
    slots, columns = values.shape
    if slots <= SLOTS:
        # Batcher's network on fewer rows is what is left of it when the last rows hold infinite numbers.
        for one, other in NETWORK:
            if other < slots:
                for v in range(columns):
                    a, b = values[one, v], values[other, v]
                    values[one, v], values[other, v] = min(a, b), max(a, b)
        for v in range(columns):
            result[v] = 0.5 * (values[(slots - 1) // 2, v] + values[slots // 2, v])
    else:
        for v in range(columns):
            result[v] = median(values[:, v], slots)


@FAST
def scales(
    offsets: FloatArray, squares: FloatArray, robust: bool, floor: float, scratch: FloatArray, result: FloatArray
) -> None:
    """1 / (2 sigma^2) of each column: of the scaled median absolute deviation of its offsets, or of the root of the
    mean of its squares."""
    slots, columns = offsets.shape
    if robust:
        # Not scratch[:] = offsets, whose check of shapes takes numba five seconds to compile.
        for k in range(slots):
            for v in range(columns):
                scratch[k, v] = offsets[k, v]
        medians(scratch, result)
        for k in range(slots):
            for v in range(columns):
                scratch[k, v] = abs(offsets[k, v] - result[v])
        medians(scratch, result)
        for v in range(columns):
            result[v] *= 1.4826
    else:
        result[:] = 0.0
        for k in range(slots):
            for v in range(columns):
                result[v] += squares[k, v]
        for v in range(columns):
            result[v] = math.sqrt(result[v] / slots)
    for v in range(columns):
        sigma = max(result[v], floor)
        result[v] = 0.5 / (sigma * sigma)


@FAST
def weighted_offsets(
    centroids: FloatArray, normals: FloatArray, robust: bool, floor: float, work: FloatArray,
    bits: npt.NDArray[np.int64], least: FloatArray, result: FloatArray,
) -> None:  # fmt: skip
    """sum w r / sum w of each column, with the weights of (3.3), their exponents relative to the least: one is 1.

    work: (3, slots, columns); bits: the memory of its last part as integers, flat. least: (columns,), for use here.
    """
    slots, columns = work.shape[1:]
    offsets, weights, scratch = work[0], work[1], work[2]
    least[:] = math.inf
    for k in range(slots):
        for v in range(columns):
            x, y, z = centroids[0, k, v], centroids[1, k, v], centroids[2, k, v]
            square = x * x + y * y + z * z
            weights[k, v] = square
            offsets[k, v] = -(x * normals[0, v] + y * normals[1, v] + z * normals[2, v])
            least[v] = min(least[v], square)
    scales(offsets, weights, robust, floor, scratch, result)
    for k in range(slots):
        for v in range(columns):
            weights[k, v] = (least[v] - weights[k, v]) * result[v]
    exponentials(weights.reshape(-1), scratch.reshape(-1), bits, slots * columns)
    least[:] = 0.0
    result[:] = 0.0
    for k in range(slots):
        for v in range(columns):
            least[v] += weights[k, v]
            result[v] += weights[k, v] * offsets[k, v]
    for v in range(columns):
        result[v] /= least[v]


@FAST
def moved_members(
    positions: FloatArray, areas: FloatArray, members: IntArray, slots: int, columns: int, fan: bool,
    corner_starts: IntArray, ring: IntArray, neighbour_starts: IntArray, neighbours: IntArray, floor: float,
    minor: bool, robust: bool, anisotropic: bool, displacements: FloatArray,
) -> None:  # fmt: skip
    """The displacements of vertices with ``slots`` triangles each, so many columns at a time. fan: all are closed."""
    corners, centroids = np.ones((4, slots, columns)), np.ones((3, slots, columns))
    work, sums = np.ones((3, slots, columns)), np.empty((7, columns))
    bits = work[2].reshape(-1).view(np.int64)
    normals, deviators, means = np.ones((3, columns)), np.ones((6, columns)), np.ones(columns)
    least, fractions, moved = np.empty(columns), np.empty(columns), np.empty(columns)
    for start in range(0, len(members), columns):
        some = members[start : start + columns]
        if fan:
            fans(positions, areas, some, neighbour_starts, neighbours, corners)
            triangles_of_fans(corners, centroids, normals)
            spreads_of_fans(corners, sums, deviators, means)
        else:
            for v in range(len(some)):
                w = np.uint32(some[v])
                begin = np.uint32(corner_starts[w])
                triangles_of_ring(positions, w, ring, begin, slots, centroids, normals, v)
                first, last = np.uint32(neighbour_starts[w]), np.uint32(neighbour_starts[w + 1])
                spread_of_neighbours(positions, w, neighbours, first, last, areas, deviators, means, v)
        directions(deviators, means, minor, anisotropic, normals, fractions)
        weighted_offsets(centroids, normals, robust, floor, work, bits, least, moved)
        for v in range(len(some)):
            w = np.uint32(some[v])
            step = -fractions[v] * moved[v]
            displacements[w, 0] = step * normals[0, v]
            displacements[w, 1] = step * normals[1, v]
            displacements[w, 2] = step * normals[2, v]


@FAST
def finite_volume_step(
    positions: FloatArray, faces: IntArray, corner_starts: IntArray, ring: IntArray, neighbour_starts: IntArray,
    neighbours: IntArray, closed: npt.NDArray[np.bool_], floor: float, minor: bool, robust: bool, anisotropic: bool,
) -> FloatArray:  # fmt: skip
    """The displacement of every vertex in one step of (3.1)-(3.5), (m, 3); see finite_volume.py."""
    displacements = np.zeros((len(positions), 3))
    areas = areas_of_rings(positions, faces)
    # Sorted by the number of triangles, those of one closed fan apart; larger rings and empty ones last.
    groups = 2 * SLOTS + 2
    kinds = np.empty(len(positions), dtype=np.int8)
    ends = np.zeros(groups + 1, dtype=np.int64)
    for i in range(len(positions)):
        size = corner_starts[i + 1] - corner_starts[i]
        kind = 2 * SLOTS if size > SLOTS else 2 * (size - 1) + closed[i]
        kinds[i] = kind if areas[i] > 0.0 else groups - 1
        ends[kinds[i] + 1] += 1
    for kind in range(groups):
        ends[kind + 1] += ends[kind]
    members, cursor = np.empty(len(positions), dtype=np.int32), ends[:-1].copy()
    for i in range(len(positions)):
        members[cursor[kinds[i]]] = i
        cursor[kinds[i]] += 1
    # One call for all, as what is called is compiled into each call.
    for kind in range(groups - 1):
        start, large = ends[kind], kind == 2 * SLOTS
        while start < ends[kind + 1]:
            end = start + 1 if large else ends[kind + 1]
            slots = corner_starts[members[start] + 1] - corner_starts[members[start]]
            moved_members(
                positions, areas, members[start:end], slots, 1 if large else BLOCK, kind % 2 == 1,
                corner_starts, ring, neighbour_starts, neighbours, floor, minor, robust, anisotropic, displacements,
            )  # fmt: skip
            start = end
    return displacements
