"""Linear-time loops under topology.py, clean.py and denoise. They assume valid input: every index is in
range."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = [
    "centred", "crossed_sides", "first_within", "group", "label", "mean_distance", "one_rings",
    "triangle_measures", "triangles_along",
]  # fmt: skip

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
def crossed_sides(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """The cross product of the sides of each face that leave its first corner, (n, 3)."""
    crossed = np.empty((len(faces), 3))
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = (vertices[b, 0] - vertices[a, 0], vertices[b, 1] - vertices[a, 1], vertices[b, 2] - vertices[a, 2])
        vx, vy, vz = (vertices[c, 0] - vertices[a, 0], vertices[c, 1] - vertices[a, 1], vertices[c, 2] - vertices[a, 2])
        crossed[f, 0] = uy * vz - uz * vy
        crossed[f, 1] = uz * vx - ux * vz
        crossed[f, 2] = ux * vy - uy * vx
    return crossed


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
def corners_round(faces: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """corner_starts and ring of ``one_rings``: a counting sort of the corners by vertex."""
    starts = np.zeros(count + 1, dtype=np.int32)
    for f in range(len(faces)):
        for k in range(3):
            starts[np.uint32(faces[f, k]) + np.uint32(1)] += 1
    for v in range(count):
        starts[v + 1] += starts[v]
    ring = np.empty((3 * len(faces), 2), dtype=np.int32)
    cursor = starts[:-1].copy()
    for f in range(len(faces)):
        # A signed index costs a test whether it counts from the end.
        a, b, c = np.uint32(faces[f, 0]), np.uint32(faces[f, 1]), np.uint32(faces[f, 2])
        place = np.uint32(cursor[a])
        ring[place, 0], ring[place, 1] = b, c
        cursor[a] += 1
        place = np.uint32(cursor[b])
        ring[place, 0], ring[place, 1] = c, a
        cursor[b] += 1
        place = np.uint32(cursor[c])
        ring[place, 0], ring[place, 1] = a, b
        cursor[c] += 1
    return starts, ring


@njit(cache=True, nogil=True)
def one_rings(
    faces: IntArray, count: int
) -> tuple[IntArray, IntArray, IntArray, IntArray, npt.NDArray[np.bool_]]:
    """Triangles and neighbours round each of ``count`` vertices.

    Returns corner_starts (count + 1,) and ring (3n, 2): the next and the previous vertex of each corner at
    a vertex; neighbour_starts (count + 1,), neighbours; closed (count,). Triangles keep their order; a vertex is
    no neighbour of itself. Where ``closed``, the triangles close one fan, alike oriented, and neighbours follow
    one another round it from the next vertex of the first triangle; elsewhere they stand in the order in which
    the ring meets them.
    """
    starts, ring = corners_round(faces, count)
    neighbour_starts = np.zeros(count + 1, dtype=np.int32)
    neighbours = np.empty(6 * len(faces), dtype=np.int32)
    closed = np.zeros(count, dtype=np.bool_)
    # Of each vertex met as the next one, the corner; while a ring is looked at that is not closed, its place there.
    place = np.full(count, -1, dtype=np.int32)
    used: Any = np.uint32(0)
    for v in range(count):
        begin, end = np.uint32(starts[v]), np.uint32(starts[v + 1])
        for k in range(begin, end):
            place[np.uint32(ring[k, 0])] = k
        # Walks from triangle to triangle. No branch: where it leads is as good as random.
        here: Any = begin
        fan = end > begin
        for step in range(end - begin):
            following = np.uint32(place[np.uint32(ring[here, 1])])
            inside = (following >= begin) & (following < end)
            fan = fan & inside & (ring[here, 0] != v) & ((following == begin) == (step == end - begin - 1))
            neighbours[used + np.uint32(step)] = ring[here, 0]
            here = following if inside else begin
        closed[v] = fan
        if fan:
            used += end - begin
        else:
            filled: Any = np.int64(used)
            used = np.uint32(met(v, ring[begin:end], neighbours, place, filled))
        neighbour_starts[v + 1] = used
    # Not copied: what is left of them was never written to, and holds no memory.
    return starts, ring, neighbour_starts, neighbours[:used], closed


@njit(cache=True, nogil=True)
def met(v: int, ring: IntArray, neighbours: IntArray, place: IntArray, used: int) -> int:
    """Writes the neighbours of v as its ring meets them from ``used`` on; returns where they end.

    place: any; it is -1 at these vertices afterwards.
    """
    begin = used
    for k in range(len(ring)):
        place[ring[k, 0]], place[ring[k, 1]] = -1, -1
    for k in range(len(ring)):
        for side in range(2):
            other = ring[k, side]
            if other != v and place[other] < 0:
                place[other] = used
                neighbours[used] = other
                used += 1
    for k in range(begin, used):
        place[neighbours[k]] = -1
    return used


@njit(cache=True, nogil=True)
def triangles_along(corner_starts: IntArray, ring: IntArray, starts: IntArray, neighbours: IntArray) -> IntArray:
    """How many triangles hold the edge from each vertex to each of its neighbours, as long as ``neighbours``."""
    result = np.zeros(len(neighbours), dtype=np.int32)
    place = np.empty(len(starts) - 1, dtype=np.int32)
    for v in range(len(starts) - 1):
        for k in range(starts[v], starts[v + 1]):
            place[neighbours[k]] = k
        for k in range(corner_starts[v], corner_starts[v + 1]):
            for side in range(2):
                if ring[k, side] != v:
                    result[place[ring[k, side]]] += 1
    return result


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


@njit(cache=True, nogil=True, error_model="numpy")
def centred(points: FloatArray, origin: int, left_out: npt.NDArray[np.bool_]) -> tuple[FloatArray, float]:
    """The points about one of them, those left out at zero, (m, 3), and the largest absolute coordinate."""
    result = np.empty((len(points), 3))
    x, y, z, largest = points[origin, 0], points[origin, 1], points[origin, 2], 0.0
    for i in range(len(points)):
        a, b, c = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
        if left_out[i]:
            a, b, c = 0.0, 0.0, 0.0
        result[i, 0], result[i, 1], result[i, 2] = a, b, c
        largest = max(largest, abs(a), abs(b), abs(c))
    return result, largest


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def mean_distance(vertices: FloatArray, starts: IntArray, neighbours: IntArray) -> float:
    """The mean of |v_j - v_i| over all i and j ~ i: the mean edge length, as every edge is met from both
    ends.

    Roots are taken many at once, so that the compiler makes vectors of them.
    """
    squares = np.zeros(1024)
    total, filled = 0.0, np.uint32(0)
    for i in range(len(vertices)):
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        for k in range(np.uint32(starts[i]), np.uint32(starts[i + 1])):
            j = np.uint32(neighbours[k])
            a, b, c = vertices[j, 0] - x, vertices[j, 1] - y, vertices[j, 2] - z
            # Written either way, and kept from one end: which one is as good as random.
            squares[filled] = a * a + b * b + c * c
            filled += np.uint32(j > i)
            if filled == 1023:
                for n in range(1023):
                    total += math.sqrt(squares[n])
                filled = np.uint32(0)
    for n in range(filled):
        total += math.sqrt(squares[n])
    return total / max(len(neighbours) // 2, 1)
