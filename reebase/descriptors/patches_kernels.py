"""Compiled loops of ``patches``: what lies round a point, and the best counterpart of every patch of a part."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["closest_patches", "gather"]


@njit(cache=True, nogil=True)
def gather(
    distances: npt.NDArray[np.float64], areas: npt.NDArray[np.float64], normals: npt.NDArray[np.float64],
    offsets: npt.NDArray[np.float64], normal: npt.NDArray[np.float64], radii: npt.NDArray[np.float64],
    out: npt.NDArray[np.float64],
) -> None:  # fmt: skip
    """out[k] = (area, mean cosine of the normals, mean height over the radius) of the faces within radii[k], (K, 3).

    distances, areas, normals, offsets: of the faces' centroids from the point, whose normal is ``normal``.
    """
    count = len(radii)
    out[:] = 0.0
    for f in range(len(distances)):
        if not distances[f] < radii[count - 1]:
            continue
        cosine = height = 0.0
        for axis in range(3):
            cosine += normals[f, axis] * normal[axis]
            height += offsets[f, axis] * normal[axis]
        k = np.searchsorted(radii, distances[f], side="right")
        out[k, 0] += areas[f]
        out[k, 1] += areas[f] * cosine
        out[k, 2] += areas[f] * height
    for k in range(count):
        if k:
            for column in range(3):
                out[k, column] += out[k - 1, column]
    for k in range(count):
        if out[k, 0] > 0.0:
            out[k, 1] /= out[k, 0]
            out[k, 2] /= out[k, 0] * radii[k]


@njit(cache=True, nogil=True)
def _shifted(
    whole: npt.NDArray[np.float64], shift: float, widths: int, out: npt.NDArray[np.float64], low: npt.NDArray[np.int64],
    high: npt.NDArray[np.int64],
) -> None:  # fmt: skip
    """Bin k of ``out`` is bin k + shift of the patches, between two of them linear; known from low to before high.

    Where one of the two is not known the other stands for both, else a shift by a hair would cost a disc.
    """
    step = int(np.floor(shift))
    part = shift - step
    for j in range(len(whole)):
        first, last = int(whole[j, 0]), int(whole[j, 1])
        low[j] = min(max(first - step - (1 if part > 0.0 else 0), 0), widths)
        high[j] = max(min(last - step, widths), low[j]) if last > first else low[j]
        for k in range(low[j], high[j]):
            below = max(k + step, first)
            above = min(k + step + 1, last - 1)
            for column in range(3):
                one, other = whole[j, 2 + 3 * below + column], whole[j, 2 + 3 * above + column]
                out[j, 3 * k + column] = one + part * (other - one)


@njit(cache=True, nogil=True, fastmath={"reassoc", "nsz"})
def _difference(
    part: npt.NDArray[np.float64], i: int, moved: npt.NDArray[np.float64], j: int, low: int, high: int
) -> float:
    total = 0.0
    for k in range(3 * low, 3 * high):
        total += abs(part[i, 2 + k] - moved[j, k])
    return total / (high - low)


@njit(cache=True, nogil=True)
def closest_patches(
    part: npt.NDArray[np.float64], whole: npt.NDArray[np.float64], shifts: npt.NDArray[np.float64], fewest: int,
    farthest: float, partner: npt.NDArray[np.int64], costs: npt.NDArray[np.float64],
) -> float:  # fmt: skip
    """The least over the shifts of the mean difference of the patches of a part from their closest in the whole.

    part, whole: rows (first known bin, one after the last, 3 values a bin ...). A patch counts with as many bins as it
    knows, and finds those that know as many of the same, up to ``fewest``; where it finds none it costs ``farthest``.
    partner, costs: of each patch of the part, its closest (-1 for none) and what it adds, at the best shift.
    """
    widths = (part.shape[1] - 2) // 3
    moved = np.zeros((len(whole), 3 * widths))
    low, high = np.empty(len(whole), np.int64), np.empty(len(whole), np.int64)
    found, cost = np.empty(len(part), np.int64), np.empty(len(part))
    known = 0.0
    for i in range(len(part)):
        known += part[i, 1] - part[i, 0]
    best = np.inf
    for s in range(len(shifts)):
        _shifted(whole, shifts[s], widths, moved, low, high)
        total = 0.0
        for i in range(len(part)):
            first, last = int(part[i, 0]), int(part[i, 1])
            least, found[i] = farthest, -1
            for j in range(len(whole)):
                start, end = max(first, low[j]), min(last, high[j])
                if end - start >= max(min(fewest, last - first), 1):
                    apart = _difference(part, i, moved, j, start, end)
                    if apart < least:
                        least, found[i] = apart, j
            cost[i] = least * (last - first) / known if known > 0.0 else farthest / len(part)
            total += cost[i]
            if total >= best:
                break
        if total < best:
            best = total
            partner[:] = found
            costs[:] = cost
    return best
