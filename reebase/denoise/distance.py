"""Exact distances from points to the surface of a mesh.

Idea: triangles are sorted into classes by size, so that within a class the distance to a triangle's
centroid brackets the distance to the triangle. The nearest centroids of each class are tried, twice as many
as long as a farther one could still win.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.mesh.mesh import Mesh

__all__ = ["distances_to_surface"]

FloatArray = npt.NDArray[np.float64]

FIRST = 8
"""Centroids that are tried at first."""


def distances_to_surface(points: FloatArray, mesh: Mesh) -> FloatArray:
    """The distance of each point, (k, 3), to the nearest point of the mesh's surface, (k,), in its units."""
    from scipy.spatial import cKDTree

    corners = mesh.vertices[mesh.faces]
    centroids = corners.mean(axis=1)
    reach = np.sqrt(((corners - centroids[:, None]) ** 2).sum(axis=2).max(axis=1))
    size = np.ceil(np.log2(np.maximum(reach, reach.max() * 2.0**-20)))
    best = np.full(len(points), np.inf)
    for one in np.unique(size):
        chosen = np.flatnonzero(size == one)
        tree = cKDTree(centroids[chosen])
        longest = reach[chosen].max()
        open_points = np.arange(len(points))
        wanted = FIRST
        while len(open_points):
            wanted = min(wanted, len(chosen))
            near, index = tree.query(points[open_points], k=np.arange(1, wanted + 1))
            near = np.asarray(near)
            squares = square_distances(points[open_points, None], corners[chosen[np.asarray(index)]])
            best[open_points] = np.minimum(best[open_points], np.sqrt(squares.min(axis=1)))
            if wanted == len(chosen):
                break
            open_points = open_points[near[:, -1] - longest < best[open_points]]
            wanted *= 2
    return best


def square_distances(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Squared distance of each point, (..., 3), to each triangle, (..., 3, 3).

    The least of the distances to the three sides and, where the point projects into the triangle, to its
    plane.
    """
    least = np.full(corners.shape[:-2], np.inf)
    for k in range(3):
        start, side = corners[..., k, :], corners[..., (k + 1) % 3, :] - corners[..., k, :]
        square = (side**2).sum(axis=-1)
        share = ((points - start) * side).sum(axis=-1) / np.where(square > 0, square, 1.0)
        foot = start + np.clip(share, 0.0, 1.0)[..., None] * side
        least = np.minimum(least, ((points - foot) ** 2).sum(axis=-1))
    normal = np.cross(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :])
    square = (normal**2).sum(axis=-1)
    inside = square > 0
    for k in range(3):
        side = corners[..., (k + 1) % 3, :] - corners[..., k, :]
        inside = inside & ((np.cross(side, points - corners[..., k, :]) * normal).sum(axis=-1) >= 0)
    height = ((points - corners[..., 0, :]) * normal).sum(axis=-1) ** 2 / np.where(square > 0, square, 1.0)
    return np.where(inside, np.minimum(least, height), least)
