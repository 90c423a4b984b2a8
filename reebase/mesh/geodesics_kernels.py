"""The compiled loop of geodesic distance: Dijkstra's order, with an update across each triangle."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["march"]


@njit(cache=True, nogil=True)
def _across(at: npt.NDArray[np.float64], a: int, b: int, c: int, near: float, far: float) -> float:
    """Distance at corner c of a triangle, from those at a (``near``) and b (``far``), by way of the side a b.

    The source is unfolded into the plane of the triangle, on the other side of a b; where the straight line to c passes
    beside a b, or no such point exists, the way is along a side.
    """
    ab = ac = bc = dot = 0.0
    for k in range(3):
        u, v = at[b, k] - at[a, k], at[c, k] - at[a, k]
        ab += u * u
        ac += v * v
        dot += u * v
        bc += (at[c, k] - at[b, k]) ** 2
    along = min(near + np.sqrt(ac), far + np.sqrt(bc))
    if ab <= 0.0:
        return float(along)
    base = np.sqrt(ab)
    cx = dot / base
    cy = np.sqrt(max(ac - cx * cx, 0.0))
    sx = (near * near - far * far + ab) / (2.0 * base)
    below = near * near - sx * sx
    if below < 0.0:
        return float(along)
    sy = np.sqrt(below)
    if sy + cy <= 0.0:
        return float(along)
    crossing = sx + (cx - sx) * sy / (sy + cy)
    if crossing < 0.0 or crossing > base:
        return float(along)
    return float(np.sqrt((cx - sx) ** 2 + (cy + sy) ** 2))


@njit(cache=True, nogil=True)
def _sink(
    heap: npt.NDArray[np.int32], place: npt.NDArray[np.int32], out: npt.NDArray[np.float64], size: int
) -> None:
    """The vertex behind the last of ``size`` takes the place of the first, and sinks to its own."""
    vertex = heap[size]
    hole = 0
    while 2 * hole + 1 < size:
        child = 2 * hole + 1
        if child + 1 < size and out[heap[child + 1]] < out[heap[child]]:
            child += 1
        if out[heap[child]] >= out[vertex]:
            break
        heap[hole] = heap[child]
        place[heap[hole]] = hole
        hole = child
    heap[hole] = vertex
    place[vertex] = hole


@njit(cache=True, nogil=True)
def _rise(heap: npt.NDArray[np.int32], place: npt.NDArray[np.int32], out: npt.NDArray[np.float64], vertex: int) -> None:
    """A vertex whose distance has become less rises to its place."""
    hole = place[vertex]
    while hole > 0 and out[heap[(hole - 1) // 2]] > out[vertex]:
        heap[hole] = heap[(hole - 1) // 2]
        place[heap[hole]] = hole
        hole = (hole - 1) // 2
    heap[hole] = vertex
    place[vertex] = hole


@njit(cache=True, nogil=True)
def march(
    at: npt.NDArray[np.float64], starts: npt.NDArray[np.int32], ring: npt.NDArray[np.int32],
    sources: npt.NDArray[np.int64], reach: float, out: npt.NDArray[np.float64],
) -> None:  # fmt: skip
    """out[v] = length of a shortest way from the nearest source to vertex v, infinite where that exceeds ``reach``.

    sources: each once. starts, ring: of each vertex the two other corners of each of its triangles, in compressed rows.
    """
    count = len(at)
    out[:] = np.inf
    settled = np.zeros(count, np.bool_)
    heap = np.empty(count, np.int32)  # of vertices, the nearest first
    place = np.full(count, -1, np.int32)
    size = 0
    for source in sources:
        out[source] = 0.0
        heap[size] = source
        place[source] = size
        size += 1
    while size:
        vertex = heap[0]
        if out[vertex] > reach:
            break
        settled[vertex] = True
        size -= 1
        _sink(heap, place, out, size)
        for k in range(starts[vertex], starts[vertex + 1]):
            for side in range(2):
                end, other = ring[k, side], ring[k, 1 - side]
                if settled[end]:
                    continue
                found = out[vertex]
                if settled[other]:
                    found = _across(at, vertex, other, end, out[vertex], out[other])
                else:
                    length = 0.0
                    for axis in range(3):
                        length += (at[end, axis] - at[vertex, axis]) ** 2
                    found += np.sqrt(length)
                if found >= out[end]:
                    continue
                out[end] = found
                if place[end] < 0:
                    heap[size] = end
                    place[end] = size
                    size += 1
                _rise(heap, place, out, end)
    for k in range(size):
        out[heap[k]] = np.inf
