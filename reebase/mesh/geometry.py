"""Lengths, areas, normals and volume of a mesh."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from reebase.errors import unknown_name
from reebase.mesh.mesh import Mesh

__all__ = ["face_areas", "face_normals", "mean_edge_length", "signed_volume", "vertex_normals"]

FloatArray = npt.NDArray[np.float64]

Weights = Literal["uniform", "area", "angle"]


def face_areas(mesh: Mesh) -> FloatArray:
    """Area of each face, (n,): half the length of the cross product of two sides; equals Heron's (1.1)."""
    return lengths(doubled_normals(mesh)) / 2


def face_normals(mesh: Mesh) -> FloatArray:
    """Unit normal of each face, (n, 3), outward of counter-clockwise corners; zero for a face without
    area."""
    return normalised(doubled_normals(mesh))


def vertex_normals(mesh: Mesh, weights: Weights = "uniform") -> FloatArray:
    """Unit normal of each vertex, (m, 3): the mean of its faces' normals, normalised (1.3).

    weights: "uniform" as in (1.3), "area", or "angle" (of the face at the vertex). Zero for an isolated
    vertex and where the normals cancel. Raises UnknownName.
    """
    doubled = doubled_normals(mesh)
    unit = normalised(doubled)
    if weights == "uniform":
        parts = np.repeat(unit[:, None], 3, axis=1)
    elif weights == "area":
        parts = np.repeat(doubled[:, None], 3, axis=1)
    elif weights == "angle":
        corners = mesh.vertices[mesh.faces]
        ahead, behind = corners[:, [1, 2, 0]] - corners, corners[:, [2, 0, 1]] - corners
        across = lengths(np.cross(ahead, behind))
        parts = np.arctan2(across, (ahead * behind).sum(axis=2))[:, :, None] * unit[:, None]
    else:
        raise unknown_name("weights", weights, ("uniform", "area", "angle"))
    corner = mesh.faces.ravel()
    sums = [np.bincount(corner, parts[:, :, axis].ravel(), len(mesh.vertices)) for axis in range(3)]
    return normalised(np.stack(sums, axis=1))


def mean_edge_length(mesh: Mesh) -> float:
    """The mean length of the edges, each counted once (1.4); 0 without faces."""
    from reebase.mesh.topology import edges

    ends = mesh.vertices[edges(mesh.faces).vertices]
    return float(lengths(ends[:, 1] - ends[:, 0]).mean()) if len(ends) else 0.0


def signed_volume(mesh: Mesh) -> float:
    """The volume that a closed, oriented mesh encloses, negative when it faces inward."""
    if len(mesh.faces) == 0:
        return 0.0
    corners = mesh.vertices[mesh.faces]
    corners = corners - corners[0, 0]  # far from the origin the terms would cancel
    crossed = np.cross(corners[:, 1], corners[:, 2])
    return float(np.einsum("ij,ij->", corners[:, 0], crossed)) / 6


def doubled_normals(mesh: Mesh) -> FloatArray:
    """Normal of each face with twice the face's area as its length, (n, 3)."""
    from reebase.mesh.topology_kernels import crossed_sides

    return np.asarray(crossed_sides(mesh.vertices, mesh.faces))


def lengths(vectors: FloatArray) -> FloatArray:
    """Euclidean length along the last axis."""
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", vectors, vectors)))


def normalised(vectors: FloatArray) -> FloatArray:
    """The vectors at length 1; zero stays zero."""
    length = lengths(vectors)[..., None]
    return np.asarray(vectors / np.where(length > 0, length, 1.0))
