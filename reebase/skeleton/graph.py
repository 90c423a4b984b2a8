"""The skeleton: a spectral Reeb graph embedded in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["Skeleton"]


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A Reeb graph whose nodes are the connected components of the bands of a scalar field (METHOD §4).

    positions: area centroid of each node's component, float64, (N, 3), in the mesh's units.
    areas: area of each node's component, float64, (N,); they sum to ``area(M)``.
    ring_areas: one-ring area of each node's extremal vertex, float64, (N,) (``area="ring"``).
    bands: index of the band that each node lies in, int32, (N,), 0 at the field's minimum.
    edges: pairs of nodes that share a stretch of level curve, int32, (E, 2).
    lengths: Euclidean distance of the nodes of each edge, float64, (E,).
    endpoints: nodes of degree 1, int32, (k,), by decreasing area, ties by index.
    root: the node nearest the mesh's area centroid.
    """

    positions: npt.NDArray[np.float64]
    areas: npt.NDArray[np.float64]
    ring_areas: npt.NDArray[np.float64]
    bands: npt.NDArray[np.int32]
    edges: npt.NDArray[np.int32]
    lengths: npt.NDArray[np.float64]
    endpoints: npt.NDArray[np.int32]
    root: int

    @property
    def cycles(self) -> int:
        """First Betti number of the graph (Euler: edges - nodes + 1, as it is connected)."""
        return len(self.edges) - len(self.positions) + 1

    def __repr__(self) -> str:
        return f"Skeleton({len(self.positions)} nodes, {len(self.edges)} edges, {len(self.endpoints)} endpoints)"
