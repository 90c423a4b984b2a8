"""Polygons to triangles: convex ones as fans, all others by clipping ears in the polygon's plane.

Every polygon of s corners gives s - 2 triangles, in the file's order, so that counts are known before
anything is allocated. Corners in the middle of a straight side are never cut off as triangles without
area: cleaning would remove these and leave a crack to the neighbour that uses the corner.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.errors import FaceIndexOutOfRange, NoFaces, UnsupportedFeature
from reebase.mesh.mesh import Mesh, refuse_non_finite
from reebase.mesh.read.limits import Limits
from reebase.words import counted

__all__ = ["build", "strips", "triangulate"]

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]

STRAIGHT = 1e-6
"""Sine of the angle below which a corner counts as straight: float32 coordinates are not finer."""
MOST_CORNERS = 10_000
"""Clipping ears is quadratic; a concave polygon of this size takes some seconds at worst."""
TOUCHING = 1e-7
"""Distance over the polygon's extent below which a corner touches a cut: it would end up on a side."""
FEW_CORNERS = 48
"""Below this many corners to test, a Python loop beats a call into numpy."""

Point = tuple[float, float]


def build(
    vertices: npt.NDArray[Any],
    corners: npt.NDArray[Any],
    sizes: npt.NDArray[Any],
    limits: Limits,
    *,
    base: int = 0,
) -> Mesh:
    """The mesh of polygons: ``corners`` are the vertex indices of all polygons in a row, ``sizes`` how
    many belong to each. Polygons of fewer than three corners are lines and points, and are left out.
    ``base`` is the number that the format gives to the first vertex, for messages.

    Raises NonFiniteVertices, FaceIndexOutOfRange, NoFaces, LimitError, UnsupportedFeature.
    """
    vertices = np.ascontiguousarray(vertices, dtype=np.float64).reshape(-1, 3)
    limits.check_vertices(len(vertices))
    limits.check_faces(int(np.maximum(sizes - 2, 0).sum()))
    if not len(sizes) or int(sizes.max()) < 3:
        raise NoFaces()
    corners = corners.astype(np.int64, copy=False)
    if len(corners) and (corners.min() < 0 or corners.max() >= len(vertices)):
        at = int(np.flatnonzero((corners < 0) | (corners >= len(vertices)))[0])
        face = int(np.searchsorted(np.cumsum(sizes), at, side="right"))
        raise FaceIndexOutOfRange(
            f"Face {face + base} refers to vertex {int(corners[at]) + base}, but there are only "
            f"{counted(len(vertices), 'vertex')} (faces and vertices are counted from {base}).",
            face=face + base, vertex=int(corners[at]) + base, vertices=len(vertices),
        )  # fmt: skip
    refuse_non_finite(vertices, corners)
    faces = triangulate(vertices, corners, sizes.astype(np.int64, copy=False))
    return Mesh(vertices, faces.astype(np.int32))


def triangulate(vertices: Floats, corners: Ints, sizes: Ints) -> Ints:
    """Triangles (n, 3) of polygons given as in ``build``, all indices valid and all vertices finite."""
    if (sizes == 3).all():
        return corners.reshape(-1, 3)
    counts = np.maximum(sizes - 2, 0)
    first_corner = np.cumsum(sizes) - sizes
    first_face = np.cumsum(counts) - counts
    faces = np.empty((int(counts.sum()), 3), dtype=np.int64)
    with np.errstate(all="ignore"):
        for size in np.unique(sizes[sizes >= 3]).tolist():
            chosen = np.flatnonzero(sizes == size)
            polygons = corners[first_corner[chosen, None] + np.arange(size)]
            local = _same_size(vertices, polygons)
            rows = first_face[chosen, None] + np.arange(size - 2)
            faces[rows] = np.take_along_axis(polygons[:, None, :], local, axis=2)
    return faces


def strips(indices: Ints, restart: int | None = None) -> Ints:
    """Triangles (n, 3) of a triangle strip; every second one is turned so that all keep one orientation.

    ``restart`` is the index that ends one strip and starts the next. Triangles that repeat a corner only
    link two strips and are left out.
    """
    if len(indices) < 3:
        return np.zeros((0, 3), dtype=np.int64)
    place = np.arange(len(indices))
    cut = np.zeros(len(indices), dtype=bool) if restart is None else indices == restart
    within = place - np.maximum.accumulate(np.where(cut, place + 1, 0))  # the place in its own strip
    faces = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
    turned = within[:-2] % 2 == 1
    faces[turned] = faces[turned, ::-1]
    faces = faces[~(cut[:-2] | cut[1:-1] | cut[2:])]
    linking = (faces[:, 0] == faces[:, 1]) | (faces[:, 1] == faces[:, 2]) | (faces[:, 0] == faces[:, 2])
    kept: Ints = faces[~linking]
    return kept


def _same_size(vertices: Floats, polygons: Ints) -> Ints:
    """Triangles in local corner numbers, shape (k, s - 2, 3), for k polygons of s corners each."""
    count, size = polygons.shape
    fan = np.stack([np.zeros(size - 2, np.int64), np.arange(1, size - 1), np.arange(2, size)], axis=1)
    local = np.broadcast_to(fan, (count, size - 2, 3)).copy()
    if size == 3:
        return local
    points = vertices[polygons]
    points = points - points[:, :1]
    normal = np.cross(points, np.roll(points, -1, axis=1)).sum(axis=1)  # Newell's, twice the area
    length = np.linalg.norm(normal, axis=1)
    flat = np.flatnonzero(length > 0)
    unit = normal[flat] / length[flat, None]
    points = points[flat]
    out = np.roll(points, -1, axis=1) - points
    into = np.roll(out, 1, axis=1)
    turn = np.einsum("kij,kj->ki", np.cross(into, out), unit)
    along = np.einsum("kij,kij->ki", into, out)
    scale = np.linalg.norm(into, axis=2) * np.linalg.norm(out, axis=2)
    # A star polygon turns left at every corner, but more than once around.
    once = np.arctan2(turn, along).sum(axis=1) < 3 * np.pi
    sharp = turn > STRAIGHT * scale
    hard = ~(sharp.all(axis=1) & once)
    if size == 4:
        # A quad with one corner that is not convex is a fan around it.
        darts = np.flatnonzero(hard & ((~sharp).sum(axis=1) == 1))
        local[flat[darts]] = (fan + (~sharp[darts]).argmax(axis=1)[:, None, None]) % 4
        hard[darts] = False
    hard = np.flatnonzero(hard)
    if not len(hard):
        return local
    if size > MOST_CORNERS:
        raise UnsupportedFeature(
            f"A polygon has {size:,} corners and is not convex; Reebase triangulates such polygons up to "
            f"{MOST_CORNERS:,} corners. Triangulate the mesh before sending it.",
            corners=size, limit=MOST_CORNERS,
        )  # fmt: skip
    first = points[hard, 1:] - points[hard, :1]
    # Any direction in the plane: the longest of the chords from corner 0 is never of length zero.
    longest = np.linalg.norm(first, axis=2).argmax(axis=1)
    across = first[np.arange(len(hard)), longest]
    across -= np.einsum("kj,kj->k", across, unit[hard])[:, None] * unit[hard]
    across /= np.linalg.norm(across, axis=1)[:, None]
    up = np.cross(unit[hard], across)
    plane = np.stack(
        [np.einsum("kij,kj->ki", points[hard], across), np.einsum("kij,kj->ki", points[hard], up)], axis=2
    )
    for row, polygon in zip(flat[hard].tolist(), plane, strict=True):
        local[row] = clip_ears(polygon)
    return local


def clip_ears(polygon: Floats) -> list[tuple[int, int, int]]:
    """Triangles of one simple polygon in the plane, shape (s, 2), counter-clockwise.

    Where no ear is left (the polygon crosses itself) the corner that turns most is cut all the same, so
    that the number of triangles is always s - 2.
    """
    size = len(polygon)
    points: list[Point] = [(x, y) for x, y in polygon.tolist()]
    near = TOUCHING * float(np.ptp(polygon, axis=0).max())
    before = [(i - 1) % size for i in range(size)]
    after = [(i + 1) % size for i in range(size)]

    def sharp(i: int) -> bool:
        a, b, c = points[before[i]], points[i], points[after[i]]
        ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - b[0], c[1] - b[1]
        turn = ux * vy - uy * vx
        return turn > 0 and turn * turn > STRAIGHT**2 * (ux * ux + uy * uy) * (vx * vx + vy * vy)

    blunt = {i for i in range(size) if not sharp(i)}
    # The same set for numpy: corners that are in no one's way are NaN, which lies inside nothing.
    obstacles = np.full_like(polygon, np.nan)
    obstacles[list(blunt)] = polygon[list(blunt)]

    def ear(i: int) -> bool:
        if i in blunt:
            return False
        a, b, c = points[before[i]], points[i], points[after[i]]
        if len(blunt) > FEW_CORNERS:
            return not _any_inside(obstacles, a, b, c, near)
        return not any(_inside(points[j], a, b, c, near) for j in blunt)

    ears = {i for i in range(size) if ear(i)}
    # The corners by how far they turn, the widest first, made when ears run out; those that are cut or have new
    # neighbours stand in it with numbers of old, and are passed over.
    widest: list[tuple[float, int, int, int]] = []
    triangles: list[tuple[int, int, int]] = []
    here, left = 0, size
    while left > 3:
        if not ears:
            if not widest:
                widest = [_turn(points, before, after, i) for i in _around(after, here)]
                heapq.heapify(widest)
            while True:
                _, here, behind, ahead = heapq.heappop(widest)
                if here != before[here] and (behind, ahead) == (before[here], after[here]):
                    break
        while ears and here not in ears:
            here = after[here]
        behind, ahead = before[here], after[here]
        triangles.append((behind, here, ahead))
        after[behind], before[ahead] = ahead, behind
        before[here] = here
        left -= 1
        ears.discard(here)
        for i in (here, behind, ahead):
            if i == here or sharp(i):
                blunt.discard(i)
                obstacles[i] = np.nan
            else:
                blunt.add(i)
                obstacles[i] = polygon[i]
        for i in (behind, ahead):
            (ears.add if ear(i) else ears.discard)(i)
            if widest:
                heapq.heappush(widest, _turn(points, before, after, i))
        # Passing over the neighbour keeps the triangles from all meeting in one corner.
        here = after[ahead]
    triangles.append((before[here], here, after[here]))
    return triangles


def _inside(p: Point, a: Point, b: Point, c: Point, near: float) -> bool:
    """Whether p lies in the triangle or so near to it, and is none of its corners (bridges repeat them)."""
    if p in (a, b, c):
        return False
    for s, t in ((a, b), (b, c), (c, a)):
        x, y = t[0] - s[0], t[1] - s[1]
        if x * (p[1] - s[1]) - y * (p[0] - s[0]) < -near * (abs(x) + abs(y)):
            return False
    return True


def _any_inside(points: Floats, a: Point, b: Point, c: Point, near: float) -> bool:
    x, y = points[:, 0], points[:, 1]
    inside = np.ones(len(points), dtype=bool)
    for p, q in ((a, b), (b, c), (c, a)):
        u, v = q[0] - p[0], q[1] - p[1]
        inside &= u * (y - p[1]) - v * (x - p[0]) >= -near * (abs(u) + abs(v))
    for p in (a, b, c):
        inside &= (x != p[0]) | (y != p[1])
    return bool(inside.any())


def _turn(points: list[Point], before: list[int], after: list[int], i: int) -> tuple[float, int, int, int]:
    """(minus twice the area that cutting the corner adds, the corner, its neighbours)."""
    a, b, c = points[before[i]], points[i], points[after[i]]
    turn = (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
    return -turn, i, before[i], after[i]


def _around(after: list[int], start: int) -> Iterator[int]:
    """The corners that are left, from one of them on."""
    yield start
    i = after[start]
    while i != start:
        yield i
        i = after[i]
