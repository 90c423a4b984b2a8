"""Faces on the same three vertices: doubled sheets, and fins.

Idea: a face twice is one face too many, and the first is kept. One case is better served: where a mesh was
decimated, a thin part often ends as two faces back to back, joined to a closed surface along an edge. To
keep one of the two would leave a boundary and an edge with three faces; without both the surface is closed
and manifold. So such a fin goes as a whole, if it is too small for any skeleton to see.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.mesh.topology import edges

__all__ = ["without_duplicates"]

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]

SMALL = 1e-3
"""A fin has at most this share of the area; the default pruning removes branches ten times as large."""


def without_duplicates(vertices: FloatArray, faces: IntArray, repairs: dict[str, int]) -> IntArray:
    """The first of the faces, (n, 3), on each three vertices, (m, 3), without fins; counted in ``repairs``.

    A fin is a set of faces joined by edges, each present an even number of times, with SMALL of the area at
    most, that meets other faces along some edge and nowhere a single one, which would be left with
    a boundary, and not two parts that it alone joins.
    """
    from reebase.mesh.topology_kernels import group

    corners = np.sort(faces, axis=1)
    order = group(np.ascontiguousarray(corners[:, 2]), len(vertices))[1]
    for column in (1, 0):
        order = order[group(corners[order, column], len(vertices))[1]]
    ordered = corners[order]
    fresh = np.ones(len(faces), dtype=bool)
    fresh[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    if fresh.all():
        return faces
    first = order[fresh]
    times = np.diff(np.append(np.flatnonzero(fresh), len(faces)))
    ascending = np.argsort(first)
    kept, times = faces[first[ascending]], times[ascending]
    fin = is_fin(vertices, kept, times % 2 == 0)
    for name, count in (
        ("removed_duplicate_faces", int((times[~fin] - 1).sum())),
        ("removed_fin_faces", int(times[fin].sum())),
    ):
        if count:
            repairs[name] = repairs.get(name, 0) + count
    return np.asarray(kept[~fin])


def is_fin(vertices: FloatArray, faces: IntArray, doubled: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Which of the faces, all different, (n, 3), are parts of fins, bool, (n,); ``doubled``: may be."""
    fin = np.zeros(len(faces), dtype=bool)
    suspects = np.flatnonzero(doubled)
    if len(suspects) == 0:
        return fin
    joined = edges(faces)
    others = np.bincount(joined.of_side, weights=np.repeat(~doubled, 3), minlength=len(joined))
    meets = others[joined.of_side.reshape(-1, 3)[suspects]]
    count, part = edges(faces[suspects]).components
    at = vertices[faces]
    normals = np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
    areas = np.sqrt(np.einsum("ij,ij->i", normals, normals))
    small = np.bincount(part, weights=areas[suspects], minlength=count) <= SMALL * areas.sum()
    attached = np.bincount(part, weights=(meets > 1).any(axis=1), minlength=count) > 0
    needed = np.bincount(part, weights=(meets == 1).any(axis=1), minlength=count) > 0
    candidate = small & attached & ~needed
    fin[suspects] = candidate[part]
    # A fin between two parts that nothing else joins is what holds them together.
    count_left, component = edges(faces[~fin]).components
    at_edge = np.full(len(joined), -1)
    at_edge[joined.of_side.reshape(-1, 3)[~fin]] = component[:, None]
    touched = at_edge[joined.of_side.reshape(-1, 3)[suspects]]
    lowest, highest = np.full(count, count_left), np.full(count, -1)
    np.minimum.at(lowest, part, np.where(touched < 0, count_left, touched).min(axis=1))
    np.maximum.at(highest, part, touched.max(axis=1))
    fin[suspects] = (candidate & (lowest == highest))[part]
    return fin
