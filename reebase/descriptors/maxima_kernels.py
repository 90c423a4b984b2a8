"""The compiled loop of persistent maxima: superlevel sets grow vertex by vertex, joined by union-find."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["persistences"]


@njit(cache=True, nogil=True)
def persistences(
    values: npt.NDArray[np.float64],
    order: npt.NDArray[np.int64],
    starts: npt.NDArray[np.int32],
    neighbours: npt.NDArray[np.int32],
) -> npt.NDArray[np.float64]:
    """Persistence of each vertex that is a maximum, -1 of the others, infinite of the highest of a component.

    order: the vertices from the highest to the lowest. neighbours: in compressed rows.
    Every set of joined vertices has its highest one as root, so a root's rank tells which of two is older.
    """
    count = len(values)
    rank = np.empty(count, np.int64)
    for place in range(count):
        rank[order[place]] = place
    parent = np.full(count, -1, np.int64)
    out = np.full(count, -1.0)
    for place in range(count):
        vertex = order[place]
        parent[vertex] = vertex
        out[vertex] = np.inf
        for k in range(starts[vertex], starts[vertex + 1]):
            other = np.int64(neighbours[k])
            if parent[other] < 0:
                continue
            while parent[other] != other:
                parent[other] = parent[parent[other]]
                other = parent[other]
            own = parent[vertex]
            while parent[own] != own:
                own = parent[own]
            if own == other:
                continue
            older, younger = (own, other) if rank[own] < rank[other] else (other, own)
            parent[younger] = older
            # A vertex that joins a higher neighbour at once was never a maximum.
            out[younger] = -1.0 if younger == vertex else values[younger] - values[vertex]
    return out
