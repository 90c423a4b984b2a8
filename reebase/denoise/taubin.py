"""Taubin's smoothing: a Laplacian step that shrinks, then one that swells, so that together they pass low frequencies.

Idea: two steps of opposite sign make a filter whose gain is 1 up to a pass band and falls beyond it. Use it for organic
shapes whose volume must stay, with ten iterations or more; edges are rounded. Source: G. Taubin, A Signal Processing
Approach to Fair Surface Design, SIGGRAPH 1995.

    v_i <- v_i + lambda sum_{j~i} (v_j - v_i) / d_i,  then the same with mu
    1 / lambda + 1 / mu = ``pass_band``

With ``along`` "normals" every step keeps of its move d the part n n . d, with n the normals after two steps of one
half: nothing slides within the surface.

The gain (1 - lambda k)(1 - mu k) is 1 at k = 0 and at k = pass_band, an eigenvalue of the Laplacian with weights 1/d.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from reebase.denoise.filter import Choice, Filter, FloatArray, Number, Step, Surface, stepped
from reebase.mesh.geometry import normalised

__all__ = ["TAUBIN"]


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """The pair of steps on this surface."""
    from reebase.denoise.laplacian_kernels import laplacian_step

    rings = surface.rings
    normals = first_normals(surface) if parameters["along"] == "normals" else None

    def step(positions: FloatArray) -> FloatArray:
        begin = positions
        for share in pair(parameters):
            move = laplacian_step(positions, rings.neighbour_starts, rings.neighbours, share)
            if normals is not None:
                move = (move * normals).sum(axis=1)[:, None] * normals
            positions = positions + surface.hold(positions, move)
        return positions - begin

    return step


def run(surface: Surface, parameters: Mapping[str, Any], iterations: int) -> FloatArray:
    """All pairs of steps, in one go where they may move along anything and no boundary holds any."""
    from reebase.denoise.laplacian_kernels import laplacian_steps

    if surface.held or parameters["along"] == "normals":
        return stepped(surface, prepare(surface, parameters), iterations)
    return laplacian_steps(
        surface.positions, surface.rings.neighbour_starts, surface.rings.neighbours,
        np.tile(pair(parameters), iterations),
    )  # fmt: skip


def pair(parameters: Mapping[str, Any]) -> tuple[float, float]:
    """lambda and mu."""
    return parameters["step"], 1 / (parameters["pass_band"] - 1 / parameters["step"])


def first_normals(surface: Surface) -> FloatArray:
    """The unit mean of the normals round each vertex (1.3), (m, 3), after two steps of one half."""
    from reebase.denoise.laplacian_kernels import laplacian_step
    from reebase.denoise.ring_kernels import vertex_normals

    positions = surface.positions
    for _ in range(2):
        positions = positions + laplacian_step(
            positions, surface.rings.neighbour_starts, surface.rings.neighbours, 0.5
        )
    return normalised(vertex_normals(positions, surface.faces, True))


TAUBIN = Filter(
    name="taubin",
    summary="a step that shrinks and one that swells, which keeps low frequencies (Taubin 1995)",
    prepare=prepare,
    run=run,
    parameters={
        "step": Number(0.5, 0.0, 0.9, "lambda, the share of the way to the mean", above_low=True),
        "pass_band": Number(0.1, 0.0, 0.5, "the frequency up to which nothing is damped, of at most 2"),
        "along": Choice("anything", ("anything", "normals"), "what vertices move along: the normals keep them apart"),
    },
)
