"""Multiscale anisotropic Laplacian: smoothing along the normal that spares what is rough at every scale.

Idea: where normals over growing rings keep changing there is a feature; where they change over the smallest ring and
then settle there is noise. Use it for noisy shapes with features that a Laplacian would round, in a few iterations; it
moves vertices along their normals only. Source: the multiscale anisotropic Laplacian that A. Kacem, Geometric
Approaches for 3D Shape Denoising and Retrieval, chapter 3, compares with ([56] there).

    N_i^k  = the normalised sum of A n over the vertices within k edges of i, A n of a vertex being the sum of its
             triangles' normals, each times its area; N_i^0 is that of i alone
    rho_i  = min_{1 <= k <= ``scales``} |N_i^k - N_i^(k-1)|, the roughness that persists over the scales
    g_i    = 1 / (1 + rho_i^2 / c^2), c = 2.3849 * 1.4826 * median_i rho_i
    L_i    = sum_{j~i} w_ij (v_j - v_i), w_ij = (g_i + g_j) / (2 d_i)
    v_i   <- v_i + ``step`` (L_i . N_i^0) N_i^0

g is 1, the full step, where the roughness does not persist.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from reebase.denoise.anisotropic import EFFICIENCY
from reebase.denoise.filter import Choice, Filter, FloatArray, Number, Ruled, Step, Surface
from reebase.mesh.geometry import lengths, normalised

__all__ = ["MULTISCALE_ANISOTROPIC"]

FLOOR = 1e-6
"""The least c, a difference of unit normals: a plane has none."""


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """The step along the normals on this surface."""
    from reebase.denoise.ring_kernels import diffuse, rings_within, sums_round, vertex_normals

    rings = surface.rings
    used = rings.degrees > 0
    weights = np.repeat(0.5 / np.maximum(rings.degrees, 1), rings.degrees)
    wider = [
        rings_within(hops, surface.positions, rings.neighbour_starts, rings.neighbours)
        for hops in range(1, parameters["scales"] + 1)
    ]

    def step(positions: FloatArray) -> FloatArray:
        sums = vertex_normals(positions, surface.faces, False)
        normals = normalised(sums)
        rough, before = np.full(len(positions), np.inf), normals
        for starts, rows in wider:
            after = normalised(sums_round(sums, starts, rows))
            rough = np.minimum(rough, lengths(after - before))
            before = after
        c = parameters["c"]
        if c == "median":
            c = EFFICIENCY * 1.4826 * float(np.median(rough[used]))
        factors = 1 / (1 + (rough / max(c, FLOOR)) ** 2)
        moved, _ = diffuse(positions, rings.neighbour_starts, rings.neighbours, weights, factors)
        along = (moved * normals).sum(axis=1, keepdims=True)
        return np.asarray(parameters["step"] * along * normals)

    return step


MULTISCALE_ANISOTROPIC = Filter(
    name="multiscale_anisotropic",
    summary="moves each vertex along its normal, less where roughness persists over scales",
    prepare=prepare,
    parameters={
        "step": Number(1.0, 0.0, 1.0, "share of the way to the weighted mean", above_low=True),
        "scales": Choice(2, (1, 2, 3, 4), "the number of growing rings that are compared"),
        "c": Ruled(
            "median", Number(0.1, 0.0, 1e6, "", above_low=True),
            "the roughness at which the step is halved: from its median, or a difference of unit normals",
        ),
    },
)  # fmt: skip
