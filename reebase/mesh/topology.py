"""What is joined to what: edges, one-rings, components and boundary, from the faces alone.

Everything is built once for a list of faces and holds for every mesh with these faces, wherever its
vertices are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from reebase.errors import NoFaces
from reebase.mesh.geometry import face_areas
from reebase.mesh.mesh import Mesh

__all__ = ["Edges", "Rings", "compacted", "edges", "largest_component", "rings"]

IntArray = npt.NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class Edges:
    """The edges of a list of faces. Side 3f + k of face f runs from its corner k to its corner k + 1 (mod 3).

    faces: (n, 3). vertices: the two ends of each edge, the smaller first, sorted, int32, (E, 2). starts,
    sides: the sides along edge e are ``sides[starts[e]:starts[e + 1]]``, ascending; (E + 1,) and (3n,).
    of_side: the edge of each side, int32, (3n,). forward: whether the side runs from the smaller end, bool,
    (3n,).
    """

    faces: IntArray
    vertices: IntArray
    starts: IntArray
    sides: IntArray
    of_side: IntArray
    forward: npt.NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.vertices)

    @cached_property
    def face_counts(self) -> IntArray:
        """The number of faces along each edge, (E,): 1 on the boundary, more than 2 where not manifold."""
        return np.diff(self.starts)

    @cached_property
    def boundary(self) -> IntArray:
        """The edges with one face, ascending."""
        return np.flatnonzero(self.face_counts == 1).astype(np.int32)

    @cached_property
    def non_manifold(self) -> IntArray:
        """The edges with more than two faces, ascending."""
        return np.flatnonzero(self.face_counts > 2).astype(np.int32)

    @cached_property
    def pairs(self) -> tuple[IntArray, IntArray]:
        """The two sides of every edge with two faces: two arrays of sides."""
        first = self.starts[:-1][self.face_counts == 2]
        return self.sides[first], self.sides[first + 1]

    @cached_property
    def oriented(self) -> bool:
        """Whether the two faces along every edge with two faces run along it in opposite directions."""
        first, second = self.pairs
        return bool((self.forward[first] != self.forward[second]).all())

    @cached_property
    def balanced(self) -> npt.NDArray[np.bool_]:
        """Whether faces run along each edge as often one way as the other, bool, (E,)."""
        direction = np.where(self.forward, 1, -1)
        return np.asarray(np.bincount(self.of_side, weights=direction, minlength=len(self)) == 0)

    @cached_property
    def _chain(self) -> tuple[IntArray, IntArray]:
        """Consecutive sides along each edge, however many it has."""
        inside = np.ones(len(self.sides), dtype=bool)
        inside[self.starts[:-1]] = False
        later = np.flatnonzero(inside)
        return self.sides[later - 1], self.sides[later]

    @cached_property
    def components(self) -> tuple[int, IntArray]:
        """The number of components and the component of each face, (n,), numbered by first face.

        Two faces are in one component when a chain of faces that share edges joins them; touching at a vertex
        is not enough, as neither area nor a scalar field flows through a point.
        """
        from reebase.mesh.topology_kernels import label

        first, second = self._chain
        count, labels = label(first // np.int32(3), second // np.int32(3), len(self.faces))
        return int(count), labels

    @cached_property
    def fans(self) -> tuple[int, IntArray]:
        """The number of fans and the fan of each corner, (3n,): triangles round one vertex joined by edges.

        A vertex of a manifold has one fan. Corner 3f + k is corner k of face f.
        """
        from reebase.mesh.topology_kernels import label

        first, second = self._chain
        against = self.forward[first] != self.forward[second]
        start, end = second, following(second)
        meets_start, meets_end = np.where(against, end, start), np.where(against, start, end)
        count, labels = label(
            np.concatenate([first, following(first)]), np.concatenate([meets_start, meets_end]),
            3 * len(self.faces),
        )  # fmt: skip
        return int(count), labels

    @cached_property
    def boundary_loops(self) -> int:
        """The number of closed curves that the boundary edges form; two that touch at a vertex are two.

        Where an edge has more than two faces no unique answer exists; touching curves may then count as one.
        """
        if len(self.boundary) == 0:
            return 0
        from reebase.mesh.topology_kernels import label

        side = self.sides[self.starts[self.boundary]]
        fans = self.fans[1]
        ends = np.concatenate([fans[side], fans[following(side)]])
        nodes, compact = np.unique(ends, return_inverse=True)
        first, second = compact.astype(np.int32).reshape(2, -1)
        return int(label(first, second, len(nodes))[0])


def edges(faces: npt.ArrayLike) -> Edges:
    """The edges of triangles, (n, 3) vertex indices; linear time. Sides from a vertex to itself are edges
    too."""
    from reebase.mesh.topology_kernels import group

    triangles = np.ascontiguousarray(faces, dtype=np.int32).reshape(-1, 3)
    start = triangles.ravel()
    end = triangles[:, [1, 2, 0]].ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    count = int(high.max()) + 1 if len(high) else 0
    by_high = group(high, count)[1]
    sides = by_high[group(low[by_high], count)[1]]
    low_sorted, high_sorted = low[sides], high[sides]
    fresh = np.ones(len(sides), dtype=bool)
    fresh[1:] = (low_sorted[1:] != low_sorted[:-1]) | (high_sorted[1:] != high_sorted[:-1])
    of_side = np.empty(len(sides), dtype=np.int32)
    of_side[sides] = np.cumsum(fresh, dtype=np.int32) - np.int32(1)
    first = np.flatnonzero(fresh)
    starts = np.append(first, len(sides)).astype(np.int32)
    pairs = np.stack([low_sorted[first], high_sorted[first]], axis=1)
    return Edges(triangles, pairs, starts, sides, of_side, start <= end)


@dataclass(frozen=True, eq=False)
class Rings:
    """The triangles and the neighbours round each of m vertices, in compressed rows.

    corner_starts: (m + 1,). ring: next and previous vertex of each triangle round a vertex, int32, (3n, 2).
    neighbour_starts: (m + 1,). neighbours: each j ~ i once, int32.
    closed: whether the triangles round a vertex are those of neighbours that follow one another, the last one's by
    the first, bool, (m,), as inside an oriented manifold; elsewhere neighbours have no such order.
    """

    corner_starts: IntArray
    ring: IntArray
    neighbour_starts: IntArray
    neighbours: IntArray
    closed: npt.NDArray[np.bool_]

    @cached_property
    def degrees(self) -> IntArray:
        """The number of neighbours of each vertex, (m,); 0 for an isolated vertex."""
        return np.diff(self.neighbour_starts)

    @cached_property
    def shared(self) -> IntArray:
        """How many triangles hold the edge to each of ``neighbours``: 1 on the boundary."""
        from reebase.mesh.topology_kernels import triangles_along

        return triangles_along(self.corner_starts, self.ring, self.neighbour_starts, self.neighbours)

    @cached_property
    def boundary_curve(self) -> tuple[IntArray, IntArray]:
        """The vertices on the boundary, (b,), and their neighbours along it, (b, 2).

        Where the boundary passes a vertex more than once, or ends there, both neighbours are the vertex
        itself.
        """
        if (self.closed | (self.degrees == 0)).all():
            return np.empty(0, dtype=np.int32), np.empty((0, 2), dtype=np.int32)
        rim = np.flatnonzero(self.shared == 1)
        source = np.searchsorted(self.neighbour_starts, rim, side="right") - 1
        vertices, first, counts = np.unique(source, return_index=True, return_counts=True)
        along = np.stack([vertices, vertices], axis=1)
        simple = counts == 2
        along[simple, 0] = self.neighbours[rim[first[simple]]]
        along[simple, 1] = self.neighbours[rim[first[simple] + 1]]
        return vertices.astype(np.int32), along.astype(np.int32)


def rings(faces: npt.ArrayLike, vertex_count: int) -> Rings:
    """The one-rings of ``vertex_count`` vertices under triangles, (n, 3) vertex indices; linear time."""
    from reebase.mesh.topology_kernels import one_rings

    triangles = np.ascontiguousarray(faces, dtype=np.int32).reshape(-1, 3).view()
    triangles.flags.writeable = False  # as a mesh's faces are: the kernel is compiled once
    return Rings(*one_rings(triangles, vertex_count))


def largest_component(mesh: Mesh) -> tuple[Mesh, IntArray]:
    """The component of ``mesh`` with the largest area, ties to the one whose first face comes first.

    Returns it and the index of each of its vertices in ``mesh``, int32, ascending. Components are joined
    through edges (``Edges.components``), so a part that only touches at a vertex is left out. Raises
    NoFaces.
    """
    if len(mesh.faces) == 0:
        raise NoFaces
    count, labels = edges(mesh.faces).components
    if count == 1:
        chosen = mesh.faces
    else:
        share = np.bincount(labels, weights=face_areas(mesh), minlength=count)
        chosen = mesh.faces[labels == int(share.argmax())]
    return compacted(mesh.vertices, chosen)


def compacted(vertices: npt.NDArray[np.float64], faces: IntArray) -> tuple[Mesh, IntArray]:
    """The mesh of these faces alone, and the index of each of its vertices among those given, int32, ascending."""
    used = np.zeros(len(vertices), dtype=bool)
    used[faces.ravel()] = True
    kept = np.flatnonzero(used).astype(np.int32)
    rank = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return Mesh(vertices[kept], rank[faces]), kept


def following(sides: IntArray) -> IntArray:
    """The next side, or corner, of the same triangle."""
    return np.where(sides % 3 == 2, sides - np.int32(2), sides + np.int32(1)).astype(np.int32)
