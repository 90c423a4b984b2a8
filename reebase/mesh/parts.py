"""The components of a surface by size, and where they are nearest to one another.

Files in the wild hold one thing in several parts: a body, arms that are stuck into it, screws. What joins the parts is
that they are near: ``links`` gives the places where they are nearest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reebase.errors import DegenerateMesh, NoFaces
from reebase.mesh.geometry import face_areas
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import compacted, edges

__all__ = ["Links", "Parts", "links", "parts"]

IntArray = npt.NDArray[np.int32]
Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Parts:
    """The components of a mesh by decreasing area, ties in the order of their first faces.

    labels: the part of each face, int32, (n,). areas: of each part, float64, (c,).
    """

    mesh: Mesh
    labels: IntArray
    areas: Array

    def __len__(self) -> int:
        return len(self.areas)

    @cached_property
    def _sorted(self) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
        order = np.argsort(self.labels, kind="stable")
        return order, np.concatenate([[0], np.cumsum(np.bincount(self.labels, minlength=len(self)))])

    @cached_property
    def places(self) -> npt.NDArray[np.int64]:
        """The number of each face among those of its part, (n,)."""
        order, starts = self._sorted
        places = np.empty(len(order), np.int64)
        places[order] = np.arange(len(order)) - np.repeat(starts[:-1], np.diff(starts))
        return places

    def part(self, number: int) -> tuple[Mesh, IntArray]:
        """One part, and the index of each of its vertices in the mesh, ascending; faces keep their order."""
        order, starts = self._sorted
        return compacted(self.mesh.vertices, self.mesh.faces[order[starts[number] : starts[number + 1]]])

    def largest(self, count: int) -> Parts:
        """Only the largest so many, on the same vertices."""
        if count >= len(self):
            return self
        stay = self.labels < count
        mesh = Mesh(self.mesh.vertices, self.mesh.faces[stay])
        return Parts(mesh, self.labels[stay].astype(np.int32), np.array(self.areas[:count], dtype=np.float64))


def parts(mesh: Mesh) -> Parts:
    """The components of a mesh. They are joined through edges (``Edges.components``), so that what only touches at a
    vertex is two. Raises NoFaces."""
    if len(mesh.faces) == 0:
        raise NoFaces
    count, labels = edges(mesh.faces).components
    areas = np.bincount(labels, weights=face_areas(mesh), minlength=count)
    order = np.argsort(-areas, kind="stable")
    rank = np.empty(count, np.int32)
    rank[order] = np.arange(count, dtype=np.int32)
    return Parts(mesh, np.asarray(rank[labels], dtype=np.int32), np.asarray(areas[order], dtype=np.float64))


class Links(NamedTuple):
    """Pairs of points, of two parts each, at which these are near; they join all parts to one.

    faces: of the two points, (l, 2). weights: their barycentric coordinates, (l, 2, 3). gaps: their distances, (l,), of
    which the least between two parts is right to within ``spacing``.
    """

    faces: IntArray
    weights: Array
    gaps: Array
    spacing: float

    @property
    def touch(self) -> npt.NDArray[np.bool_]:
        """Whether the points of each are so near that nothing lies between the parts there, (l,)."""
        return np.asarray(self.gaps <= TOUCHING * self.spacing)


SAMPLES = 20_000
"""Squares that the area is divided into: their side, 0.7 % of the root of the area, is how exactly gaps are known."""

FINER = 4
"""Points on the sides of faces that touch lie so many times closer: with as many cuts in eight pieces as this the
skeletons of figures have no cycle that the whole has not, with 1 about ten."""

MOST_POINTS = 120_000
"""Points beyond which those of one part that lie in one such cube count as one."""

TOUCHING = 2.0
"""Points of two parts are linked when they are less than so many spacings farther apart than the nearest two, and touch
when they are less than so many apart."""


def links(found: Parts) -> Links:
    """Where parts touch, and where those are nearest that do not: along the minimum spanning tree of their distances.

    Distances are between points spread over the faces: all vertices, and on sides and faces longer than the spacing
    points so dense that no place is much farther than it from one. Time grows with p log p log c, c parts and p points.
    Raises DegenerateMesh when there is no area, or one beyond floating point, to tell the spacing from.
    """
    from reebase.mesh.parts_kernels import spanning_tree, touching

    faces, weights, spacing = _spread(found)
    points = np.einsum("pi,pij->pj", weights, found.mesh.vertices[found.mesh.faces[faces]])
    part = found.labels[faces].astype(np.int64)
    if len(points) > MOST_POINTS:
        kept = _thinned(points, part, spacing)
        faces, weights, points, part = faces[kept], weights[kept], points[kept], part[kept]
    reach = TOUCHING * spacing
    pairs, squares = spanning_tree(points, part, len(found))
    apart = _wider(points, part, pairs[squares > reach**2], spacing)
    # Level curves may lie closer than the points: where parts touch, sides get more.
    touched = np.unique(faces[touching(points, part, reach)])
    fine = spacing / FINER
    while (more := _along(found, fine, touched)).sum() > MOST_POINTS:
        fine *= 1.3
    finer = _on_sides(more)
    faces, weights = np.concatenate([faces, finer[0]]), np.concatenate([weights, finer[1]])
    points = np.einsum("pi,pij->pj", weights, found.mesh.vertices[found.mesh.faces[faces]])
    ends = np.concatenate([pairs, *apart, touching(points, found.labels[faces].astype(np.int64), reach)])
    gaps = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    return Links(faces[ends], weights[ends], gaps, spacing)


def _wider(points: Array, part: Indices, pairs: Indices, spacing: float) -> list[Indices]:
    """Of two parts that do not touch, beside the nearest two points, (j, 2), what is hardly farther apart."""
    from scipy.spatial import cKDTree

    of_part = np.argsort(part, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(part))])
    trees: dict[int, cKDTree] = {}
    wider = []
    for ends in pairs:
        first, second = int(part[ends[0]]), int(part[ends[1]])
        few, many = sorted((first, second), key=lambda one: int(starts[one + 1] - starts[one]))
        asked, own = of_part[starts[few] : starts[few + 1]], of_part[starts[many] : starts[many + 1]]
        if many not in trees:
            trees[many] = cKDTree(points[own])
        reach = float(np.linalg.norm(points[ends[0]] - points[ends[1]])) + TOUCHING * spacing
        at = np.asarray(trees[many].query(points[asked], distance_upper_bound=reach)[1])
        near = at < len(own)
        wider.append(np.stack([asked[near], own[at[near]]], axis=1))
    return wider


def _spread(found: Parts) -> tuple[IntArray, Array, float]:
    """Points all over the faces: the face, (p,), and barycentric coordinates, (p, 3), of each; and their spacing."""
    areas = face_areas(found.mesh)
    spacing = float(np.sqrt(areas.sum() / SAMPLES))
    if not 0 < spacing**2 < np.inf:
        raise DegenerateMesh(f"The parts have an area of {areas.sum():g} in all, so that nothing is near or far.")
    while True:
        along = _along(found, spacing)
        within = np.where((along > 0).any(axis=1), np.ceil(areas / spacing**2).astype(np.int64), 0)
        if along.sum() + within.sum() <= MOST_POINTS:
            break
        spacing *= 1.3
    spread = _at_vertices(found), _on_sides(along), _inside(within)
    return np.concatenate([face for face, _ in spread]), np.concatenate([weights for _, weights in spread]), spacing


def _along(found: Parts, spacing: float, chosen: IntArray | None = None) -> Indices:
    """How many points are wanted inside each side of the faces, or of those chosen, (n, 3)."""
    faces = np.arange(len(found.labels), dtype=np.int32) if chosen is None else chosen
    corners: Array = found.mesh.vertices[found.mesh.faces[faces]]
    sides = np.sqrt(((corners[:, [1, 2, 0]] - corners) ** 2).sum(axis=2))
    counts = np.zeros((len(found.labels), 3), np.int64)
    counts[faces] = np.maximum(np.ceil(np.minimum(sides / spacing, MOST_POINTS)).astype(np.int64) - 1, 0)
    return counts


def _at_vertices(found: Parts) -> tuple[IntArray, Array]:
    """Every vertex once, as a corner of one of its faces; where parts touch at one, once for each of them."""
    key = found.mesh.faces.ravel().astype(np.int64) * len(found) + np.repeat(found.labels, 3)
    corner = np.unique(key, return_index=True)[1]
    return (corner // 3).astype(np.int32), np.eye(3)[corner % 3]


def _on_sides(counts: npt.NDArray[np.int64]) -> tuple[IntArray, Array]:
    """So many points inside each side, (n, 3), of each face, evenly."""
    side = np.repeat(np.arange(counts.size), counts.ravel())
    number = np.arange(len(side)) - np.repeat(np.cumsum(counts.ravel()) - counts.ravel(), counts.ravel())
    share = (number + 1) / (counts.ravel()[side] + 1)
    weights = np.zeros((len(side), 3))
    rows = np.arange(len(side))
    weights[rows, side % 3] = 1 - share
    weights[rows, (side + 1) % 3] = share
    return (side // 3).astype(np.int32), weights


def _inside(counts: npt.NDArray[np.int64]) -> tuple[IntArray, Array]:
    """So many points inside each face, (n,), by the additive recurrence of the plastic number, which leaves no gaps."""
    face = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(face)) - np.repeat(np.cumsum(counts) - counts, counts)
    place = (0.5 + (number[:, None] + 1) * (1 / PLASTIC, 1 / PLASTIC**2)) % 1.0
    place = np.where(place.sum(axis=1, keepdims=True) > 1, 1 - place, place)
    return face.astype(np.int32), np.column_stack([place, 1 - place.sum(axis=1)])


PLASTIC = 1.324717957244746
"""The real root of x^3 = x + 1."""


def _thinned(points: Array, part: Indices, spacing: float) -> npt.NDArray[np.int64]:
    """The first point of each part in each cube of a grid, ascending."""
    low = points.min(axis=0)
    cell = max(spacing, float(np.ptp(points, axis=0).max()) / 2**14)
    x, y, z = np.floor((points - low) / cell).astype(np.int64).T
    return np.sort(np.unique(((part * 2**15 + x) * 2**15 + y) * 2**15 + z, return_index=True)[1])
