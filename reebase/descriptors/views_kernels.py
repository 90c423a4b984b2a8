"""Compiled loops of ``views``: depth images of triangles, and the least difference of two sets over the turns."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["depth_images", "least_over_turns"]

EDGE_ON = 1e-12
"""Twice the area in pixels below which a projected triangle is not seen."""

RIM = -1e-9
"""Barycentric coordinates down to this count as inside, so that no pixel falls between two triangles."""


@njit(cache=True, nogil=True)
def depth_images(
    points: npt.NDArray[np.float64], faces: npt.NDArray[np.int32], front: npt.NDArray[np.float64],
    back: npt.NDArray[np.float64],
) -> None:  # fmt: skip
    """The greatest and the least z over each pixel's centre; -inf and inf where there is no surface.

    points: (m, 3). front, back: square, the window [-1, 1] x [-1, 1], row = x, column = y.
    """
    size = len(front)
    half = size / 2.0
    front[:] = -np.inf
    back[:] = np.inf
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = (points[a, 0] + 1.0) * half - 0.5, (points[a, 1] + 1.0) * half - 0.5, points[a, 2]
        bx, by, bz = (points[b, 0] + 1.0) * half - 0.5, (points[b, 1] + 1.0) * half - 0.5, points[b, 2]
        cx, cy, cz = (points[c, 0] + 1.0) * half - 0.5, (points[c, 1] + 1.0) * half - 0.5, points[c, 2]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if abs(area) < EDGE_ON:
            continue
        # Clipped before they become integers: a far point has no number of a pixel.
        x0 = int(np.ceil(max(0.0, min(ax, bx, cx) + RIM)))
        x1 = int(np.floor(min(size - 1.0, max(ax, bx, cx) - RIM)))
        y0 = int(np.ceil(max(0.0, min(ay, by, cy) + RIM)))
        y1 = int(np.floor(min(size - 1.0, max(ay, by, cy) - RIM)))
        for x in range(x0, x1 + 1):
            for y in range(y0, y1 + 1):
                u = ((bx - x) * (cy - y) - (cx - x) * (by - y)) / area
                v = ((cx - x) * (ay - y) - (ax - x) * (cy - y)) / area
                w = 1.0 - u - v
                if u >= RIM and v >= RIM and w >= RIM:
                    z = u * az + v * bz + w * cz
                    front[x, y] = max(front[x, y], z)
                    back[x, y] = min(back[x, y], z)


@njit(cache=True, nogil=True, fastmath={"reassoc", "nsz"})
def _difference(first: npt.NDArray[np.float32], second: npt.NDArray[np.float32], i: int, j: int) -> float:
    total = np.float32(0.0)
    for k in range(first.shape[1]):
        total += abs(first[i, k] - second[j, k])
    return float(total)


@njit(cache=True, nogil=True)
def _comes_first(first: npt.NDArray[np.float32], second: npt.NDArray[np.float32]) -> bool:
    for i in range(first.shape[0]):
        for k in range(first.shape[1]):
            if first[i, k] != second[i, k]:
                return bool(first[i, k] < second[i, k])
    return True


@njit(cache=True, nogil=True)
def least_over_turns(
    query: npt.NDArray[np.float32], others: npt.NDArray[np.float32], turns: npt.NDArray[np.int64],
    out: npt.NDArray[np.float64],
) -> None:  # fmt: skip
    """out[c] = the least over frames and turns t of the mean over views v of |a[v] - b[t[v]]|_1.

    query: (frames * V, w), the views of one frame after the other. others: the same of n shapes, one after the other.
    turns: permutations of the V views, a group (T, V). Symmetric to the bit: of two sets always the same one is turned.
    """
    count = turns.shape[1]
    costs = np.empty((count, count))
    # No turn takes a view along an axis to a view along a diagonal: such costs are not needed.
    meet = np.zeros((count, count), np.bool_)
    for t in range(len(turns)):
        for i in range(count):
            meet[i, turns[t, i]] = True
    for c in range(len(out)):
        first, second = query, others[c * len(query) : (c + 1) * len(query)]
        if not _comes_first(first, second):
            first, second = second, first
        least = np.inf
        for start in range(0, len(query), count):
            for i in range(count):
                for j in range(count):
                    if meet[i, j]:
                        costs[i, j] = _difference(first, second, start + i, start + j)
            for t in range(len(turns)):
                total = 0.0
                for i in range(count):
                    total += costs[i, turns[t, i]]
                least = min(least, total)
        out[c] = least / count
