"""Faces without area whose corners are three different vertices: needles and caps.

Idea: to drop such a face tears the surface open along its sides, and a tear is a boundary to everything
after. A needle (two corners at one place to within rounding) is closed by merging them. A cap (a corner on
the opposite side) is absorbed by flipping that side into its neighbour. What allows neither is dropped.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.mesh.topology import Edges, edges

__all__ = ["without_flat_faces"]

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]

PASSES = 64
"""Rounds of flips: a row of that many caps on one side is absorbed; longer rows are dropped, not waited
for."""


def without_flat_faces(
    vertices: FloatArray, faces: IntArray, height: float, repairs: dict[str, int]
) -> IntArray:
    """The faces, (n, 3), without those whose smallest height is at most ``height``, counted in
    ``repairs``."""
    if not is_flat(vertices, faces, height).any():
        return faces
    faces = collapsed(vertices, faces, height, repairs)
    for _ in range(PASSES):
        flat = is_flat(vertices, faces, height)
        if not flat.any():
            return faces
        faces, flips = flipped(vertices, faces, flat, height)
        if flips == 0:
            break
        repairs["flipped_edges"] = repairs.get("flipped_edges", 0) + flips
    flat = is_flat(vertices, faces, height)
    repairs["removed_degenerate_faces"] = repairs.get("removed_degenerate_faces", 0) + int(flat.sum())
    return faces[~flat]


def side_lengths(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Length of side k, from corner k to corner k + 1, of each face, (n, 3)."""
    corners = vertices[faces]
    sides = corners[:, [1, 2, 0]] - corners
    return np.asarray(np.sqrt((sides**2).sum(axis=2)))


def is_flat(vertices: FloatArray, faces: IntArray, height: float) -> npt.NDArray[np.bool_]:
    """Whether each face is at most ``height`` high over its longest side, bool, (n,)."""
    from reebase.mesh.topology_kernels import triangle_measures

    area, _, longest, _ = triangle_measures(vertices, faces, np.ascontiguousarray(faces[:, 0])).T
    return np.asarray(2 * area <= height * longest)


def collapsed(vertices: FloatArray, faces: IntArray, height: float, repairs: dict[str, int]) -> IntArray:
    """The faces once the ends of every side no longer than ``height`` are one vertex, the first of them."""
    from reebase.mesh.topology_kernels import label

    lengths = side_lengths(vertices, faces)
    short = lengths <= height
    if not short.any():
        return faces
    count, labels = label(faces[short], np.roll(faces, -1, axis=1)[short], len(vertices))
    first = np.empty(count, dtype=np.int32)
    first[labels[::-1]] = np.arange(len(vertices), dtype=np.int32)[::-1]
    repairs["collapsed_edges"] = repairs.get("collapsed_edges", 0) + len(vertices) - count
    joined = first[labels[faces]]
    a, b, c = joined.T
    proper = (a != b) & (b != c) & (c != a)
    repairs["removed_degenerate_faces"] = repairs.get("removed_degenerate_faces", 0) + int((~proper).sum())
    return np.asarray(joined[proper])


def flipped(
    vertices: FloatArray, faces: IntArray, flat: npt.NDArray[np.bool_], height: float
) -> tuple[IntArray, int]:
    """The faces after one round of flips, and their number: each flat face gives its longest side to a
    neighbour.

    Done where that side has two faces, the other is not flat and takes part in no other flip of the round,
    both new faces have area and the new edge is new.
    """
    joined = edges(faces)
    caps = np.flatnonzero(flat)
    side = 3 * caps + side_lengths(vertices, faces)[caps].argmax(axis=1)
    edge = joined.of_side[side]
    paired = joined.face_counts[edge] == 2
    side, edge = side[paired], edge[paired]
    first, second = joined.sides[joined.starts[edge]], joined.sides[joined.starts[edge] + 1]
    across = np.where(first == side, second, first)
    cap, neighbour = side // 3, across // 3
    # The neighbour keeps its orientation: it runs b -> a along the side, d opposite; the cap's corner is c.
    b, a = faces[neighbour, across % 3], faces[neighbour, (across + 1) % 3]
    d, c = faces[neighbour, (across + 2) % 3], faces[cap, (side + 2) % 3]
    one, other = np.stack([c, a, d], axis=1), np.stack([c, d, b], axis=1)
    allowed = ~flat[neighbour] & ~is_flat(vertices, one, height) & ~is_flat(vertices, other, height)
    allowed &= (c != d) & ~is_edge(joined, c, d)
    for claim in (neighbour, pair_keys(c, d)):
        chosen = np.flatnonzero(allowed)
        allowed[np.delete(chosen, np.unique(claim[chosen], return_index=True)[1])] = False
    result = faces.copy()
    result[cap[allowed]], result[neighbour[allowed]] = one[allowed], other[allowed]
    return result, int(allowed.sum())


def pair_keys(first: IntArray, second: IntArray) -> npt.NDArray[np.int64]:
    """One number for each unordered pair of vertices, ordered as ``Edges.vertices`` is."""
    low, high = np.minimum(first, second), np.maximum(first, second)
    return (low.astype(np.int64) << 32) | high


def is_edge(joined: Edges, first: IntArray, second: IntArray) -> npt.NDArray[np.bool_]:
    """Whether each pair of vertices is an edge, bool."""
    known = pair_keys(joined.vertices[:, 0], joined.vertices[:, 1])
    wanted = pair_keys(first, second)
    place = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
    return np.asarray(known[place] == wanted)
