"""The histogram of half a million distances, in one pass."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["binned"]

Float = npt.NDArray[np.float64]


@njit(cache=True, nogil=True)
def binned(values: Float, edges: Float) -> npt.NDArray[np.int64]:
    """How many values, none below the first edge, lie in each bin; the edges are evenly apart, (bins + 1,).

    A value on an edge is in the bin above it, and those behind the last are in the last bin.
    """
    bins = len(edges) - 1
    counts = np.zeros(bins, np.int64)
    norm = bins / (edges[bins] - edges[0])
    for value in values:
        at = min(int(min(value - edges[0], edges[bins]) * norm), bins - 1)
        if value < edges[at]:  # where rounding put it beside its bin
            at -= 1
        elif at < bins - 1 and value >= edges[at + 1]:
            at += 1
        counts[at] += 1
    return counts
