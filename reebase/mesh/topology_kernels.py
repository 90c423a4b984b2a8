"""Linear-time loops under topology.py, clean.py and denoise. They assume valid input: every index is in
range."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["first_within", "group", "label", "mean_distance", "one_rings", "triangle_measures"]

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]


@njit(cache=True, nogil=True)
def group(keys: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Stable counting sort: ``order[starts[k]:starts[k + 1]]`` are the positions of key k, ascending."""
    starts = np.zeros(count + 1, dtype=np.int32)
    for key in keys:
        starts[key + 1] += 1
    for k in range(count):
        starts[k + 1] += starts[k]
    cursor = starts[:-1].copy()
    order = np.empty(len(keys), dtype=np.int32)
    for i in range(len(keys)):
        order[cursor[keys[i]]] = i
        cursor[keys[i]] += 1
    return starts, order


@njit(cache=True, nogil=True)
def label(first: IntArray, second: IntArray, count: int) -> tuple[int, IntArray]:
    """Connected components of the graph on ``count`` nodes with edges first[k] - second[k].

    Components are numbered by their smallest node. Union-find: the smaller root wins, paths are halved.
    """
    parent = np.arange(count, dtype=np.int32)
    for k in range(len(first)):
        a, b = first[k], second[k]
        while parent[a] != a:
            parent[a] = parent[parent[a]]
            a = parent[a]
        while parent[b] != b:
            parent[b] = parent[parent[b]]
            b = parent[b]
        if a < b:
            parent[b] = a
        elif b < a:
            parent[a] = b
    found = 0
    for i in range(count):
        # A parent is never larger than its child, so parent[i] holds its final number already.
        if parent[i] == i:
            parent[i] = found
            found += 1
        else:
            parent[i] = parent[parent[i]]
    return found, parent


@njit(cache=True, nogil=True)
def first_within(points: FloatArray, cells: npt.NDArray[np.int64], reach: int, tolerance: float) -> IntArray:
    """For each point the first kept point within ``tolerance`` of it, or itself, which is then kept.

    points: (m, 3). cells: the integer cell of each point, (m, 3). Only cells at most ``reach`` away are
    looked at. Kept points are farther than ``tolerance`` apart, so a cell holds few of them and the time is
    linear.
    """
    count = len(points)
    size = 16
    while size < 2 * count:
        size *= 2
    mask = np.uint64(size - 1)
    head = np.full(size, -1, dtype=np.int32)
    following = np.empty(count, dtype=np.int32)
    result = np.empty(count, dtype=np.int32)
    limit = tolerance * tolerance
    for i in range(count):
        found = -1
        own = np.uint64(0)
        for dx in range(-reach, reach + 1):
            for dy in range(-reach, reach + 1):
                for dz in range(-reach, reach + 1):
                    x, y, z = cells[i, 0] + dx, cells[i, 1] + dy, cells[i, 2] + dz
                    mixed = np.uint64(x) * np.uint64(0x9E3779B97F4A7C15)
                    mixed = (mixed ^ (mixed >> np.uint64(29)) ^ np.uint64(y)) * np.uint64(0xBF58476D1CE4E5B9)
                    mixed = (mixed ^ (mixed >> np.uint64(31)) ^ np.uint64(z)) * np.uint64(0x94D049BB133111EB)
                    slot = (mixed ^ (mixed >> np.uint64(30))) & mask
                    if dx == 0 and dy == 0 and dz == 0:
                        own = slot
                    j = head[slot]
                    while j != -1:
                        same = cells[j, 0] == x and cells[j, 1] == y and cells[j, 2] == z
                        if same and (found < 0 or j < found):
                            distance = 0.0
                            for axis in range(3):
                                difference = points[i, axis] - points[j, axis]
                                distance += difference * difference
                            if distance <= limit:
                                found = j
                        j = following[j]
        if found < 0:
            found = i
            following[i] = head[own]
            head[own] = i
        result[i] = found
    return result


@njit(cache=True, nogil=True)
def one_rings(
    faces: IntArray, count: int
) -> tuple[IntArray, IntArray, IntArray, IntArray, IntArray]:
    """Triangles and neighbours round each of ``count`` vertices.

    Returns corner_starts (count + 1,) and ring (3n, 2): the next and the previous vertex of each corner at
    a vertex; neighbour_starts (count + 1,), neighbours and shared: how many triangles hold that edge (1:
    boundary). Triangles keep their order; a vertex is no neighbour of itself; neighbours stand in the order
    in which the ring meets them.
    """
    starts = np.zeros(count + 1, dtype=np.int32)
    for f in range(len(faces)):
        for k in range(3):
            starts[faces[f, k] + 1] += 1
    for v in range(count):
        starts[v + 1] += starts[v]
    ring = np.empty((3 * len(faces), 2), dtype=np.int32)
    cursor = starts[:-1].copy()
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ring[cursor[a], 0] = b
        ring[cursor[a], 1] = c
        cursor[a] += 1
        ring[cursor[b], 0] = c
        ring[cursor[b], 1] = a
        cursor[b] += 1
        ring[cursor[c], 0] = a
        ring[cursor[c], 1] = b
        cursor[c] += 1
    neighbour_starts = np.zeros(count + 1, dtype=np.int32)
    neighbours = np.empty(6 * len(faces), dtype=np.int32)
    shared = np.zeros(6 * len(faces), dtype=np.int32)
    place = np.full(count, -1, dtype=np.int32)
    used = 0
    for v in range(count):
        begin = used
        for k in range(starts[v], starts[v + 1]):
            for side in range(2):
                other = ring[k, side]
                if other == v:
                    continue
                if place[other] < begin:
                    place[other] = used
                    neighbours[used] = other
                    used += 1
                shared[place[other]] += 1
        neighbour_starts[v + 1] = used
    return starts, ring, neighbour_starts, neighbours[:used].copy(), shared[:used].copy()


@njit(cache=True, nogil=True)
def triangle_measures(vertices: FloatArray, faces: IntArray, about: IntArray) -> FloatArray:
    """For each face its area, its shortest and its longest side, and the signed volume of the tetrahedron
    on it whose tip is the vertex ``about`` of the face, (n, 4)."""
    measures = np.empty((len(faces), 4))
    for f in range(len(faces)):
        i, j, k, o = faces[f, 0], faces[f, 1], faces[f, 2], about[f]
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        ux, uy, uz = vertices[j, 0] - x, vertices[j, 1] - y, vertices[j, 2] - z
        vx, vy, vz = vertices[k, 0] - x, vertices[k, 1] - y, vertices[k, 2] - z
        wx, wy, wz = vx - ux, vy - uy, vz - uz
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        u, v, w = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz
        measures[f, 0] = 0.5 * math.sqrt(nx * nx + ny * ny + nz * nz)
        measures[f, 1] = math.sqrt(min(u, v, w))
        measures[f, 2] = math.sqrt(max(u, v, w))
        x, y, z = x - vertices[o, 0], y - vertices[o, 1], z - vertices[o, 2]
        measures[f, 3] = (x * nx + y * ny + z * nz) / 6.0
    return measures


@njit(cache=True, nogil=True)
def mean_distance(vertices: FloatArray, starts: IntArray, neighbours: IntArray) -> float:
    """The mean of |v_j - v_i| over all i and j ~ i: the mean edge length, as every edge is met from both
    ends."""
    total = 0.0
    for i in range(len(vertices)):
        for k in range(starts[i], starts[i + 1]):
            j = neighbours[k]
            x, y = vertices[j, 0] - vertices[i, 0], vertices[j, 1] - vertices[i, 1]
            z = vertices[j, 2] - vertices[i, 2]
            total += math.sqrt(x * x + y * y + z * z)
    return total / max(len(neighbours), 1)
