"""A closed, oriented triangle mesh of the zero level of a field.

Dual marching cubes (G. M. Nielson, "Dual marching cubes", IEEE Visualization 2004): one vertex for each sheet
of the surface in a cell, one quadrilateral for each grid edge that changes sign. It is the dual of a closed
surface, so it is closed and oriented by construction. Two sheets that meet along two curves of one face would
give an edge of four faces: `genus` finds that. Cells far from the surface are never sampled.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import numpy.typing as npt

from reebase.errors import ComputationError

__all__ = ["extract", "genus", "relax", "triangulate"]

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

_CORNERS = np.array([[(bits >> axis) & 1 for axis in range(3)] for bits in range(8)])
"""Corner b of a cell lies at the bits of b."""

_EDGES = [
    (corner, corner | 1 << axis, axis) for axis in range(3) for corner in range(8) if not corner >> axis & 1
]  # fmt: skip
"""The twelve edges of a cell: lower corner, upper corner, axis."""

_BLOCK = 16
"""Side of the first blocks in cells, a power of two."""

_SLACK = 1.6
"""Blocks are kept this much further from the surface than a true distance would need."""


@cache
def _sheets() -> npt.NDArray[np.int8]:
    """For each of the 256 sign patterns the sheet of each of the 12 edges, -1 where no sign changes.

    On a face with two opposite corners inside, the curve cuts off each of them: neighbours agree on that.
    """
    faces = []
    for axis in range(3):
        b, c = 1 << (axis + 1) % 3, 1 << (axis + 2) % 3
        faces += [(base, base | b, base | b | c, base | c) for base in (0, 1 << axis)]
    edge_of = {frozenset(edge[:2]): number for number, edge in enumerate(_EDGES)}
    table = np.full((256, 12), -1, dtype=np.int8)
    for pattern in range(256):
        inside = [bool(pattern >> corner & 1) for corner in range(8)]
        sheet = {edge: edge for edge, (low, high, _) in enumerate(_EDGES) if inside[low] != inside[high]}
        for face in faces:
            cycle = [edge_of[frozenset((face[i], face[(i + 1) % 4]))] for i in range(4)]
            changing = [edge for edge in cycle if edge in sheet]
            if len(changing) == 4:
                start = 0 if inside[face[1]] else 1
                changing = [cycle[(start + i) % 4] for i in range(4)]
            for first, second in zip(changing[::2], changing[1::2], strict=True):
                old, new = sheet[first], sheet[second]
                sheet = {edge: new if name == old else name for edge, name in sheet.items()}
        names = sorted(set(sheet.values()))
        for edge, name in sheet.items():
            table[pattern, edge] = names.index(name)
    return table


def extract(
    field: Callable[[Array], Array], low: Array, high: Array, spacing: Array, frame: Array, shift: Array
) -> tuple[Array, Indices]:
    """Vertices (m, 3) and quadrilaterals (q, 4), counter-clockwise from outside, of ``field`` = 0.

    The grid has steps ``spacing`` (3,) along the columns of the rotation ``frame`` (3, 3) and is moved by
    ``shift`` (3,) of a step; it covers the box from ``low`` to ``high``. ``field`` is negative inside and
    must not exceed the distance to the surface by more than half. Raises ComputationError where it does.
    """
    corners = low + _CORNERS * (high - low)
    in_grid = corners @ frame / spacing
    first = in_grid.min(axis=0) - 2 + shift
    blocks = np.ceil((in_grid.max(axis=0) + 2 - first) / _BLOCK).astype(np.int64)

    def to_world(points: Array) -> Array:
        world: Array = (points + first) * spacing @ frame.T
        return world

    cells = np.stack(np.meshgrid(*map(np.arange, blocks), indexing="ij"), axis=-1).reshape(-1, 3) * _BLOCK
    size = _BLOCK
    while size > 1:
        reach = _SLACK * size / 2 * float(np.linalg.norm(spacing))
        cells = cells[np.abs(field(to_world((cells + size / 2).astype(np.float64)))) < reach]
        size //= 2
        cells = (cells[:, None] + size * _CORNERS).reshape(-1, 3)

    strides = np.array([(blocks[1] * _BLOCK + 1) * (blocks[2] * _BLOCK + 1), blocks[2] * _BLOCK + 1, 1])
    keys, place = np.unique((cells[:, None] + _CORNERS) @ strides, return_inverse=True)
    grid_points = np.stack(
        [keys // strides[0], keys % strides[0] // strides[1], keys % strides[1]], axis=1
    )  # fmt: skip
    values = field(to_world(grid_points.astype(np.float64)))
    values[values == 0] = 1e-12
    place = place.reshape(-1, 8)
    pattern = (values[place] < 0) @ (1 << np.arange(8))
    active = (pattern > 0) & (pattern < 255)
    vertices, quads = _dual(values, keys, grid_points, place[active], pattern[active])
    return to_world(vertices), quads


def _dual(
    values: Array, keys: Indices, grid_points: Indices, place: Indices, pattern: Indices
) -> tuple[Array, Indices]:
    """Vertices and quadrilaterals of the active cells. place: their corners among the grid points, (c, 8)."""
    sheets = _sheets()[pattern]
    offset = np.concatenate([[0], np.cumsum(sheets.max(axis=1) + 1)])
    edge_keys, slots, owners, crossings, flipped = [], [], [], [], []
    for number, (low, high, axis) in enumerate(_EDGES):
        cut = np.flatnonzero(sheets[:, number] >= 0)
        start, end = place[cut, low], place[cut, high]
        share = values[start] / (values[start] - values[end])
        crossings.append(grid_points[start] + share[:, None] * (np.arange(3) == axis))
        b, c = low >> (axis + 1) % 3 & 1, low >> (axis + 2) % 3 & 1
        slots.append(np.full(len(cut), (0, 1, 3, 2)[b + 2 * c]))  # cells around the edge, counter-clockwise
        edge_keys.append(keys[start] * 3 + axis)
        owners.append(offset[cut] + sheets[cut, number])
        flipped.append(values[start] > 0)
    owner = np.concatenate(owners)
    count = int(offset[-1])
    vertices = _scatter(owner, np.concatenate(crossings), count) / np.bincount(owner)[:, None]
    edge = np.concatenate(edge_keys)
    order = np.argsort(edge * 4 + np.concatenate(slots))
    around = edge[order]
    if not len(around) or len(around) % 4 or (around[::4] != around[3::4]).any():
        raise ComputationError("The field overstates distances: a cell that the surface crosses was missed.")
    quads = owner[order].reshape(-1, 4)
    turned = np.concatenate(flipped)[order].reshape(-1, 4)[:, 0]
    quads[turned] = quads[turned, ::-1]
    return vertices, quads


def relax(field: Callable[[Array], Array], vertices: Array, quads: Indices, steps: int) -> Array:
    """Vertices moved towards their neighbours' mean within the surface, and back onto ``field`` = 0."""
    ends = np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2)
    degree = np.bincount(ends[:, 0], minlength=len(vertices))
    for step in range(steps + 1):
        across = np.cross(
            vertices[quads[:, 2]] - vertices[quads[:, 0]], vertices[quads[:, 3]] - vertices[quads[:, 1]]
        )  # fmt: skip
        normals = _scatter(quads.ravel(), np.repeat(across, 4, axis=0), len(vertices))
        normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-300)[:, None]
        if step < steps:
            pull = _scatter(ends[:, 0], vertices[ends[:, 1]], len(vertices)) / degree[:, None] - vertices
            pull -= (pull * normals).sum(axis=1)[:, None] * normals
            vertices = vertices + 0.5 * pull
        vertices = vertices - field(vertices)[:, None] * normals
    return vertices


def _scatter(index: Indices, rows: Array, count: int) -> Array:
    return np.stack([np.bincount(index, weights=column, minlength=count) for column in rows.T], axis=1)


def triangulate(vertices: Array, quads: Indices) -> Indices:
    """Two triangles for each quadrilateral, split at the shorter diagonal, (2q, 3)."""
    corner = vertices[quads]
    first = np.linalg.norm(corner[:, 2] - corner[:, 0], axis=1)
    second = np.linalg.norm(corner[:, 3] - corner[:, 1], axis=1)
    turned = np.where((first <= second)[:, None], quads, np.roll(quads, -1, axis=1))
    return turned[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)


def genus(count: int, faces: Indices) -> int | None:
    """Genus of a closed, connected, oriented manifold of ``count`` vertices; None when it is not that."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    halves = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    forward = np.sort(halves[:, 0] * count + halves[:, 1])
    backward = np.sort(halves[:, 1] * count + halves[:, 0])
    if not len(faces) or (forward[1:] == forward[:-1]).any() or (forward != backward).any():
        return None
    links = coo_array((np.ones(len(halves)), (halves[:, 0], halves[:, 1])), shape=(count, count))
    components, _ = connected_components(links, directed=False)
    if components != 1:
        return None
    return 1 - (count - len(halves) // 2 + len(faces)) // 2
