"""The fitting term lambda (phi_0 - phi) of a diffusion, and the noise that Morozov's principle asks for.

Idea: a diffusion that is drawn back to where the vertices began does not run away from it. Morozov's principle (2.14)
chooses how strongly: the residual's variance, mean_i |phi_i - phi_0i|^2, equals that of the noise. Source: A. Kacem,
Geometric Approaches for 3D Shape Denoising and Retrieval, chapter 2.

With F the diffusion of the positions and W the largest total weight of a row of F, one explicit step of size
dt = step / (W + lambda), below the bound 1 / (W + lambda) at which a vertex would jump over the mean of its neighbours:

    phi <- phi + dt (F(phi) + lambda (phi_0 - phi))

By default lambda is, in each iteration, the least for which the residual's variance does not exceed sigma^2. It is 0
while the result is closer to the start than the noise, and from then on the variance is sigma^2.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from reebase.denoise.filter import FloatArray, Number, Ruled, Step, Surface
from reebase.mesh.geometry import normalised

__all__ = ["FITTING", "Diffusion", "fitted", "noise_level", "noise_levels"]

Diffusion = Callable[[FloatArray], tuple[FloatArray, float]]
"""From positions, (m, 3), to F, (m, 3), and W."""

FITTING = Ruled(
    "morozov", Number(0.0, 0.0, 1e6, ""),
    "lambda, the weight of the fitting term: from the noise by Morozov's principle, or a number, 0 for none",
)  # fmt: skip


def fitted(surface: Surface, diffusion: Diffusion, fitting: Any, share: float) -> Step:
    """The step of a diffusion with its fitting term. share: of the largest stable step, in (0, 1]."""
    origin = surface.positions
    used = surface.rings.degrees > 0
    allowed = noise_level(surface) ** 2 * np.count_nonzero(used) if fitting == "morozov" else 0.0

    def step(positions: FloatArray) -> FloatArray:
        moved, largest = diffusion(positions)
        if largest <= 0:
            return np.zeros_like(positions)
        residual = origin - positions
        if fitting == "morozov":
            free = share / largest * moved
            back = least_return(free - residual, share * residual - free, allowed)
            return np.asarray(free + back * (share * residual - free))
        return np.asarray(share / (largest + fitting) * (moved + fitting * residual))

    return step


def least_return(residual: FloatArray, change: FloatArray, allowed: float) -> float:
    """The least s in [0, 1] for which |residual + s change|^2 <= allowed, or the one that comes nearest to it.

    s is lambda / (W + lambda).
    """
    excess = float((residual**2).sum()) - allowed
    square = float((change**2).sum())
    if excess <= 0 or square == 0:
        return 0.0
    half = -float((residual * change).sum())
    discriminant = half * half - square * excess
    nearest = (half - math.sqrt(discriminant)) / square if discriminant > 0 else half / square
    return min(max(nearest, 0.0), 1.0)


def noise_level(surface: Surface) -> float:
    """The standard deviation of the noise along the normals, in mean edges: the robust one of ``noise_levels``."""
    return noise_levels(surface)[0]


def noise_levels(surface: Surface) -> tuple[float, float]:
    """The standard deviation of the noise along the normals, in mean edge lengths, by a median and by a mean.

    r_i = n_i . (v_i - mean_{j~i} v_j) is what stands out of the neighbours; of two neighbours the difference is taken,
    in which curvature that they share cancels, over the root of the factor by which it enlarges the variance of
    independent noise on vertices,

        (1 + 1/d_i)^2 + (1 + 1/d_j)^2 + c (1/d_i - 1/d_j)^2 + (d_i - 1 - c)/d_i^2 + (d_j - 1 - c)/d_j^2,

    with c the triangles on the edge. The first level is 1.4826 times the median magnitude over the edges; the second
    their root mean square, which is the same for Gaussian noise and larger for impulses, and where features stand out.
    """
    from reebase.denoise.laplacian_kernels import laplacian_step
    from reebase.denoise.ring_kernels import vertex_normals

    rings = surface.rings
    degrees = rings.degrees
    normals = normalised(vertex_normals(surface.positions, surface.faces, True))
    drawn = laplacian_step(surface.positions, rings.neighbour_starts, rings.neighbours, 1.0)
    offsets = (drawn * normals).sum(axis=1)
    first, second = np.repeat(np.arange(len(degrees)), degrees), rings.neighbours
    once = first < second
    if not once.any():
        return 0.0, 0.0
    first, second = first[once], second[once]
    common = np.minimum(rings.shared[once], np.minimum(degrees[first], degrees[second]) - 1)
    one, other = 1 / degrees[first], 1 / degrees[second]
    gain = (
        (1 + one) ** 2 + (1 + other) ** 2 + common * (one - other) ** 2
        + (1 - (1 + common) * one) * one + (1 - (1 + common) * other) * other
    )  # fmt: skip
    sizes = np.abs(offsets[first] - offsets[second]) / np.sqrt(gain)
    return 1.4826 * float(np.median(sizes)), math.sqrt((sizes**2).mean())
