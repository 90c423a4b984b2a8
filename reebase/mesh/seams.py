"""Seams: boundaries of a surface that lie on each other but for rounding.

Idea: a program that writes triangles one by one, as STL has them, computes a shared corner anew for each, and the last
digits differ. The surface then falls into parts along curves that nobody can see. So vertices on the boundary, and no
others, become one where they are nearer than single precision can say, if that closes something.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.mesh.topology import Edges, edges

__all__ = ["without_seams"]

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]

NEAR = 1e-6
"""Of half the longest extent: sixteen units of rounding of a coordinate in single precision."""
LEAST_EDGES = 20
"""So many times shorter than the mean edge a gap must be, so that no feature of a fine mesh is one."""


def without_seams(vertices: FloatArray, joined: Edges, near: float, repairs: dict[str, int]) -> IntArray:
    """The faces, (n, 3), with vertices of the boundary that are within ``near`` of each other merged, or as they were.

    vertices: (m, 3), of order 1. Merged vertices are counted as ``sewn_vertices``. Nothing is done where a face would
    lose a corner, where no boundary would go, or where an edge would get more than two faces.
    """
    from reebase.mesh.topology_kernels import first_within

    faces = joined.faces
    rim = np.unique(joined.vertices[joined.boundary])
    ends = vertices[joined.vertices[joined.boundary]]
    mean = float(np.sqrt(((ends[:, 1] - ends[:, 0]) ** 2).sum(axis=1)).mean())
    near = min(near, mean / LEAST_EDGES)
    points = vertices[rim]
    first = first_within(points, np.floor(points / near).astype(np.int64), 1, near)
    moved = np.flatnonzero(first != np.arange(len(rim)))
    if len(moved) == 0:
        return faces
    target = np.arange(len(vertices), dtype=np.int32)
    target[rim[moved]] = rim[first[moved]]
    sewn = target[faces]
    a, b, c = sewn.T
    collapsed = (a == b) | (b == c) | (c == a)
    if collapsed.any():
        # Their corners stay apart: a face so small is a feature, or degenerate in a way that others look after.
        held = np.unique(faces[collapsed])
        target[held] = held
        sewn = target[faces]
    after = edges(sewn)
    if len(after.boundary) >= len(joined.boundary) or len(after.non_manifold) > len(joined.non_manifold):
        return faces
    repairs["sewn_vertices"] = repairs.get("sewn_vertices", 0) + int((target != np.arange(len(target))).sum())
    return np.asarray(sewn)
