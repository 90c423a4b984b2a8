"""Implicit fairing: mean-curvature flow by a step that is stable at any length, the volume kept.

Idea: the cotangent Laplacian moves vertices along their normals by the mean curvature, and an implicit step solves for
where they are afterwards, so that a long time is one step and vertices hardly slide. Use it for smooth shapes with
triangles of any size; it does not keep edges. Source: M. Desbrun, M. Meyer, P. Schroeder and A. H. Barr, Implicit
Fairing of Irregular Meshes using Diffusion and Curvature Flow, SIGGRAPH 1999.

    (M + t L) v' = M v,  M_i = a third of the area of the triangles round i
    (L v)_i = sum_{j~i} w_ij (v_i - v_j) / 2,  w_ij = min(max(cot a_ij + cot b_ij, 0), ``largest``)

t is ``time`` squared mean edge lengths of the mesh at the beginning of the iteration, over which its heat spreads. With
clamped weights the matrix is positive definite on any triangles; M_i is at least 1e-6 squared mean edge lengths. The
equations are solved by conjugate gradients to a residual of 1e-13, or by factors where that takes too long. Where the
faces enclose a volume and ``keep_volume`` is set, v' is then scaled about the mean of the vertices to the volume that
it had before the step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.denoise.filter import Choice, Filter, FloatArray, Number, Step, Surface
from reebase.denoise.solving import conjugate_gradients
from reebase.denoise.weighted_laplacian import LARGEST
from reebase.mesh.geometry import face_areas, signed_volume
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import edges

__all__ = ["FAIRING"]

IntArray = npt.NDArray[np.int32]

LEAST_MASS = 1e-6
MOST_ROUNDS = 200
"""Rounds of conjugate gradients; tens are needed where ``time`` is about 1 and edges are alike."""


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """One implicit step on this surface."""
    from reebase.denoise.cotangent_kernels import cotangent_weights
    from reebase.denoise.ring_kernels import diffuse
    from reebase.mesh.topology_kernels import mean_distance

    rings = surface.rings
    starts, neighbours = rings.neighbour_starts, rings.neighbours
    used = rings.degrees > 0
    halves = np.full(len(surface.positions), 0.5)
    closed = parameters["keep_volume"] and bool(edges(surface.faces).balanced.all())

    def step(positions: FloatArray) -> FloatArray:
        mesh = Mesh(positions, surface.faces)
        areas = np.repeat(face_areas(mesh) / 3, 3)
        length = mean_distance(positions, starts, neighbours)
        mass = np.bincount(surface.faces.ravel(), areas, len(positions))
        mass = np.maximum(mass, LEAST_MASS * max(length**2, LEAST_MASS))[:, None]
        time = parameters["time"] * length**2
        weights = cotangent_weights(
            positions, rings.corner_starts, rings.ring, starts, neighbours, parameters["largest"]
        ) * (0.5 * time)
        first, totals = diffuse(positions, starts, neighbours, weights, halves)

        def matrix(vectors: FloatArray) -> FloatArray:
            return np.asarray(mass * vectors - diffuse(vectors, starts, neighbours, weights, halves)[0])

        # What is solved for is the displacement: (M + t L) d = -t L v.
        moved, solved = conjugate_gradients(matrix, first, mass + totals[:, None], MOST_ROUNDS)
        if not solved:
            moved = factorised(mass[:, 0] + totals, starts, neighbours, weights, first)
        if closed:
            before, after = signed_volume(mesh), signed_volume(Mesh(positions + moved, surface.faces))
            if before * after > 0:
                centre = (positions + moved)[used].mean(axis=0)
                moved[used] += (np.cbrt(before / after) - 1) * ((positions + moved)[used] - centre)
        return moved

    return step


def factorised(
    diagonal: FloatArray, starts: IntArray, neighbours: IntArray, weights: FloatArray, right: FloatArray
) -> FloatArray:
    """The solution of the same equations by sparse factors, (m, 3)."""
    from scipy.sparse import csr_matrix, diags_array
    from scipy.sparse.linalg import splu

    count = len(diagonal)
    away = csr_matrix((weights, neighbours, starts), shape=(count, count))
    return np.asarray(splu((diags_array(diagonal) - away).tocsc(), permc_spec="MMD_AT_PLUS_A").solve(right))


FAIRING = Filter(
    name="fairing",
    summary="mean-curvature flow by an implicit step, the volume kept (Desbrun et al. 1999)",
    prepare=prepare,
    parameters={
        "time": Number(0.5, 0.0, 1e4, "the time of the flow, in squared mean edge lengths", above_low=True),
        "largest": LARGEST,
        "keep_volume": Choice(True, (True, False), "whether closed meshes are scaled back to their volume"),
    },
)
