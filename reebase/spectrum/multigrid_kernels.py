"""Kernels of the multigrid hierarchy and its cycle; matrices are CSR with sorted rows, blocks have four columns.

Sizes: m vertices of a level, n of the next coarser one.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = [
    "aggregate", "ascend", "carry", "coarse_operator", "coarse_triangles", "descend", "image", "interpolate",
    "residual",
]  # fmt: skip

Float = npt.NDArray[np.float64]
Single = npt.NDArray[np.float32]
Int32 = npt.NDArray[np.int32]

FLAT = 1e-12  # a triangle whose Gram determinant is below this share of its two sides' product has no area
NEAR = 0.1  # a vertex over a triangle is near it when its squared height is below this share of that over the seed


@njit(cache=True, nogil=True)
def aggregate(pointers: Int32, indices: Int32, values: Float, weak: float) -> tuple[Int32, Int32, Float]:
    """Aggregate of each vertex (m,), seed vertex of each aggregate (n,), and the diagonal of the matrix (m,).

    A vertex whose strong neighbours are all free becomes the seed of an aggregate of them; what is left over joins
    the aggregate of its strongest neighbour. Neighbours are strong when a_ij^2 > weak^2 a_ii a_jj.
    """
    m = len(pointers) - 1
    diagonal = np.zeros(m)
    for i in range(m):
        for at in range(pointers[i], pointers[i + 1]):
            if indices[at] == i:
                diagonal[i] = values[at]
    owner, seeds = np.full(m, -1, np.int32), np.empty(m, np.int32)
    count = 0
    for i in range(m):
        if owner[i] >= 0:
            continue
        bound = weak * weak * diagonal[i]
        free = True
        for at in range(pointers[i], pointers[i + 1]):
            j = indices[at]
            if owner[j] >= 0 and values[at] * values[at] > bound * diagonal[j]:
                free = False
                break
        if free:
            for at in range(pointers[i], pointers[i + 1]):
                j = indices[at]
                if owner[j] < 0 and values[at] * values[at] > bound * diagonal[j]:
                    owner[j] = count
            owner[i], seeds[count] = count, i
            count += 1
    count = _join_rest(pointers, indices, values, owner, seeds, count)
    return owner, seeds[:count].copy(), diagonal


@njit(cache=True, nogil=True)
def _join_rest(pointers: Int32, indices: Int32, values: Float, owner: Int32, seeds: Int32, count: int) -> int:
    """Give each vertex without an aggregate that of its strongest neighbour in one, or one of its own."""
    joined = np.full(len(owner), -1, np.int32)
    for i in range(len(owner)):
        if owner[i] < 0:
            strongest = 0.0
            for at in range(pointers[i], pointers[i + 1]):
                j = indices[at]
                if owner[j] >= 0 and -values[at] > strongest:
                    strongest = -values[at]
                    joined[i] = owner[j]
    for i in range(len(owner)):
        if owner[i] < 0 and joined[i] >= 0:
            owner[i] = joined[i]
        elif owner[i] < 0:
            owner[i], seeds[count] = count, i
            count += 1
    return count


@njit(cache=True, nogil=True)
def coarse_triangles(faces: Int32, owner: Int32, n: int) -> tuple[Int32, Int32, Int32]:
    """Triangles between aggregates (t, 3), and those at each aggregate: starts (n + 1,) and numbers (3t,).

    There is one wherever a face has its corners in three aggregates: the dual of the aggregates as cells.
    """
    triangles = np.empty((len(faces), 3), np.int32)
    starts = np.zeros(n + 1, np.int32)
    count = 0
    for f in range(len(faces)):
        a, b, c = owner[faces[f, 0]], owner[faces[f, 1]], owner[faces[f, 2]]
        if a not in (b, c) and b != c:
            triangles[count, 0], triangles[count, 1], triangles[count, 2] = a, b, c
            count += 1
            starts[a + 1] += 1
            starts[b + 1] += 1
            starts[c + 1] += 1
    for k in range(n):
        starts[k + 1] += starts[k]
    cursor = starts[:-1].copy()
    around = np.empty(3 * count, np.int32)
    for t in range(count):
        for corner in range(3):
            k = triangles[t, corner]
            around[cursor[k]] = t
            cursor[k] += 1
    return triangles[:count].copy(), starts, around


@njit(cache=True, nogil=True)
def _clamped(
    p: float, q: float, uu: float, uv: float, vv: float, ud: float, vd: float
) -> tuple[float, float]:
    """p, q >= 0 with p + q <= 1 that put p u + q v nearest to d, where p and q do without these bounds."""
    if p >= 0.0 and q >= 0.0:
        if p + q <= 1.0:
            return p, q
        p = min(max((ud - uv - vd + vv) / (uu - 2.0 * uv + vv), 0.0), 1.0)
        return p, 1.0 - p
    p, q = min(max(ud / uu, 0.0), 1.0), min(max(vd / vv, 0.0), 1.0)
    if p * (p * uu - 2.0 * ud) <= q * (q * vv - 2.0 * vd):
        return p, 0.0
    return 0.0, q


@njit(cache=True, nogil=True)
def _inverse_gram(coarse: Float, triangles: Int32) -> Float:
    """One over the determinant of the Gram matrix of two sides of each triangle, 0 for no area."""
    inverse = np.zeros(len(triangles))
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        uu = vv = uv = 0.0
        for axis in range(3):
            u, v = coarse[j, axis] - coarse[i, axis], coarse[k, axis] - coarse[i, axis]
            uu += u * u
            vv += v * v
            uv += u * v
        determinant = uu * vv - uv * uv
        if determinant > FLAT * uu * vv:
            inverse[t] = 1.0 / determinant
    return inverse


@njit(cache=True, nogil=True)
def _on_triangles(
    point: Float, coarse: Float, i: int, triangles: Int32, around: Int32, inverse: Float, over: bool
) -> tuple[int, int, float, float]:
    """Corners j, k and their weights of the triangle at i nearest to the point; j = -1 if there is none.

    ``over``: only a triangle that has the point over it and near it, the first one: cheap, and mostly there.
    """
    cx, cy, cz = coarse[i, 0], coarse[i, 1], coarse[i, 2]
    dx, dy, dz = point[0] - cx, point[1] - cy, point[2] - cz
    first = second = -1
    p = q = 0.0
    best = (NEAR - 1.0) * (dx * dx + dy * dy + dz * dz) if over else np.inf
    for t in around:
        if inverse[t] == 0.0:
            continue
        j, k = triangles[t, 1], triangles[t, 2]
        if j == i:
            j, k = k, triangles[t, 0]
        elif k == i:
            j, k = triangles[t, 0], j
        ux, uy, uz = coarse[j, 0] - cx, coarse[j, 1] - cy, coarse[j, 2] - cz
        vx, vy, vz = coarse[k, 0] - cx, coarse[k, 1] - cy, coarse[k, 2] - cz
        uu, vv, uv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, ux * vx + uy * vy + uz * vz
        ud, vd = ux * dx + uy * dy + uz * dz, vx * dx + vy * dy + vz * dz
        r, s = (vv * ud - uv * vd) * inverse[t], (uu * vd - uv * ud) * inverse[t]
        if over and not (r > 0.0 and s > 0.0 and r + s < 1.0):
            continue
        r, s = _clamped(r, s, uu, uv, vv, ud, vd)
        gain = r * (r * uu + 2.0 * s * uv - 2.0 * ud) + s * (s * vv - 2.0 * vd)
        if gain < best:
            best, first, second, p, q = gain, j, k, r, s
            if over:
                break
    return first, second, p, q


@njit(cache=True, nogil=True)
def _on_edges(point: Float, coarse: Float, i: int, others: Int32) -> tuple[int, float]:
    """The other end and its weight of the edge from i nearest to the point, i itself if there is none."""
    end, p, best = i, 0.0, np.inf
    for j in others:
        uu = ud = 0.0
        for axis in range(3):
            u = coarse[j, axis] - coarse[i, axis]
            uu += u * u
            ud += u * (point[axis] - coarse[i, axis])
        if uu > 0.0:
            r = min(max(ud / uu, 0.0), 1.0)
            if r * (r * uu - 2.0 * ud) < best:
                best, end, p = r * (r * uu - 2.0 * ud), j, r
    return end, p


@njit(cache=True, nogil=True)
def interpolate(
    pointers: Int32, indices: Int32, points: Float, coarse: Float, owner: Int32, seeds: Int32,
    triangles: Int32, starts: Int32, around: Int32,
) -> tuple[Int32, Float]:  # fmt: skip
    """Interpolation P from the seeds to the vertices: three columns a row, and their weights, (m, 3) each.

    The nearest point to a vertex on the triangles at its aggregate gives barycentric weights; where there is no
    triangle, as on a limb of one aggregate round, the edges to the next aggregates do. Rows sum to 1.
    """
    inverse = _inverse_gram(coarse, triangles)
    column, weight = np.empty((len(owner), 3), np.int32), np.zeros((len(owner), 3))
    for x in range(len(owner)):
        i = owner[x]
        j = k = i
        p = q = 0.0
        if seeds[i] != x:
            here = around[starts[i] : starts[i + 1]]
            j, k, p, q = _on_triangles(points[x], coarse, i, triangles, here, inverse, True)
            if j < 0:
                j, k, p, q = _on_triangles(points[x], coarse, i, triangles, here, inverse, False)
            if j < 0:
                j, p = _on_edges(points[x], coarse, i, owner[indices[pointers[x] : pointers[x + 1]]])
                k = i
        column[x, 0], column[x, 1], column[x, 2] = i, j, k
        weight[x, 0], weight[x, 1], weight[x, 2] = 1.0 - p - q, p, q
    return column, weight


@njit(cache=True, nogil=True)
def _product(
    pointers: Int32, indices: Int32, values: Float, column: Int32, weight: Float, n: int
) -> tuple[Int32, Int32, Float]:
    """C P in CSR, rows not sorted."""
    m = len(pointers) - 1
    place = np.full(n, -1, np.int32)
    row = np.zeros(m + 1, np.int32)
    product_column, product = np.empty(3 * len(indices), np.int32), np.empty(3 * len(indices))
    used = 0
    for i in range(m):
        begin = used
        for at in range(pointers[i], pointers[i + 1]):
            j, value = indices[at], values[at]
            for corner in range(3):
                k = column[j, corner]
                if place[k] < begin:
                    place[k] = used
                    product_column[used], product[used] = k, 0.0
                    used += 1
                product[place[k]] += value * weight[j, corner]
        row[i + 1] = used
    return row, product_column, product


@njit(cache=True, nogil=True)
def _transposed(column: Int32, weight: Float, n: int) -> tuple[Int32, Int32, Float]:
    """P^T in CSR."""
    starts = np.zeros(n + 1, np.int32)
    for i in range(len(column)):
        for corner in range(3):
            starts[column[i, corner] + 1] += weight[i, corner] != 0.0
    for k in range(n):
        starts[k + 1] += starts[k]
    cursor = starts[:-1].copy()
    child, share = np.empty(starts[n], np.int32), np.empty(starts[n])
    for i in range(len(column)):
        for corner in range(3):
            if weight[i, corner] != 0.0:
                k = column[i, corner]
                child[cursor[k]], share[cursor[k]] = i, weight[i, corner]
                cursor[k] += 1
    return starts, child, share


@njit(cache=True, nogil=True)
def _sort(column: Int32, value: Float) -> None:
    """Sort a short row by its columns."""
    for at in range(1, len(column)):
        c, v = column[at], value[at]
        before = at - 1
        while before >= 0 and column[before] > c:
            column[before + 1], value[before + 1] = column[before], value[before]
            before -= 1
        column[before + 1], value[before + 1] = c, v


@njit(cache=True, nogil=True)
def coarse_operator(
    pointers: Int32, indices: Int32, values: Float, mass: Float, column: Int32, weight: Float, n: int
) -> tuple[Int32, Int32, Float, Float]:
    """P^T C P (pointers, indices, values), which has C's symmetry and kernel, and the masses P^T R 1 (n,)."""
    row, product_column, product = _product(pointers, indices, values, column, weight, n)
    starts, child, share = _transposed(column, weight, n)
    place, masses = np.full(n, -1, np.int32), np.zeros(n)
    coarse_row = np.zeros(n + 1, np.int32)
    coarse_column, coarse = np.empty(32 * n + 64, np.int32), np.empty(32 * n + 64)
    used = 0
    for k in range(n):
        begin = used
        if len(coarse) - used < n:
            coarse_column = np.concatenate((coarse_column, np.empty(len(coarse), np.int32)))
            coarse = np.concatenate((coarse, np.empty(len(coarse))))
        for c in range(starts[k], starts[k + 1]):
            i, value = child[c], share[c]
            masses[k] += value * mass[i]
            for at in range(row[i], row[i + 1]):
                j = product_column[at]
                if place[j] < begin:
                    place[j] = used
                    coarse_column[used], coarse[used] = j, 0.0
                    used += 1
                coarse[place[j]] += value * product[at]
        _sort(coarse_column[begin:used], coarse[begin:used])
        coarse_row[k + 1] = used
    return coarse_row, coarse_column[:used].copy(), coarse[:used].copy(), masses


@njit(cache=True, nogil=True)
def descend(
    pointers: Int32, indices: Int32, values: Single, inverse: Single, b: Single, x: Single,
    column: Int32, weight: Single, below: Single,
) -> None:  # fmt: skip
    """A forward Gauss-Seidel sweep for C x = b from x = 0, and ``below`` = P^T (b - C x).

    After it (D + L) x = b, so that the residual is minus the upper triangle of C times x.
    """
    m = len(inverse)
    for i in range(m):
        s0, s1, s2, s3 = b[i, 0], b[i, 1], b[i, 2], b[i, 3]
        for at in range(pointers[i], pointers[i + 1]):
            j = indices[at]
            if j >= i:
                break
            c = values[at]
            s0 -= c * x[j, 0]
            s1 -= c * x[j, 1]
            s2 -= c * x[j, 2]
            s3 -= c * x[j, 3]
        d = inverse[i]
        x[i, 0], x[i, 1], x[i, 2], x[i, 3] = s0 * d, s1 * d, s2 * d, s3 * d
    below[:] = np.float32(0.0)
    for i in range(m):
        s0 = s1 = s2 = s3 = np.float32(0.0)
        for at in range(pointers[i + 1] - 1, pointers[i] - 1, -1):
            j = indices[at]
            if j <= i:
                break
            c = values[at]
            s0 -= c * x[j, 0]
            s1 -= c * x[j, 1]
            s2 -= c * x[j, 2]
            s3 -= c * x[j, 3]
        for corner in range(3):
            k, w = column[i, corner], weight[i, corner]
            below[k, 0] += w * s0
            below[k, 1] += w * s1
            below[k, 2] += w * s2
            below[k, 3] += w * s3


@njit(cache=True, nogil=True)
def ascend(
    pointers: Int32, indices: Int32, values: Single, inverse: Single, b: Single, x: Single,
    column: Int32, weight: Single, below: Single,
) -> None:  # fmt: skip
    """x + P ``below``, and a backward Gauss-Seidel sweep for C x = b: with ``descend`` a symmetric cycle."""
    m = len(inverse)
    for i in range(m):
        s0, s1, s2, s3 = x[i, 0], x[i, 1], x[i, 2], x[i, 3]
        for corner in range(3):
            k, w = column[i, corner], weight[i, corner]
            s0 += w * below[k, 0]
            s1 += w * below[k, 1]
            s2 += w * below[k, 2]
            s3 += w * below[k, 3]
        x[i, 0], x[i, 1], x[i, 2], x[i, 3] = s0, s1, s2, s3
    for i in range(m - 1, -1, -1):
        s0, s1, s2, s3 = b[i, 0], b[i, 1], b[i, 2], b[i, 3]
        for at in range(pointers[i], pointers[i + 1]):
            j, c = indices[at], values[at]
            s0 -= c * x[j, 0]
            s1 -= c * x[j, 1]
            s2 -= c * x[j, 2]
            s3 -= c * x[j, 3]
        d = inverse[i]
        x[i, 0] += s0 * d
        x[i, 1] += s1 * d
        x[i, 2] += s2 * d
        x[i, 3] += s3 * d


@njit(cache=True, nogil=True)
def carry(column: Int32, weight: Float, X: Float) -> Single:
    """P X, (m, 4), where X are the first four columns. As a start it needs few digits."""
    carried = np.zeros((len(column), 4), np.float32)
    for i in range(len(column)):
        for corner in range(3):
            k, w = column[i, corner], weight[i, corner]
            for c in range(4):
                carried[i, c] += w * X[k, c]
    return carried


@njit(cache=True, nogil=True)
def residual(mass: Float, S: Float, CS: Float, eigenvalues: Float, b: Single) -> None:
    """b = C X - R X diag(eigenvalues), X being the first four columns of S."""
    l0, l1, l2, l3 = eigenvalues[0], eigenvalues[1], eigenvalues[2], eigenvalues[3]
    for i in range(len(mass)):
        a = mass[i]
        b[i, 0] = CS[i, 0] - a * l0 * S[i, 0]
        b[i, 1] = CS[i, 1] - a * l1 * S[i, 1]
        b[i, 2] = CS[i, 2] - a * l2 * S[i, 2]
        b[i, 3] = CS[i, 3] - a * l3 * S[i, 3]


@njit(cache=True, nogil=True)
def image(
    pointers: Int32, indices: Int32, values: Float, mass: Float, x: Single,
    S: Float, CS: Float, RS: Float,
) -> None:  # fmt: skip
    """S = x without its mean under R, CS = C x, RS = R S."""
    m = len(mass)
    t0 = t1 = t2 = t3 = total = 0.0
    for i in range(m):
        a = mass[i]
        t0 += a * x[i, 0]
        t1 += a * x[i, 1]
        t2 += a * x[i, 2]
        t3 += a * x[i, 3]
        total += a
    t0, t1, t2, t3 = t0 / total, t1 / total, t2 / total, t3 / total
    for i in range(m):
        s0 = s1 = s2 = s3 = 0.0
        for at in range(pointers[i], pointers[i + 1]):
            j, c = indices[at], values[at]
            s0 += c * x[j, 0]
            s1 += c * x[j, 1]
            s2 += c * x[j, 2]
            s3 += c * x[j, 3]
        CS[i, 0], CS[i, 1], CS[i, 2], CS[i, 3] = s0, s1, s2, s3
        s0, s1, s2, s3 = x[i, 0] - t0, x[i, 1] - t1, x[i, 2] - t2, x[i, 3] - t3
        S[i, 0], S[i, 1], S[i, 2], S[i, 3] = s0, s1, s2, s3
        a = mass[i]
        RS[i, 0], RS[i, 1], RS[i, 2], RS[i, 3] = a * s0, a * s1, a * s2, a * s3
