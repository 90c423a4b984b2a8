"""Kernel weighted diffusion: each vertex moves to a mean of its ring under a Gaussian shaped like the ring.

Idea: the covariance of a vertex's neighbours shapes the kernel, wide along the surface and narrow across it, so that a
neighbour off the sheet counts less. Use it for strong noise on organic shapes, a few iterations; it shrinks like the
Laplacian, less with a fitting term. Source: A. Kacem, Geometric Approaches for 3D Shape Denoising and Retrieval,
(2.26)-(2.32); there five iterations, with and without the fitting term.

    c_i     = (1 / d_i) sum_{j~i} v_j
    H_i     = sum_{j~i} (v_j - c_i)(v_j - c_i)^T + ``kappa`` l^2 I,  l the mean edge length
    w_ij    = det(H_i)^(-1/2) (2 pi)^(-3/2) exp(-(v_i - v_j)^T H_i^-1 (v_i - v_j) / 2),  j ~ i or j = i       (2.29)
    v_i    <- v_i + dt (sum_j w_ij (v_j - v_i) / sum_j w_ij + lambda (v_0i - v_i)),  dt = 1 / (1 + lambda)

Rows are normalised, so the factors before the exponential cancel. kappa, printed in raw units, is taken in squared mean
edge lengths, so that the filter does not depend on the unit. lambda, ``fitting``, is 0 by default, and else that of
fitting.py with step 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reebase.denoise.filter import Filter, FloatArray, Number, Ruled, Step, Surface
from reebase.denoise.fitting import FITTING, fitted

__all__ = ["KERNEL"]

COLLAPSED = 1e-30
"""Below this many of the first mean edge lengths, the mesh is a point and H has no inverse."""


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """The step of (2.32) on this surface."""
    from reebase.denoise.kernel_diffusion_kernels import kernel_step
    from reebase.mesh.topology_kernels import mean_distance

    rings = surface.rings

    def diffusion(positions: FloatArray) -> tuple[FloatArray, float]:
        length = mean_distance(positions, rings.neighbour_starts, rings.neighbours)
        if length < COLLAPSED:
            return positions, 0.0
        return kernel_step(positions, rings.neighbour_starts, rings.neighbours, parameters["kappa"] * length**2), 1.0

    return fitted(surface, diffusion, parameters["fitting"], 1.0)


KERNEL = Filter(
    name="kernel",
    summary="moves each vertex to a mean under a Gaussian shaped like its ring (2.26)-(2.32)",
    prepare=prepare,
    parameters={
        "kappa": Number(0.45, 1e-6, 1e6, "the ridge of the covariance, in squared mean edge lengths"),
        "fitting": Ruled(FITTING.rule, FITTING.number, FITTING.meaning, ruled=False),
    },
)
