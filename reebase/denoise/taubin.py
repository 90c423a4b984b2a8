"""Taubin's smoothing: a Laplacian step that shrinks, then one that swells, so that together they pass low frequencies.

Idea: two steps of opposite sign make a filter whose gain is 1 up to a pass band and falls beyond it. Use it for organic
shapes whose volume must stay, with ten iterations or more; edges are rounded. Source: G. Taubin, A Signal Processing
Approach to Fair Surface Design, SIGGRAPH 1995.

    v_i <- v_i + lambda sum_{j~i} (v_j - v_i) / d_i,  then the same with mu
    1 / lambda + 1 / mu = ``pass_band``

The gain (1 - lambda k)(1 - mu k) is 1 at k = 0 and at k = pass_band, an eigenvalue of the Laplacian with weights 1/d.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reebase.denoise.filter import Filter, FloatArray, Number, Step, Surface

__all__ = ["TAUBIN"]


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """The pair of steps on this surface."""
    from reebase.denoise.laplacian_kernels import laplacian_step

    rings = surface.rings
    shrinking = parameters["step"]
    swelling = 1 / (parameters["pass_band"] - 1 / shrinking)

    def step(positions: FloatArray) -> FloatArray:
        begin = positions
        for share in (shrinking, swelling):
            move = laplacian_step(positions, rings.neighbour_starts, rings.neighbours, share)
            positions = positions + surface.hold(positions, move)
        return positions - begin

    return step


TAUBIN = Filter(
    name="taubin",
    summary="a step that shrinks and one that swells, which keeps low frequencies (Taubin 1995)",
    prepare=prepare,
    parameters={
        "step": Number(0.5, 0.0, 0.9, "lambda, the share of the way to the mean", above_low=True),
        "pass_band": Number(0.1, 0.0, 0.5, "the frequency up to which nothing is damped, of at most 2"),
    },
)
