"""The Laplacian filter: each vertex moves to the mean of its neighbours.

Idea: the oldest filter and the measure for all others. It removes noise of any kind quickly and shrinks
what it smooths; use it with few iterations, or a small step, where volume does not matter. Source: A.
Kacem, Geometric Approaches for 3D Shape Denoising and Retrieval, (1.8):

    v_i <- v_i + step * sum_{j~i} (v_j - v_i) / d_i
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from reebase.denoise.filter import Filter, FloatArray, Number, Step, Surface, stepped

__all__ = ["LAPLACIAN"]


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """The step of (1.8) on this surface."""
    from reebase.denoise.laplacian_kernels import laplacian_step

    rings = surface.rings

    def step(positions: FloatArray) -> FloatArray:
        return laplacian_step(positions, rings.neighbour_starts, rings.neighbours, parameters["step"])

    return step


def run(surface: Surface, parameters: Mapping[str, Any], iterations: int) -> FloatArray:
    """All steps in one go, where no boundary holds any."""
    from reebase.denoise.laplacian_kernels import laplacian_steps

    if surface.held:
        return stepped(surface, prepare(surface, parameters), iterations)
    shares = np.full(iterations, parameters["step"])
    return laplacian_steps(surface.positions, surface.rings.neighbour_starts, surface.rings.neighbours, shares)


LAPLACIAN = Filter(
    name="laplacian",
    summary="moves each vertex to the mean of its neighbours (1.8)",
    prepare=prepare,
    parameters={"step": Number(1.0, 0.0, 1.0, "share of the way to the mean", above_low=True)},
    run=run,
)
