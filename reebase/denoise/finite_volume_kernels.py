"""One step of the finite-volume filter over one-rings. Assumes valid input."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["finite_volume_step"]

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]
Vector = tuple[float, float, float]

SEPARATED = 1e-6
"""The two smaller eigenvalues count as one when closer than this times the deviator's norm over sqrt 6."""


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
def null_vector(a: float, b: float, c: float, d: float, e: float, f: float) -> Vector:
    """Unit vector that the singular matrix ((a, b, c), (b, d, e), (c, e, f)) takes to zero.

    It is the longest of the cross products of two rows, which does not vanish when the rank is 2.
    """
    px, py, pz = b * e - c * d, c * b - a * e, a * d - b * b
    qx, qy, qz = b * f - c * e, c * c - a * f, a * e - b * c
    rx, ry, rz = d * f - e * e, e * c - b * f, b * e - d * c
    p, q, r = px * px + py * py + pz * pz, qx * qx + qy * qy + qz * qz, rx * rx + ry * ry + rz * rz
    if p < q:
        px, py, pz, p = qx, qy, qz, q
    if p < r:
        px, py, pz, p = rx, ry, rz, r
    length = math.sqrt(p)
    return px / length, py / length, pz / length


@njit(cache=True, nogil=True)
def lower_in_plane(
    a: float, b: float, c: float, d: float, e: float, f: float, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """The lower eigenvector of ((a, b, c), (b, d, e), (c, e, f)) across its unit eigenvector (x, y, z).

    Also returned, last: the difference of the two eigenvalues across it.
    """
    if abs(x) > abs(z):
        length = math.sqrt(x * x + y * y)
        ux, uy, uz = -y / length, x / length, 0.0
    else:
        length = math.sqrt(y * y + z * z)
        ux, uy, uz = 0.0, -z / length, y / length
    vx, vy, vz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
    sx, sy, sz = a * ux + b * uy + c * uz, b * ux + d * uy + e * uz, c * ux + e * uy + f * uz
    tx, ty, tz = a * vx + b * vy + c * vz, b * vx + d * vy + e * vz, c * vx + e * vy + f * vz
    tilt = 0.5 * (ux * sx + uy * sy + uz * sz - vx * tx - vy * ty - vz * tz)
    mixed = ux * tx + uy * ty + uz * tz
    radius = math.sqrt(tilt * tilt + mixed * mixed)
    if tilt >= 0.0:
        along, across = -mixed, tilt + radius
    else:
        along, across = radius - tilt, -mixed
    length = math.sqrt(along * along + across * across)
    if length == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    along, across = along / length, across / length
    return along * ux + across * vx, along * uy + across * vy, along * uz + across * vz, 2.0 * radius


@njit(cache=True, nogil=True)
def minor_eigenvector(
    a: float, b: float, c: float, d: float, e: float, f: float, root: float, otherwise: Vector
) -> Vector:
    """Unit eigenvector of the smallest eigenvalue of the deviator ((a, b, c), (b, d, e), (c, e, f)).

    root: its Frobenius norm over sqrt 6, so that its eigenvalues are 2 root cos(t), 2 root cos(t ± 2 pi / 3).
    The eigenvector whose eigenvalue stands apart is found first, and the minor one across it where it is
    another: so its error is rounding over the gap, as a library's. Its sign is that of ``otherwise``, which is
    returned when the smallest eigenvalue is not simple.
    """
    if root <= 0.0:
        return otherwise
    a, b, c, d, e, f = a / root, b / root, c / root, d / root, e / root, f / root
    half = 0.5 * (a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d))
    angle = math.acos(min(1.0, max(-1.0, half))) / 3.0
    if half <= 0.0:
        lowest = 2.0 * math.cos(angle + 2.0 * math.pi / 3.0)
        x, y, z = null_vector(a - lowest, b, c, d - lowest, e, f - lowest)
    else:
        highest = 2.0 * math.cos(angle)
        x, y, z = null_vector(a - highest, b, c, d - highest, e, f - highest)
        x, y, z, gap = lower_in_plane(a, b, c, d, e, f, x, y, z)
        if gap <= SEPARATED:
            return otherwise
    if x * otherwise[0] + y * otherwise[1] + z * otherwise[2] < 0.0:
        return -x, -y, -z
    return x, y, z


@njit(cache=True, nogil=True)
def areas_of_rings(positions: FloatArray, faces: IntArray) -> FloatArray:
    """a_j: the area of the triangles round each vertex, (m,)."""
    areas = np.zeros(len(positions))
    for t in range(len(faces)):
        i, j, k = faces[t, 0], faces[t, 1], faces[t, 2]
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        ux, uy, uz = positions[j, 0] - x, positions[j, 1] - y, positions[j, 2] - z
        vx, vy, vz = positions[k, 0] - x, positions[k, 1] - y, positions[k, 2] - z
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        area = 0.5 * math.sqrt(nx * nx + ny * ny + nz * nz)
        areas[i] += area
        areas[j] += area
        areas[k] += area
    return areas


@njit(cache=True, nogil=True)
def centroids_of_ring(
    positions: FloatArray, i: int, ring: IntArray, begin: int, size: int, centroids: FloatArray
) -> Vector:
    """Fills c_j - v_i for the triangles round i, (size, 3); returns their area-weighted normal, or zero."""
    x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
    nx, ny, nz = 0.0, 0.0, 0.0
    for k in range(size):
        j, h = ring[begin + k, 0], ring[begin + k, 1]
        ux, uy, uz = positions[j, 0] - x, positions[j, 1] - y, positions[j, 2] - z
        vx, vy, vz = positions[h, 0] - x, positions[h, 1] - y, positions[h, 2] - z
        nx += uy * vz - uz * vy
        ny += uz * vx - ux * vz
        nz += ux * vy - uy * vx
        centroids[k, 0] = (ux + vx) / 3.0
        centroids[k, 1] = (uy + vy) / 3.0
        centroids[k, 2] = (uz + vz) / 3.0
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length > 0.0:
        return nx / length, ny / length, nz / length
    return 0.0, 0.0, 0.0


@njit(cache=True, nogil=True)
def spread_of_neighbours(
    positions: FloatArray, i: int, neighbours: IntArray, begin: int, end: int, areas: FloatArray
) -> tuple[float, float, float, float, float, float, float]:
    """C_i (3.2) about mu_i (3.1): a third of its trace, then its deviator's xx, xy, xz, yy, yz, zz."""
    x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
    total, mx, my, mz = 0.0, 0.0, 0.0, 0.0
    for k in range(begin, end):
        j = neighbours[k]
        total += areas[j]
        mx += areas[j] * (positions[j, 0] - x)
        my += areas[j] * (positions[j, 1] - y)
        mz += areas[j] * (positions[j, 2] - z)
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if total > 0.0:
        mx, my, mz = x + mx / total, y + my / total, z + mz / total
        for k in range(begin, end):
            j = neighbours[k]
            ux, uy, uz = positions[j, 0] - mx, positions[j, 1] - my, positions[j, 2] - mz
            xx += ux * ux
            xy += ux * uy
            xz += ux * uz
            yy += uy * uy
            yz += uy * uz
            zz += uz * uz
    mean = (xx + yy + zz) / 3.0
    return mean, xx - mean, xy, xz, yy - mean, yz, zz - mean


@njit(cache=True, nogil=True)
def scale_of(
    centroids: FloatArray, offsets: FloatArray, size: int, robust: bool, scratch: FloatArray
) -> float:
    """sigma: scaled median absolute deviation of the offsets, or root mean square of |c_j - v_i|."""
    if robust:
        for k in range(size):  # not a slice: that takes seconds to compile
            scratch[k] = offsets[k]
        middle = median(scratch, size)
        for k in range(size):
            scratch[k] = abs(offsets[k] - middle)
        return 1.4826 * median(scratch, size)
    total = 0.0
    for k in range(size):
        total += centroids[k, 0] ** 2 + centroids[k, 1] ** 2 + centroids[k, 2] ** 2
    return math.sqrt(total / size)


@njit(cache=True, nogil=True)
def weighted_offset(
    centroids: FloatArray, offsets: FloatArray, size: int, sigma: float, scratch: FloatArray
) -> float:
    """sum w r / sum w with the weights of (3.3), their exponents relative to the least, so that one is 1."""
    least = math.inf
    for k in range(size):
        scratch[k] = centroids[k, 0] ** 2 + centroids[k, 1] ** 2 + centroids[k, 2] ** 2
        least = min(least, scratch[k])
    total, moved = 0.0, 0.0
    for k in range(size):
        weight = math.exp((least - scratch[k]) / (2.0 * sigma * sigma))
        total += weight
        moved += weight * offsets[k]
    return moved / total


@njit(cache=True, nogil=True)
def finite_volume_step(
    positions: FloatArray, faces: IntArray, corner_starts: IntArray, ring: IntArray,
    neighbour_starts: IntArray, neighbours: IntArray, floor: float,
    minor: bool, robust: bool, anisotropic: bool,
) -> FloatArray:  # fmt: skip
    """The displacement of every vertex in one step of (3.1)-(3.5), (m, 3); see finite_volume.py."""
    displacements = np.zeros((len(positions), 3))
    areas = areas_of_rings(positions, faces)
    longest = 1
    for i in range(len(positions)):
        longest = max(longest, corner_starts[i + 1] - corner_starts[i])
    centroids = np.empty((longest, 3))
    offsets, scratch = np.empty(longest), np.empty(longest)
    for i in range(len(positions)):
        begin = corner_starts[i]
        size = corner_starts[i + 1] - begin
        if areas[i] <= 0.0:
            continue
        normal = centroids_of_ring(positions, i, ring, begin, size, centroids)
        mean, xx, xy, xz, yy, yz, zz = spread_of_neighbours(
            positions, i, neighbours, neighbour_starts[i], neighbour_starts[i + 1], areas
        )
        # |C - mean I|_F^2 / 6; |C|_F^2 is six times this plus 3 mean^2.
        square = (xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0
        fraction = math.sqrt(3.0 * square / (2.0 * square + mean * mean)) if anisotropic else 1.0
        if minor:
            normal = minor_eigenvector(xx, xy, xz, yy, yz, zz, math.sqrt(square), normal)
        for k in range(size):
            offsets[k] = -(
                centroids[k, 0] * normal[0] + centroids[k, 1] * normal[1] + centroids[k, 2] * normal[2]
            )
        sigma = max(scale_of(centroids, offsets, size, robust, scratch), floor)
        moved = -fraction * weighted_offset(centroids, offsets, size, sigma, scratch)
        displacements[i, 0] = moved * normal[0]
        displacements[i, 1] = moved * normal[1]
        displacements[i, 2] = moved * normal[2]
    return displacements
