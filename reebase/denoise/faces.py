"""What the filters of face normals share: which faces are near, how far apart they are, and vertices that follow."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.denoise.filter import FloatArray, Number, Surface

__all__ = [
    "VERTEX_ITERATIONS", "centroid_distance", "faces_across", "faces_around", "followed", "later_beside",
    "pairs_around",
]  # fmt: skip

IntArray = npt.NDArray[np.int32]

VERTEX_ITERATIONS = Number(10, 1, 1000, "moves of the vertices towards the filtered normals", whole=True)


def faces_around(surface: Surface) -> tuple[IntArray, IntArray]:
    """The other faces that share a vertex with each face, in compressed rows.

    At a vertex where more than 128 triangles meet, only those that share another vertex with the face as well.
    """
    from reebase.denoise.face_kernels import around_faces
    from reebase.mesh.topology_kernels import group

    if "around" not in surface.known:
        starts, corners = group(surface.faces.ravel().copy(), len(surface.positions))
        surface.known["around"] = around_faces(surface.faces, starts, corners)
    starts, rows = surface.known["around"]
    return starts, rows


def pairs_around(surface: Surface) -> tuple[IntArray, IntArray]:
    """``faces_around`` with each pair once, in the row of the one that comes first."""
    from reebase.denoise.face_kernels import later_of

    if "pairs" not in surface.known:
        surface.known["pairs"] = later_of(*faces_around(surface))
    starts, later = surface.known["pairs"]
    return starts, later


def sides_across(surface: Surface) -> tuple[IntArray, IntArray]:
    """The two sides along each edge that has two: two arrays of sides 3f + k."""
    from reebase.denoise.face_kernels import sides_in_pairs

    if "across" not in surface.known:
        surface.known["across"] = sides_in_pairs(surface.faces, len(surface.positions))
    first, second = surface.known["across"]
    return first, second


def faces_across(surface: Surface) -> tuple[IntArray, IntArray]:
    """The two faces along each edge that has two: two arrays of faces."""
    first, second = sides_across(surface)
    return first // np.int32(3), second // np.int32(3)


def later_beside(surface: Surface) -> IntArray:
    """Across each side the other face if it comes later, else the face itself, (n, 3)."""
    first, second = sides_across(surface)
    beside = np.repeat(np.arange(len(surface.faces), dtype=np.int32), 3)
    beside[np.minimum(first, second)] = np.maximum(first, second) // np.int32(3)
    return beside.reshape(-1, 3)


def centroid_distance(centroids: FloatArray, across: tuple[IntArray, IntArray]) -> float:
    """The mean distance between the centroids of faces that share an edge; at least 1e-6, and 1 without such."""
    from reebase.denoise.face_kernels import mean_distance_across

    return max(mean_distance_across(centroids, *across), 1e-6) if len(across[0]) else 1.0


def followed(surface: Surface, positions: FloatArray, normals: FloatArray, moves: int) -> FloatArray:
    """Positions after ``moves`` times v_i <- v_i + mean over the triangles t round it of <c_t - v_i, m_t> m_t.

    normals: m_t, (n, 3). Sun et al. 2007, (10): gradient descent on how far the edges are from lying in the planes.
    """
    from reebase.denoise.face_kernels import follow_normals, followed_moves

    if not surface.held:
        return followed_moves(positions, surface.faces, normals, moves)
    for _ in range(moves):
        positions = positions + surface.hold(positions, follow_normals(positions, surface.faces, normals, False))
    return positions
