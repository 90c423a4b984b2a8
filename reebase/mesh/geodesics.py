"""How far it is along the surface, from one vertex or from a few that are spread over it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import rings

__all__ = ["Spread", "farthest_points", "geodesic_distances"]

Array = npt.NDArray[np.float64]


def geodesic_distances(mesh: Mesh, sources: Sequence[int] | npt.NDArray[np.integer]) -> Array:
    """The length of a shortest way along the surface from each source to each vertex, float64, (len(sources), m).

    Infinite where no way leads. In the order of Dijkstra each vertex takes the least over its triangles of the straight
    way from the source unfolded into the triangle's plane: exact on a plane, and on any surface as the edges become
    short (fast marching, Kimmel and Sethian, PNAS 95, 1998, with the update of Novotni and Klein, WSCG 2002). Where
    triangles are obtuse the way may follow edges instead, so it is never too short by more than what the unfolding
    loses to curvature. O(m log m) a source. Raises ParameterError for a source that is no vertex.
    """
    from reebase.mesh.geodesics_kernels import march

    chosen = np.asarray(sources, dtype=np.int64).reshape(-1)
    if len(chosen) and not 0 <= chosen.min() <= chosen.max() < len(mesh.vertices):
        raise ParameterError(
            f"Sources are vertices, 0 to {len(mesh.vertices) - 1}; found {chosen.min()} to {chosen.max()}.",
            parameter="sources",
        )
    joined = rings(mesh.faces, len(mesh.vertices))
    out = np.empty((len(chosen), len(mesh.vertices)))
    for row, source in zip(out, chosen, strict=True):
        march(mesh.vertices, joined.corner_starts, joined.ring, int(source), row)
    return out


class Spread(NamedTuple):
    """vertices: int64, (k,). distances: from each to every vertex, (k, m). nearest: which of them is nearest to each
    vertex, int64, (m,)."""

    vertices: npt.NDArray[np.int64]
    distances: Array
    nearest: npt.NDArray[np.int64]


def farthest_points(mesh: Mesh, count: int) -> Spread:
    """Vertices spread evenly over a connected surface: each the farthest from all before it (Gonzalez 1985).

    The first is the farthest from the mean of all vertices. Fewer where the mesh has fewer. Raises ParameterError.
    """
    if count < 1:
        raise ParameterError(f"The number of points must be at least 1; found {count}.", parameter="count")
    vertices = [int(np.argmax(((mesh.vertices - mesh.vertices.mean(axis=0)) ** 2).sum(axis=1)))]
    distances = [geodesic_distances(mesh, vertices)[0]]
    least = distances[0].copy()
    while len(vertices) < min(count, len(mesh.vertices)):
        vertices.append(int(np.argmax(least)))
        distances.append(geodesic_distances(mesh, vertices[-1:])[0])
        np.minimum(least, distances[-1], out=least)
    stacked = np.array(distances)
    return Spread(np.array(vertices), stacked, stacked.argmin(axis=0))
