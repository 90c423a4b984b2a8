"""The skeleton: a spectral Reeb graph embedded in space."""

from __future__ import annotations

import io
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

__all__ = ["Skeleton", "pack", "unpack"]


_ARRAYS = ("positions", "areas", "ring_areas", "bands", "edges", "lengths", "endpoints", "joins")


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A Reeb graph whose nodes are the connected components of the bands of a scalar field (METHOD §4).

    positions: area centroid of each node's component, float64, (N, 3), in the mesh's units.
    areas: area of each node's component, float64, (N,); they sum to ``area(M)``.
    ring_areas: one-ring area of each node's extremal vertex, float64, (N,) (``area="ring"``).
    bands: index of the band that each node lies in, int32, (N,), 0 at the field's minimum.
    edges: pairs of nodes that share a stretch of level curve, int32, (E, 2).
    lengths: Euclidean distance of the nodes of each edge, float64, (E,).
    endpoints: nodes of degree 1, int32, (k,), by decreasing area, ties by decreasing length of their edge,
        then by index.
    root: the node in the middle (``reebase.skeleton.root``); of a graph just made, nearest the area centroid.
    joins: whether an edge is no level curve, but says that two parts of the surface are near, bool, (E,).
    """

    positions: npt.NDArray[np.float64]
    areas: npt.NDArray[np.float64]
    ring_areas: npt.NDArray[np.float64]
    bands: npt.NDArray[np.int32]
    edges: npt.NDArray[np.int32]
    lengths: npt.NDArray[np.float64]
    endpoints: npt.NDArray[np.int32]
    root: int
    joins: npt.NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))

    def __post_init__(self) -> None:
        if len(self.joins) == 0:
            object.__setattr__(self, "joins", np.zeros(len(self.edges), bool))

    @classmethod
    def assembled(
        cls,
        positions: npt.NDArray[np.float64],
        areas: npt.NDArray[np.float64],
        ring_areas: npt.NDArray[np.float64],
        bands: npt.NDArray[np.int32],
        edges: npt.NDArray[np.int32],
        root: int,
        joins: npt.NDArray[np.bool_] | None = None,
    ) -> Skeleton:
        """The skeleton of these nodes and edges; lengths and endpoints follow from them."""
        edges = edges.reshape(-1, 2)
        lengths = np.linalg.norm(positions[edges[:, 1]] - positions[edges[:, 0]], axis=1)
        ends = np.flatnonzero(np.bincount(edges.ravel(), minlength=len(positions)) == 1)
        reach = np.zeros(len(positions))  # of an endpoint: the length of its only edge
        np.add.at(reach, edges.ravel(), np.repeat(lengths, 2))
        endpoints = ends[np.lexsort((ends, -reach[ends], -areas[ends]))].astype(np.int32)
        if joins is None:
            joins = np.zeros(len(edges), bool)
        return cls(positions, areas, ring_areas, bands, edges, lengths, endpoints, root, joins)

    def to_bytes(self) -> bytes:
        """The arrays as one ``.npz`` archive."""
        file = io.BytesIO()
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        np.savez_compressed(file, allow_pickle=False, root=np.int64(self.root), **arrays)
        return file.getvalue()

    @classmethod
    def from_bytes(cls, stored: bytes) -> Skeleton:
        """The inverse of ``to_bytes``; nothing is unpickled."""
        with np.load(io.BytesIO(stored), allow_pickle=False) as arrays:
            # Skeletons of before parts were joined have none.
            return cls(**{name: arrays[name] for name in _ARRAYS if name in arrays}, root=int(arrays["root"]))

    @property
    def centroid(self) -> npt.NDArray[np.float64]:
        """Area-weighted mean of the node positions, (3,): that of the surface until something is pruned."""
        mean: npt.NDArray[np.float64] = self.areas @ self.positions / self.areas.sum()
        return mean

    @property
    def degrees(self) -> npt.NDArray[np.int64]:
        """Number of edges at each node, (N,)."""
        return np.bincount(self.edges.ravel(), minlength=len(self.positions))

    @property
    def adjacency(self) -> Any:
        """The lengths of the edges, each once, a sparse matrix (N, N)."""
        from scipy.sparse import coo_array

        # An edge given twice, or in both directions, would be added up by the sparse matrix.
        edges, first = np.unique(np.sort(self.edges, axis=1).reshape(-1, 2), axis=0, return_index=True)
        count = len(self.positions)
        return coo_array((self.lengths[first], (edges[:, 0], edges[:, 1])), shape=(count, count)).tocsr()

    def path_lengths(self, sources: npt.NDArray[np.integer[Any]]) -> npt.NDArray[np.float64]:
        """delta: length of the shortest path along edges from each source to every node, (len(sources), N).

        Infinite where there is no path.
        """
        from scipy.sparse.csgraph import dijkstra

        return np.asarray(dijkstra(self.adjacency, directed=False, indices=sources), dtype=np.float64)

    @property
    def cycles(self) -> int:
        """First Betti number of the graph (Euler: edges - nodes + 1, as it is connected)."""
        return len(self.edges) - len(self.positions) + 1

    def __repr__(self) -> str:
        counts = len(self.positions), len(self.edges), len(self.endpoints)
        return "Skeleton({} nodes, {} edges, {} endpoints)".format(*counts)


def pack(skeletons: Sequence[Skeleton]) -> bytes:
    """Several skeletons in one string of bytes: of each its length (64 bits, little endian) and ``to_bytes``."""
    stored = [one.to_bytes() for one in skeletons]
    return b"".join(struct.pack("<Q", len(one)) + one for one in stored)


def unpack(stored: bytes) -> list[Skeleton]:
    """The inverse of ``pack``."""
    found, at = [], 0
    while at < len(stored):
        (length,) = struct.unpack_from("<Q", stored, at)
        at += 8
        found.append(Skeleton.from_bytes(stored[at : at + length]))
        at += length
    return found
