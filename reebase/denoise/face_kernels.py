"""Loops over faces that the filters of normals share. They assume valid input; none is on the default path."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from reebase.denoise.exponential_kernels import FAST, exponentials
from reebase.denoise.ring_kernels import CROWD

__all__ = [
    "around_faces", "bilateral_normals", "bilateral_weights", "face_geometry", "follow_normals", "followed_moves",
    "later_of", "mean_distance_across", "mean_normals", "median_normals", "normals_above", "sides_in_pairs",
]  # fmt: skip

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]

BATCH = 2048


@FAST
def face_geometry(positions: FloatArray, faces: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Unit normals, (n, 3), zero without area; areas, (n,); centroids, (n, 3)."""
    normals, centroids = np.zeros((len(faces), 3)), np.empty((len(faces), 3))
    areas = np.empty(len(faces))
    for t in range(len(faces)):
        i, j, k = np.uint32(faces[t, 0]), np.uint32(faces[t, 1]), np.uint32(faces[t, 2])
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        ux, uy, uz = positions[j, 0] - x, positions[j, 1] - y, positions[j, 2] - z
        vx, vy, vz = positions[k, 0] - x, positions[k, 1] - y, positions[k, 2] - z
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        areas[t] = 0.5 * length
        if length > 0.0:
            normals[t, 0], normals[t, 1], normals[t, 2] = nx / length, ny / length, nz / length
        centroids[t, 0] = x + (ux + vx) / 3.0
        centroids[t, 1] = y + (uy + vy) / 3.0
        centroids[t, 2] = z + (uz + vz) / 3.0
    return normals, areas, centroids


@FAST
def around_faces(faces: IntArray, corner_starts: IntArray, corners: IntArray) -> tuple[IntArray, IntArray]:
    """The other faces that share a vertex with each face, in compressed rows.

    corners: the corners 3f + k at each vertex. At a vertex with more than CROWD triangles only those count that share
    another vertex as well.
    """
    count = len(faces)
    most = 0
    for v in range(len(corner_starts) - 1):
        size = corner_starts[v + 1] - corner_starts[v]
        most += size * size if size <= CROWD else 0
    mark = np.full(count, -1, dtype=np.int32)
    starts, rows = np.zeros(count + 1, dtype=np.int32), np.empty(most, dtype=np.int32)
    position = 0
    for t in range(count):
        mark[t] = t
        for corner in range(3):
            w = np.uint32(faces[t, corner])
            begin, end = np.uint32(corner_starts[w]), np.uint32(corner_starts[w + np.uint32(1)])
            if end - begin > CROWD:
                continue
            for k in range(begin, end):
                other = np.uint32(corners[k] // 3)
                # Written either way, and kept if it is new: that is as good as random.
                rows[position] = other
                position += mark[other] != t
                mark[other] = t
        starts[t + 1] = position
    rows = rows[:position].copy()
    return starts, rows


@FAST
def sides_in_pairs(faces: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """The two sides 3f + k along each edge that has two, of faces on ``count`` vertices: two arrays, by lower end."""
    starts = np.zeros(count + 1, dtype=np.int32)
    for f in range(len(faces)):
        a, b, c = np.uint32(faces[f, 0]), np.uint32(faces[f, 1]), np.uint32(faces[f, 2])
        starts[min(a, b) + np.uint32(1)] += 1
        starts[min(b, c) + np.uint32(1)] += 1
        starts[min(c, a) + np.uint32(1)] += 1
    for v in range(count):
        starts[v + 1] += starts[v]
    sides, ends, cursor = np.empty(3 * len(faces), np.int32), np.empty(3 * len(faces), np.int32), starts[:-1].copy()
    for f in range(len(faces)):
        for k in range(3):
            one, other = np.uint32(faces[f, k]), np.uint32(faces[f, k + 1 if k < 2 else 0])
            low = min(one, other)
            next_one = np.uint32(cursor[low])
            sides[next_one], ends[next_one] = 3 * f + k, max(one, other)
            cursor[low] += 1
    # Of each upper end, the edge to it from the lower end that is looked at; of each edge, how many sides it has.
    edge, have = np.full(count, -1, dtype=np.int32), np.zeros(3 * len(faces), dtype=np.int32)
    first, second = np.empty(3 * len(faces), np.int32), np.empty(3 * len(faces), np.int32)
    met, begin = 0, 0
    for v in range(count):
        for place in range(np.uint32(starts[v]), np.uint32(starts[v + 1])):
            end = np.uint32(ends[place])
            if edge[end] < begin:
                edge[end] = met
                first[met] = sides[place]
                met += 1
            else:
                second[np.uint32(edge[end])] = sides[place]
            have[np.uint32(edge[end])] += 1
        begin = met
    pairs = 0
    for found in range(met):
        first[pairs], second[pairs] = first[found], second[found]
        pairs += have[found] == 2
    return first[:pairs].copy(), second[:pairs].copy()


@FAST
def mean_distance_across(points: FloatArray, first: IntArray, second: IntArray) -> float:
    """The mean of |p_s - p_t| over pairs."""
    total = 0.0
    for k in range(len(first)):
        s, t = np.uint32(first[k]), np.uint32(second[k])
        x, y, z = points[s, 0] - points[t, 0], points[s, 1] - points[t, 1], points[s, 2] - points[t, 2]
        total += math.sqrt(x * x + y * y + z * z)
    return total / max(len(first), 1)


@njit(cache=True, nogil=True)
def mean_normals(normals: FloatArray, areas: FloatArray, starts: IntArray, rows: IntArray) -> FloatArray:
    """The area-weighted mean of each row's normals, at length 1, or zero where they cancel, (n, 3)."""
    result = np.zeros_like(normals)
    for t in range(len(normals)):
        x, y, z = 0.0, 0.0, 0.0
        for k in range(starts[t], starts[t + 1]):
            s = rows[k]
            x += areas[s] * normals[s, 0]
            y += areas[s] * normals[s, 1]
            z += areas[s] * normals[s, 2]
        length = math.sqrt(x * x + y * y + z * z)
        if length > 0.0:
            result[t, 0], result[t, 1], result[t, 2] = x / length, y / length, z / length
    return result


@njit(cache=True, nogil=True)
def median_normals(normals: FloatArray, areas: FloatArray, starts: IntArray, rows: IntArray) -> FloatArray:
    """The normal in each row at the lower median of the angles to the face's own, (n, 3).

    Faces without area have no angle: they do not count, and have the normal zero.
    """
    result = np.zeros_like(normals)
    longest = 1
    for t in range(len(normals)):
        longest = max(longest, starts[t + 1] - starts[t])
    angles, order = np.empty(longest), np.empty(longest, dtype=np.int32)
    for t in range(len(normals)):
        if areas[t] == 0.0:
            continue
        count = 0
        for k in range(starts[t], starts[t + 1]):
            s = rows[k]
            if areas[s] == 0.0:
                continue
            # The chord grows with the angle, and tells small angles apart where the cosine cannot.
            chord = (
                (normals[s, 0] - normals[t, 0]) ** 2 + (normals[s, 1] - normals[t, 1]) ** 2
                + (normals[s, 2] - normals[t, 2]) ** 2
            )  # fmt: skip
            place = count
            while place > 0 and angles[place - 1] > chord:
                angles[place], order[place] = angles[place - 1], order[place - 1]
                place -= 1
            angles[place], order[place] = chord, s
            count += 1
        chosen = order[(count - 1) // 2] if count > 0 else t
        result[t, 0], result[t, 1], result[t, 2] = normals[chosen, 0], normals[chosen, 1], normals[chosen, 2]
    return result


@FAST
def follow_normals(
    positions: FloatArray, faces: IntArray, normals: FloatArray, by_area: bool
) -> FloatArray:
    """The mean over the triangles t round each vertex of <c_t - v_i, m_t> m_t, by their area or evenly, (m, 3).

    normals: m_t, (n, 3).
    """
    result, totals = np.zeros((len(positions), 3)), np.zeros(len(positions))
    for t in range(len(faces)):
        i, j, k = np.uint32(faces[t, 0]), np.uint32(faces[t, 1]), np.uint32(faces[t, 2])
        x, y, z = positions[i, 0], positions[i, 1], positions[i, 2]
        ux, uy, uz = positions[j, 0] - x, positions[j, 1] - y, positions[j, 2] - z
        vx, vy, vz = positions[k, 0] - x, positions[k, 1] - y, positions[k, 2] - z
        weight = 1.0
        if by_area:
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            weight = math.sqrt(nx * nx + ny * ny + nz * nz)
        mx, my, mz = normals[t, 0], normals[t, 1], normals[t, 2]
        u, v = ux * mx + uy * my + uz * mz, vx * mx + vy * my + vz * mz
        third = (u + v) / 3.0
        for corner in range(3):
            height = third if corner == 0 else third - u if corner == 1 else third - v
            w = np.uint32(faces[t, corner])
            totals[w] += weight
            result[w, 0] += weight * height * mx
            result[w, 1] += weight * height * my
            result[w, 2] += weight * height * mz
    for vertex in range(len(positions)):
        if totals[vertex] > 0.0:
            result[vertex, 0] /= totals[vertex]
            result[vertex, 1] /= totals[vertex]
            result[vertex, 2] /= totals[vertex]
    return result


@FAST
def followed_moves(positions: FloatArray, faces: IntArray, normals: FloatArray, moves: int) -> FloatArray:
    """Positions after so many moves of ``follow_normals``, evenly, (m, 3)."""
    here, sums, shares = positions.copy(), np.empty_like(positions), np.zeros(len(positions))
    for t in range(len(faces)):
        for corner in range(3):
            shares[np.uint32(faces[t, corner])] += 1.0
    for w in range(len(positions)):
        shares[w] = 1.0 / shares[w] if shares[w] > 0.0 else 0.0
    for _ in range(moves):
        sums[:] = 0.0
        for t in range(len(faces)):
            i, j, k = np.uint32(faces[t, 0]), np.uint32(faces[t, 1]), np.uint32(faces[t, 2])
            x, y, z = here[i, 0], here[i, 1], here[i, 2]
            mx, my, mz = normals[t, 0], normals[t, 1], normals[t, 2]
            u = (here[j, 0] - x) * mx + (here[j, 1] - y) * my + (here[j, 2] - z) * mz
            v = (here[k, 0] - x) * mx + (here[k, 1] - y) * my + (here[k, 2] - z) * mz
            third = (u + v) * (1.0 / 3.0)
            sums[i, 0] += third * mx
            sums[i, 1] += third * my
            sums[i, 2] += third * mz
            u, v = third - u, third - v
            sums[j, 0] += u * mx
            sums[j, 1] += u * my
            sums[j, 2] += u * mz
            sums[k, 0] += v * mx
            sums[k, 1] += v * my
            sums[k, 2] += v * mz
        for w in range(len(positions)):
            here[w, 0] += shares[w] * sums[w, 0]
            here[w, 1] += shares[w] * sums[w, 1]
            here[w, 2] += shares[w] * sums[w, 2]
    return here


@FAST
def later_of(starts: IntArray, rows: IntArray) -> tuple[IntArray, IntArray]:
    """Of each row what comes after its own place: each pair once, in compressed rows."""
    later_starts, later = np.zeros(len(starts), dtype=np.int32), np.empty(len(rows), dtype=np.int32)
    filled = np.uint32(0)
    for t in range(len(starts) - 1):
        for k in range(np.uint32(starts[t]), np.uint32(starts[t + 1])):
            # Written either way, and kept from one end: which one is as good as random.
            later[filled] = rows[k]
            filled += np.uint32(rows[k] > t)
        later_starts[t + 1] = filled
    return later_starts, later[:filled].copy()


@FAST
def bilateral_normals(
    normals: FloatArray, guides: FloatArray, areas: FloatArray, centroids: FloatArray, starts: IntArray,
    later: IntArray, sigma_c: float, sigma_s: float,
) -> FloatArray:  # fmt: skip
    """sum_s A_s exp(-|c_s - c_t|^2 / 2 sigma_c^2 - |g_s - g_t|^2 / 2 sigma_s^2) n_s over the faces round each, at
    length 1, (n, 3).

    starts, later: of ``later_of``: the weight of a pair serves both. Where the sum vanishes the normal stays. Faces are
    taken so many at once that their rows hold about BATCH faces.
    """
    result, shares = np.zeros_like(normals), np.empty_like(normals)
    near, alike = -0.5 / (sigma_c * sigma_c), -0.5 / (sigma_s * sigma_s)
    longest = BATCH
    for t in range(len(normals)):
        longest = max(longest, starts[t + 1] - starts[t])
        shares[t, 0], shares[t, 1], shares[t, 2] = (
            areas[t] * normals[t, 0], areas[t] * normals[t, 1], areas[t] * normals[t, 2],
        )  # fmt: skip
    weights, scratch = np.empty(longest), np.empty(longest)
    bits = scratch.view(np.int64)
    first = 0
    while first < len(normals):
        base, last = starts[first], first
        while last < len(normals) and starts[last + 1] - base <= longest:
            begin, end = np.uint32(starts[last]), np.uint32(starts[last + 1])
            cx, cy, cz = centroids[last, 0], centroids[last, 1], centroids[last, 2]
            gx, gy, gz = guides[last, 0], guides[last, 1], guides[last, 2]
            for k in range(begin, end):
                s = np.uint32(later[k])
                x, y, z = centroids[s, 0] - cx, centroids[s, 1] - cy, centroids[s, 2] - cz
                u, v, w = guides[s, 0] - gx, guides[s, 1] - gy, guides[s, 2] - gz
                weights[k - base] = near * (x * x + y * y + z * z) + alike * (u * u + v * v + w * w)
            last += 1
        exponentials(weights, scratch, bits, starts[last] - base)
        for t in range(first, last):
            x, y, z = result[t, 0], result[t, 1], result[t, 2]
            ownx, owny, ownz = shares[t, 0], shares[t, 1], shares[t, 2]
            for k in range(np.uint32(starts[t]), np.uint32(starts[t + 1])):
                s = np.uint32(later[k])
                weight = weights[k - base]
                x += weight * shares[s, 0]
                y += weight * shares[s, 1]
                z += weight * shares[s, 2]
                result[s, 0] += weight * ownx
                result[s, 1] += weight * owny
                result[s, 2] += weight * ownz
            result[t, 0], result[t, 1], result[t, 2] = x, y, z
        first = last
    for t in range(len(normals)):
        x, y, z = result[t, 0], result[t, 1], result[t, 2]
        length = math.sqrt(x * x + y * y + z * z)
        if length > 0.0:
            scale = 1.0 / length
            result[t, 0], result[t, 1], result[t, 2] = scale * x, scale * y, scale * z
        else:
            result[t, 0], result[t, 1], result[t, 2] = normals[t, 0], normals[t, 1], normals[t, 2]
    return result


@FAST
def bilateral_weights(
    normals: FloatArray, areas: FloatArray, centroids: FloatArray, starts: IntArray, rows: IntArray, sigma_c: float,
    sigma_s: float,
) -> FloatArray:  # fmt: skip
    """The weights of ``bilateral_normals``, each row scaled to sum 1, or 0 where they vanish, as long as rows."""
    weights = np.empty(len(rows))
    scratch = np.empty(len(rows))
    near, alike = -0.5 / (sigma_c * sigma_c), -0.5 / (sigma_s * sigma_s)
    for t in range(len(normals)):
        for k in range(starts[t], starts[t + 1]):
            s = rows[k]
            far, other = 0.0, 0.0
            for axis in range(3):
                far += (centroids[s, axis] - centroids[t, axis]) ** 2
                other += (normals[s, axis] - normals[t, axis]) ** 2
            weights[k] = near * far + alike * other
    exponentials(weights, scratch, scratch.view(np.int64), len(rows))
    for t in range(len(normals)):
        total = 0.0
        for k in range(starts[t], starts[t + 1]):
            weights[k] *= areas[rows[k]]
            total += weights[k]
        for k in range(starts[t], starts[t + 1]):
            weights[k] = weights[k] / total if total > 0.0 else 0.0
    return weights


@FAST
def normals_above(normals: FloatArray, starts: IntArray, rows: IntArray, threshold: float) -> FloatArray:
    """sum_s max(0, n_s . n_t - threshold)^2 n_s over each row and t itself, at length 1, (n, 3)."""
    result = normals.copy()
    for t in range(len(normals)):
        own = (1.0 - threshold) ** 2
        x, y, z = own * normals[t, 0], own * normals[t, 1], own * normals[t, 2]
        for k in range(np.uint32(starts[t]), np.uint32(starts[t + 1])):
            s = np.uint32(rows[k])
            product = normals[s, 0] * normals[t, 0] + normals[s, 1] * normals[t, 1] + normals[s, 2] * normals[t, 2]
            weight = max(0.0, product - threshold) ** 2
            x += weight * normals[s, 0]
            y += weight * normals[s, 1]
            z += weight * normals[s, 2]
        length = math.sqrt(x * x + y * y + z * z)
        if length > 0.0:
            result[t, 0], result[t, 1], result[t, 2] = x / length, y / length, z / length
    return result
