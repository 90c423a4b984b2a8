"""Anisotropic diffusion of vertices: neighbours count less where the surface changes fast.

Idea: a vertex moves by its differences from its neighbours, each damped where the gradient of the positions is large
beside what is usual on the mesh, as at features. Use it for moderate noise on meshes of even tessellation, with a few
iterations more than the Laplacian, which it equals when nothing is damped. Source: A. Kacem, Geometric Approaches for
3D Shape Denoising and Retrieval, (1.14)-(1.18):

    |grad v_i| = sqrt(sum_{j~i} |v_j - v_i|^2 / sqrt(d_i d_j))
    g(x)       = 1 / (1 + x^2 / c^2)
    v_i       <- v_i + step * sum_{j~i} (v_j - v_i) / sqrt(d_i d_j) * (g(|grad v_i|) + g(|grad v_j|))

By default c = 2.3849 * 1.4826 * median_i | |grad v_i| - median_k |grad v_k| |, in each iteration, at least 1e-6 mean
edge lengths; where all edges are nearly of a length that is far below the gradients, and every step is small. As
printed, differences are v_j / sqrt d_j - v_i / sqrt d_i, in gradient and step: they depend on where the origin is
unless all degrees are equal, the step is 1, which is twice the stable one, and c = 2.3849 in the mesh's units.
``literal`` runs the print, with the origin at the centroid of the vertices; ``step`` does not apply to it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from reebase.denoise.filter import Choice, Filter, FloatArray, Number, Ruled, Step, Surface

__all__ = ["ANISOTROPIC", "EFFICIENCY", "FLOOR"]

EFFICIENCY = 2.3849
"""The constant at which the estimator with weight g keeps 95 % of its efficiency on Gaussian data."""

FLOOR = 1e-6
"""The least c, in mean edge lengths: where all gradients agree their deviation is 0."""


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """The step of (1.17) on this surface."""
    from reebase.denoise.ring_kernels import diffuse, gradients

    rings = surface.rings
    used = rings.degrees > 0
    root = 1 / np.sqrt(np.maximum(rings.degrees, 1))
    source = np.repeat(root, rings.degrees)
    weights = source * root[rings.neighbours]

    def damping(gradient: FloatArray, otherwise: float | None) -> FloatArray:
        if otherwise is None:
            usual = gradient[used]
            deviation = np.median(np.abs(usual - np.median(usual)))
            otherwise = max(EFFICIENCY * 1.4826 * float(deviation), FLOOR)
        with np.errstate(over="ignore", divide="ignore"):
            return np.asarray(1 / (1 + (gradient / otherwise) ** 2))

    given = None if parameters["c"] == "deviation" else parameters["c"]

    def step(positions: FloatArray) -> FloatArray:
        gradient = gradients(positions, rings.neighbour_starts, rings.neighbours, weights)
        factors = damping(gradient, given)
        moved, _ = diffuse(positions, rings.neighbour_starts, rings.neighbours, weights, factors)
        return np.asarray(parameters["step"] * moved)

    def literal(positions: FloatArray) -> FloatArray:
        scaled = (positions - positions[used].mean(axis=0)) * root[:, None]
        gradient = gradients(scaled, rings.neighbour_starts, rings.neighbours, np.ones_like(weights))
        factors = damping(gradient, EFFICIENCY / surface.unit if given is None else given)
        return diffuse(scaled, rings.neighbour_starts, rings.neighbours, source, factors)[0]

    return literal if parameters["literal"] else step


ANISOTROPIC = Filter(
    name="anisotropic",
    summary="diffuses vertices, less across large differences (1.14)-(1.18)",
    prepare=prepare,
    parameters={
        "step": Number(0.25, 0.0, 0.5, "the time step; the total weight is at most about 2", above_low=True),
        "c": Ruled(
            "deviation", Number(1.0, 0.0, 1e6, "", above_low=True),
            "the gradient that is damped by half: from its median absolute deviation, or in mean edge lengths",
        ),
        "literal": Choice(False, (False, True), "whether the equation runs as printed"),
    },
)  # fmt: skip
