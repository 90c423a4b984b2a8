"""Diffusion on the mesh as a graph: the p-Laplacian with any weights, and its simplest case, uniform weights.

Idea: minimise sum_i |grad phi_i|^p plus a fitting term, from the positions phi_0 that came in; p = 2 diffuses evenly,
smaller p less across large differences, so that features stay. Use it where the result should stay as close to the
input as its noise level says, with as many iterations as one likes: the fitting term keeps it there. Source: A. Kacem,
Geometric Approaches for 3D Shape Denoising and Retrieval, (2.19)-(2.24), after S. Bougleux, A. Elmoataz and M. Melkemi,
Local and Nonlocal Discrete Regularization on Weighted Graphs for Image and Mesh Processing, IJCV 84 (2009).

    |grad phi_i| = sqrt(sum_{j~i} w_ij |phi_j - phi_i|^2)
    g_i          = (|grad phi_i|^2 + eps^2)^((p - 2) / 2),  eps = 1e-3 median_i |grad phi_i|
    phi_i       <- phi_i + dt (sum_{j~i} w_ij (g_i + g_j) (phi_j - phi_i) + lambda (phi_0i - phi_i))   (2.19)-(2.22)

dt = ``step`` / (max_i sum_j w_ij (g_i + g_j) + lambda); lambda is that of fitting.py, and lengths
are in mean edges, so that a given lambda does not depend on the unit. (2.6) and (2.19) together give
the weight w_ij where the print has its root: ``literal`` takes the root there.

    local     w_ij = exp(-|v_i - v_j|^2 / s^2), j ~ i, s^2 the mean of |v_i - v_j|^2 over the edges              (2.23)
    nonlocal  w_ij = exp(-|v_i - v_j|^2 / s^2 - |F_i - F_j|^2 / h^2), j within two edges of i                    (2.24)
    uniform   w_ij = 1 / d_i, p = 2

F_i describes the patch round i whatever its orientation: the mean and the root mean square of the offsets
n_i . (v_k - v_i) of the neighbours k; h^2 is the mean of |F_i - F_j|^2 over the pairs. Weights come from the positions
before each iteration.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.denoise.filter import Choice, Filter, FloatArray, Number, Step, Surface
from reebase.denoise.fitting import FITTING, fitted
from reebase.mesh.geometry import normalised

__all__ = ["GRAPH_P_LAPLACIAN", "UNIFORM"]

IntArray = npt.NDArray[np.int32]

LEAST_GRADIENT = 1e-6
"""The least eps, in mean edge lengths."""


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """The step of (2.22) on this surface."""
    from reebase.denoise.ring_kernels import diffuse, gradients, rings_within

    rings = surface.rings
    starts, neighbours = rings.neighbour_starts, rings.neighbours
    nonlocal_pairs = parameters["weights"] == "nonlocal"
    if nonlocal_pairs:
        starts, neighbours = rings_within(2, surface.positions, starts, neighbours)
    used = rings.degrees > 0
    power = parameters["p"] - 2

    def diffusion(positions: FloatArray) -> tuple[FloatArray, float]:
        features = [positions / spread(positions, rings.neighbour_starts, rings.neighbours)]
        if nonlocal_pairs:
            patch = patches(surface, positions)
            features.append(patch / spread(patch, starts, neighbours))
        weights = weights_of(np.concatenate(features, axis=1), starts, neighbours)
        gradient = gradients(positions, starts, neighbours, weights)
        least = max(1e-3 * float(np.median(gradient[used])), LEAST_GRADIENT)
        factors = (gradient**2 + least**2) ** (power / 2)
        if parameters["literal"]:
            weights = np.sqrt(weights)
        moved, totals = diffuse(positions, starts, neighbours, weights, factors)
        return moved, float(totals.max())

    return fitted(surface, diffusion, parameters["fitting"], parameters["step"])


def weights_of(features: FloatArray, starts: IntArray, neighbours: IntArray) -> FloatArray:
    """exp(-|x_j - x_i|^2) for each pair."""
    from reebase.denoise.ring_kernels import gaussian_weights

    return gaussian_weights(np.ascontiguousarray(features), starts, neighbours)


def spread(features: FloatArray, starts: IntArray, neighbours: IntArray) -> float:
    """The root mean square of |x_j - x_i| over the pairs, (m, k) features; at least 1e-6."""
    first = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    difference = features[first] - features[neighbours]
    return max(float(np.sqrt((difference**2).sum(axis=1).mean())), LEAST_GRADIENT)


def patches(surface: Surface, positions: FloatArray) -> FloatArray:
    """F: the mean and the root mean square of the neighbours' offsets along the normal, (m, 2)."""
    from reebase.denoise.ring_kernels import vertex_normals

    rings = surface.rings
    normals = normalised(vertex_normals(positions, surface.faces, True))
    first = np.repeat(np.arange(len(positions)), rings.degrees)
    offsets = ((positions[rings.neighbours] - positions[first]) * normals[first]).sum(axis=1)
    count = np.maximum(rings.degrees, 1)
    mean = np.bincount(first, offsets, len(positions)) / count
    square = np.bincount(first, offsets**2, len(positions)) / count
    return np.stack([mean, np.sqrt(square)], axis=1)


def prepare_uniform(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """The step of (2.22) with w_ij = 1 / d_i and p = 2, that is g = 1."""
    from reebase.denoise.laplacian_kernels import laplacian_step

    rings = surface.rings

    def diffusion(positions: FloatArray) -> tuple[FloatArray, float]:
        return laplacian_step(positions, rings.neighbour_starts, rings.neighbours, 2.0), 2.0

    return fitted(surface, diffusion, parameters["fitting"], parameters["step"])


STEP = Number(0.9, 0.0, 1.0, "share of the largest stable step", above_low=True)

GRAPH_P_LAPLACIAN = Filter(
    name="graph_p_laplacian",
    summary="p-Laplacian diffusion on the graph, kept near the input (2.19)-(2.24)",
    prepare=prepare,
    parameters={
        "p": Number(1.0, 0.0, 16.0, "the power of the gradient that is minimised", above_low=True),
        "weights": Choice("local", ("local", "nonlocal"), "by distance in the one-ring, or by patch in the two-ring"),
        "step": STEP,
        "fitting": FITTING,
        "literal": Choice(False, (False, True), "whether the root of the weights is taken, as printed"),
    },
)

UNIFORM = Filter(
    name="uniform",
    summary="diffusion with weights 1/d, kept near the input: uniform weighted diffusion",
    prepare=prepare_uniform,
    parameters={"step": STEP, "fitting": FITTING},
)
