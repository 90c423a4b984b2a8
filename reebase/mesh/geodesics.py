"""How far it is along the surface, from one vertex or from a few that are spread over it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import Rings, rings

__all__ = ["Spread", "distance_to", "farthest_points", "geodesic_distances"]

Array = npt.NDArray[np.float64]


def geodesic_distances(
    mesh: Mesh, sources: Sequence[int] | npt.NDArray[np.integer], reach: float = np.inf
) -> Array:  # fmt: skip
    """The length of a shortest way along the surface from each source to each vertex, float64, (len(sources), m).

    Infinite where no way leads, or none of at most ``reach``. In the order of Dijkstra each vertex takes the least over
    its triangles of the straight way from the source unfolded into the triangle's plane: exact on a plane, and on any
    surface as the edges become short (fast marching, Kimmel and Sethian, PNAS 95, 1998, with the update of Novotni and
    Klein, WSCG 2002). Where triangles are obtuse the way may follow edges instead, so it is never too short by more
    than what the unfolding loses to curvature. O(m log m) a source. Raises ParameterError for a source that is no
    vertex.
    """
    chosen = _as_vertices(mesh, sources)
    joined = rings(mesh.faces, len(mesh.vertices))
    out = np.empty((len(chosen), len(mesh.vertices)))
    for i, row in enumerate(out):
        _march(mesh, joined, chosen[i : i + 1], reach, row)
    return out


def distance_to(mesh: Mesh, sources: Sequence[int] | npt.NDArray[np.integer]) -> Array:
    """As ``geodesic_distances``, but to the nearest of the sources, float64, (m,); infinite without sources.

    Where the ways from two sources meet, the unfolded source is neither of them: there the length may be a fraction
    of an edge too short.
    """
    out = np.empty(len(mesh.vertices))
    _march(mesh, rings(mesh.faces, len(mesh.vertices)), np.unique(_as_vertices(mesh, sources)), np.inf, out)
    return out


class Spread(NamedTuple):
    """vertices: int64, (k,). distances: from each to every vertex, (k, m). nearest: which of them is nearest to each
    vertex, int64, (m,)."""

    vertices: npt.NDArray[np.int64]
    distances: Array
    nearest: npt.NDArray[np.int64]


def farthest_points(mesh: Mesh, count: int, reach: float = np.inf, clear: Array | None = None) -> Spread:
    """Vertices spread evenly over a connected surface: each the farthest from all before it (Gonzalez 1985).

    The first is the farthest from the mean of all vertices. Fewer where the mesh has fewer. reach: distances beyond it
    may be infinite, which takes less time. clear: how far each vertex is from something that the points shall keep
    clear of as of one another, (m,). Raises ParameterError.
    """
    if count < 1:
        raise ParameterError(f"The number of points must be at least 1; found {count}.", parameter="count")
    joined = rings(mesh.faces, len(mesh.vertices))
    vertices: list[int] = []
    distances = np.empty((min(count, len(mesh.vertices)), len(mesh.vertices)))
    least = np.full(len(mesh.vertices), np.inf) if clear is None else clear.copy()
    outward = ((mesh.vertices - mesh.vertices.mean(axis=0)) ** 2).sum(axis=1) if clear is None else clear
    farthest = int(np.argmax(outward))
    for row in distances:
        vertices.append(farthest)
        # Beyond the greatest of the least distances nothing can become less.
        _march(mesh, joined, np.array([farthest]), max(reach, float(least.max())), row)
        np.minimum(least, row, out=least)
        farthest = int(np.argmax(least))
    return Spread(np.array(vertices), distances, distances.argmin(axis=0))


def _as_vertices(mesh: Mesh, sources: Sequence[int] | npt.NDArray[np.integer]) -> npt.NDArray[np.int64]:
    chosen = np.asarray(sources, dtype=np.int64).reshape(-1)
    if len(chosen) and not 0 <= chosen.min() <= chosen.max() < len(mesh.vertices):
        raise ParameterError(
            f"Sources are vertices, 0 to {len(mesh.vertices) - 1}; found {chosen.min()} to {chosen.max()}.",
            parameter="sources",
        )
    return chosen


def _march(mesh: Mesh, joined: Rings, sources: npt.NDArray[np.int64], reach: float, out: Array) -> None:
    from reebase.mesh.geodesics_kernels import march

    march(mesh.vertices, joined.corner_starts, joined.ring, sources, reach, out)
