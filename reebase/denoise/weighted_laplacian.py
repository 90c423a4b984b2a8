"""The weighted Laplacian filter: each vertex moves to the cotangent-weighted mean of its neighbours.

Idea: with weights cot a + cot b, of the two angles opposite an edge, the move is along the mean-curvature normal, so
that vertices hardly slide within the surface, unlike the plain Laplacian's. Use it where triangles vary in size and
their shape must stay; like the plain one it shrinks what it smooths. Source: A. Kacem, Geometric Approaches for 3D
Shape Denoising and Retrieval, (1.12):

    v_i  <- v_i + step * sum_{j~i} w_ij (v_j - v_i) / sum_{j~i} w_ij
    w_ij  = min(max(cot a_ij + cot b_ij, 0), largest)

Obtuse angles give negative weights and slivers huge ones, with which the printed step leaves the neighbours' hull or
follows a single neighbour: weights are clamped to [0, largest]. By default ``largest`` is ten times the weight 2/sqrt 3
between equilateral triangles. Weights are computed anew in each iteration; a vertex without a positive one stays.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from reebase.denoise.filter import Filter, FloatArray, Number, Step, Surface

__all__ = ["LARGEST", "WEIGHTED_LAPLACIAN"]

LARGEST = Number(20 / math.sqrt(3), 0.0, 1e6, "the largest weight of an edge", above_low=True)


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """The step of (1.12) on this surface."""
    from reebase.denoise.cotangent_kernels import cotangent_weights
    from reebase.denoise.ring_kernels import diffuse

    rings = surface.rings
    halves = np.full(len(surface.positions), 0.5)

    def step(positions: FloatArray) -> FloatArray:
        weights = cotangent_weights(
            positions, rings.corner_starts, rings.ring, rings.neighbour_starts, rings.neighbours, parameters["largest"]
        )
        moved, totals = diffuse(positions, rings.neighbour_starts, rings.neighbours, weights, halves)
        return np.asarray(parameters["step"] * moved / np.where(totals > 0, totals, 1.0)[:, None])

    return step


WEIGHTED_LAPLACIAN = Filter(
    name="weighted_laplacian",
    summary="moves each vertex to the cotangent-weighted mean of its neighbours (1.12)",
    prepare=prepare,
    parameters={
        "step": Number(1.0, 0.0, 1.0, "share of the way to the mean", above_low=True),
        "largest": LARGEST,
    },
)
