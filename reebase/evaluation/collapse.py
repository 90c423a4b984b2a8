"""Fewer vertices by collapsing edges (Garland, Heckbert, "Surface Simplification Using Quadric Error Metrics", SIGGRAPH
1997), and another tessellation of the same surface.

The idea: each vertex carries the sum of the squared distances to the planes of its faces; the edge whose two ends can
become one point at the least such cost goes first. These make the test copies that descriptors and the search for
duplicates are measured on; they are written for that, one edge at a time, and not for large meshes.
"""

from __future__ import annotations

import heapq

import numpy as np
import numpy.typing as npt

from reebase.mesh.geometry import doubled_normals, vertex_normals
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import edges, rings

__all__ = ["decimated", "remeshed"]

Array = npt.NDArray[np.float64]

LEAST_TURN = 0.2
"""Cosine between a face's normals before and after a collapse below which the collapse is refused."""

RELAXATIONS = 3


def decimated(mesh: Mesh, vertices: int) -> Mesh:
    """A mesh of about that many vertices on nearly the same surface; of more where no edge can go any more."""
    return _collapsed(mesh, vertices, None)


def remeshed(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """About as many vertices on nearly the same surface, none where one was, and none joined as before.

    Every face is quartered, short edges go in random order, and what is left is evened out along the surface.
    """
    fine = _quartered(mesh)
    return _relaxed(_collapsed(fine, len(mesh.vertices), random), RELAXATIONS)


def _quartered(mesh: Mesh) -> Mesh:
    joined = edges(mesh.faces)
    middle = mesh.vertices[joined.vertices].mean(axis=1)
    ab, bc, ca = (joined.of_side.reshape(-1, 3) + len(mesh.vertices)).T
    a, b, c = mesh.faces.T
    corners = ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))
    return Mesh(np.concatenate([mesh.vertices, middle]), np.concatenate([np.stack(one, axis=1) for one in corners]))


def _relaxed(mesh: Mesh, times: int) -> Mesh:
    """Every inner vertex towards the mean of its neighbours, but only along the surface."""
    around = rings(mesh.faces, len(mesh.vertices))
    source = np.repeat(np.arange(len(mesh.vertices)), around.degrees)
    inner = np.ones(len(mesh.vertices), dtype=bool)
    inner[around.boundary_curve[0]] = False
    positions = mesh.vertices.copy()
    for _ in range(times):
        sums = [np.bincount(source, column[around.neighbours], len(positions)) for column in positions.T]
        step = np.stack(sums, axis=1) / np.maximum(around.degrees, 1)[:, None] - positions
        normals = vertex_normals(Mesh(positions, mesh.faces), "area")
        step -= (step * normals).sum(axis=1)[:, None] * normals
        positions[inner] += 0.5 * step[inner]
    return Mesh(positions, mesh.faces)


def _collapsed(mesh: Mesh, vertices: int, random: np.random.Generator | None) -> Mesh:
    """random: short edges first, each length times a random factor, in place of cheap ones."""
    positions = mesh.vertices.copy()
    faces = [list(face) for face in mesh.faces.tolist()]
    quadrics = _quadrics(mesh)
    of_vertex: list[set[int]] = [set() for _ in positions]
    for number, face in enumerate(faces):
        for corner in face:
            of_vertex[corner].add(number)
    stamps = [0] * len(positions)
    queue: list[tuple[float, int, int, int, int]] = []

    def neighbours(vertex: int) -> set[int]:
        return {corner for number in of_vertex[vertex] for corner in faces[number]} - {vertex}

    def push(u: int, v: int) -> None:
        if random is None:
            place = _best_place(quadrics[u] + quadrics[v], positions[u], positions[v])
            cost = _cost(quadrics[u] + quadrics[v], place)
        else:
            cost = float(np.linalg.norm(positions[u] - positions[v])) * random.uniform(0.6, 1.4)
        heapq.heappush(queue, (cost, u, v, stamps[u], stamps[v]))

    for u, v in edges(mesh.faces).vertices.tolist():
        push(u, v)
    left = sum(bool(own) for own in of_vertex)
    while left > vertices and queue:
        _, u, v, stamp_u, stamp_v = heapq.heappop(queue)
        if (stamps[u], stamps[v]) != (stamp_u, stamp_v):
            continue
        between = of_vertex[u] & of_vertex[v]
        if len(neighbours(u) & neighbours(v)) != len(between) or left <= 4:
            continue  # the surface would pinch
        place = _best_place(quadrics[u] + quadrics[v], positions[u], positions[v])
        if any(_turns(faces[number], positions, (u, v), place) for number in (of_vertex[u] | of_vertex[v]) - between):
            continue
        for number in between:
            for corner in faces[number]:
                of_vertex[corner].discard(number)
        for number in of_vertex[v]:
            faces[number][faces[number].index(v)] = u
        of_vertex[u] |= of_vertex[v]
        of_vertex[v] = set()
        positions[u] = place
        quadrics[u] = quadrics[u] + quadrics[v]
        stamps[u] += 1
        stamps[v] += 1
        left -= 1
        for other in neighbours(u):
            push(min(u, other), max(u, other))
    kept = np.array(sorted(set().union(*of_vertex)))
    used = np.flatnonzero([bool(own) for own in of_vertex])
    rank = np.full(len(positions), -1)
    rank[used] = np.arange(len(used))
    return Mesh(positions[used], rank[np.array([faces[number] for number in kept])])


def _quadrics(mesh: Mesh) -> Array:
    """The sum of the squared distances to the planes of each vertex's faces, weighted by area, (m, 4, 4).

    A plane upright on each boundary edge holds the boundary in its place.
    """
    doubled = doubled_normals(mesh)
    length = np.linalg.norm(doubled, axis=1)
    unit = doubled / np.where(length > 0, length, 1.0)[:, None]
    planes = np.column_stack([unit, -(unit * mesh.vertices[mesh.faces[:, 0]]).sum(axis=1)])
    out = np.zeros((len(mesh.vertices), 4, 4))
    weighted = planes[:, :, None] * planes[:, None] * (length / 2)[:, None, None]
    for corner in mesh.faces.T:
        np.add.at(out, corner, weighted)
    joined = edges(mesh.faces)
    side = joined.sides[joined.starts[joined.boundary]]
    ends = mesh.vertices[joined.vertices[joined.boundary]]
    along = ends[:, 1] - ends[:, 0]
    upright = np.cross(along, unit[side // 3])
    size = np.linalg.norm(upright, axis=1)
    upright /= np.where(size > 0, size, 1.0)[:, None]
    walls = np.column_stack([upright, -(upright * ends[:, 0]).sum(axis=1)])
    held = walls[:, :, None] * walls[:, None] * (size**2)[:, None, None]
    for end in joined.vertices[joined.boundary].T:
        np.add.at(out, end, held)
    return out


def _best_place(quadric: Array, first: Array, second: Array) -> Array:
    """Where the quadric is least, drawn a little to the edge's middle, which decides where the surface is flat."""
    middle = (first + second) / 2
    matrix = quadric[:3, :3]
    slack = 1e-3 * float(np.trace(matrix)) + 1e-300
    return np.asarray(np.linalg.solve(matrix + slack * np.eye(3), slack * middle - quadric[:3, 3]))


def _cost(quadric: Array, place: Array) -> float:
    return float(place @ quadric[:3, :3] @ place + 2 * quadric[:3, 3] @ place + quadric[3, 3])


def _turns(face: list[int], positions: Array, moved: tuple[int, int], place: Array) -> bool:
    """Whether a face would turn over, or nearly, when one of its corners moves."""
    before = positions[face]
    after = np.array([place if corner in moved else positions[corner] for corner in face])
    one = _normal(before)
    two = _normal(after)
    return float(one @ two) < LEAST_TURN * float(np.sqrt((one @ one) * (two @ two)))


def _normal(corners: Array) -> Array:
    (ax, ay, az), (bx, by, bz) = corners[1] - corners[0], corners[2] - corners[0]
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
