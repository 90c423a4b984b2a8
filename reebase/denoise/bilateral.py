"""The bilateral filter of positions: each vertex moves along its normal by what its neighbourhood stands out.

Idea: the surface round a vertex is a height over its tangent plane, and heights are averaged with weights for distance
and for likeness of height, so that a step in height stays a step. Use it for small noise where volume matters more than
in the Laplacian, three to ten iterations. Source: S. Fleishman, I. Drori and D. Cohen-Or, Bilateral Mesh Denoising,
SIGGRAPH 2003; A. Kacem, Geometric Approaches for 3D Shape Denoising and Retrieval, (1.13).

    v_i  <- v_i + n_i sum_j w_ij h_ij / sum_j w_ij,  h_ij = n_i . (v_j - v_i)
    w_ij  = exp(-|v_j - v_i|^2 / (2 sigma_c^2)) exp(-h_ij^2 / (2 sigma_s^2))

over the vertices j with |v_j - v_i| < 2 sigma_c that paths within that ball join to i, so that another sheet nearby
does not count. Printed with n_i . (v_i - v_j), the step would enlarge the noise. n_i is the mean of the face normals
(1.3), or weighted by area (``normal``). sigma_c is ``reach`` mean edge lengths; sigma_s by default the standard
deviation of h_ij in the neighbourhood. Both are at least 1e-6 mean edge lengths, and exponents are relative to the
least in the neighbourhood, so that one weight is 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reebase.denoise.filter import Choice, Filter, FloatArray, Number, Ruled, Step, Surface

__all__ = ["BILATERAL"]

FLOOR = 1e-6
"""The least sigma, in mean edge lengths: on a plane all heights are 0."""


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """The step of (1.13) on this surface."""
    from reebase.denoise.bilateral_kernels import bilateral_step
    from reebase.denoise.ring_kernels import vertex_normals
    from reebase.mesh.topology_kernels import mean_distance

    rings = surface.rings
    uniform = parameters["normal"] == "uniform"
    given = 0.0 if parameters["sigma_s"] == "deviation" else parameters["sigma_s"]

    def step(positions: FloatArray) -> FloatArray:
        length = mean_distance(positions, rings.neighbour_starts, rings.neighbours)
        return bilateral_step(
            positions, vertex_normals(positions, surface.faces, uniform), rings.neighbour_starts, rings.neighbours,
            max(parameters["reach"] * length, FLOOR), given * length, FLOOR,
        )  # fmt: skip

    return step


BILATERAL = Filter(
    name="bilateral",
    summary="moves each vertex along its normal by a bilateral mean of heights (1.13)",
    prepare=prepare,
    parameters={
        "reach": Number(1.0, 0.1, 10.0, "sigma_c in mean edge lengths"),
        "sigma_s": Ruled(
            "deviation", Number(0.3, 0.0, 1e3, "", above_low=True),
            "the width of the weight of heights: their standard deviation, or in mean edge lengths",
        ),
        "normal": Choice("uniform", ("uniform", "area"), "how face normals are weighted in that of a vertex"),
    },
)  # fmt: skip
