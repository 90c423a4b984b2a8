"""What is kept of a shape to find its copies among many: numbers that moving, scaling, mirroring and another
tessellation leave as they are.

The idea: how far the surface lies from its centre, how far its points lie from one another, and how it spreads along
its axes. Nothing here sees how a limb bends the way a descriptor for retrieval must, and that is the point: a copy has
the same distances, another pose has not.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.mesh.geometry import face_areas
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import edges, largest_component

__all__ = ["NUMBERS", "PART", "points_on", "signature"]

Array = npt.NDArray[np.float64]

POINTS = 2048
PAIRED = 512
LEVELS = (np.arange(24) + 0.5) / 24

VERSION = 1
"""Raised when the same mesh would give other numbers."""

PART = 2 * len(LEVELS) + 3
"""Numbers that describe one surface."""

NUMBERS = 2 * PART
"""Numbers of a signature: the whole surface, then its largest component."""

_PLASTIC = 1.324717957244746
"""Its powers spread points evenly over a square (Roberts, "The unreasonable effectiveness of quasirandom sequences",
2018)."""


def signature(mesh: Mesh) -> Array:
    """Of a cleaned mesh, float64, (NUMBERS,).

    24 quantiles of the distance to the centre, 24 of the distance between two points, and the three standard deviations
    along the axes, all over the root mean square distance to the centre; then the same of the largest component, which
    tells several copies in one file from one.

    Raises NoFaces.
    """
    whole = _described(mesh)
    if edges(mesh.faces).components[0] == 1:
        return np.concatenate([whole, whole])
    return np.concatenate([whole, _described(largest_component(mesh)[0])])


def _described(mesh: Mesh) -> Array:
    from scipy.spatial.distance import pdist

    points = points_on(mesh, POINTS)[0]
    points = points - points.mean(axis=0)
    size = float(np.sqrt((points**2).sum(axis=1).mean())) or 1.0
    points /= size
    radii = np.quantile(np.linalg.norm(points, axis=1), LEVELS)
    between = np.quantile(pdist(points[:: POINTS // PAIRED]), LEVELS)
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(points.T @ points / len(points)), 0.0))
    return np.concatenate([radii, between, spread])


def points_on(mesh: Mesh, count: int) -> tuple[Array, npt.NDArray[np.int64]]:
    """Points spread evenly over the surface, (count, 3), and the face of each, (count,).

    Faces are taken along the longest axis of the surface, so that equal shares of the area are slices of it: the same
    surface in other triangles gives nearly the same points' distribution.
    """
    areas = face_areas(mesh)
    centroids = mesh.vertices[mesh.faces].mean(axis=1)
    centred = centroids - np.average(centroids, axis=0, weights=areas)
    axis = np.linalg.eigh((centred * areas[:, None]).T @ centred)[1][:, -1]
    order = np.argsort(centred @ axis, kind="stable")
    cumulated = np.cumsum(areas[order])
    steps = (np.arange(count) + 0.5) / count * cumulated[-1]
    face = order[np.minimum(np.searchsorted(cumulated, steps), len(order) - 1)]
    number = np.arange(1, count + 1)
    root, along = np.sqrt((number / _PLASTIC) % 1.0)[:, None], ((number / _PLASTIC**2) % 1.0)[:, None]
    a, b, c = mesh.vertices[mesh.faces[face]].transpose(1, 0, 2)
    return np.asarray((1 - root) * a + root * (1 - along) * b + root * along * c), face
