"""Triangles that share no vertices, as in an STL file, and the surface that they are meant to be."""

from __future__ import annotations

import numpy as np

from reebase.mesh.clean import merged
from reebase.mesh.mesh import Mesh

__all__ = ["joined_soup"]


def joined_soup(mesh: Mesh) -> Mesh:
    """The mesh with vertices at the same place made one, where no two faces share any; else the mesh.

    A filter moves each vertex by its neighbours, and triangles that share none would all be boundary. Faces keep
    their order, vertices that of their first appearance.
    """
    if len(mesh.faces) < 2 or np.bincount(mesh.faces.ravel()).max() > 1:
        return mesh
    vertices, faces = merged(mesh.vertices, mesh.vertices, mesh.faces.copy(), 0.0, {})
    return Mesh(vertices, faces)
