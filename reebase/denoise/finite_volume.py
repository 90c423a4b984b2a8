"""The finite-volume filter, the thesis's own: each vertex is drawn to the triangles round it along a robust
normal.

Idea: the spread of a vertex's neighbours tells the direction in which the surface is thin (the minor
eigenvector of their covariance) and how sheet-like it is there (fractional anisotropy). The vertex moves
along that direction by a weighted mean of its offsets from the centroids of its triangles; near ones count
more, and where the surface is not sheet-like, as at a tip, it moves less. Use it for Gaussian noise below
half an edge, one to three iterations: most of the gain is in the first, and after five it begins to round
features. Source: A. Kacem, Geometric Approaches for 3D Shape Denoising and Retrieval, chapter 3,
(3.1)-(3.5).

For vertex i, with a_j the area of the ring of j, t_j the triangles round i, c_j their centroids:

    mu_i    = sum_{j~i} a_j v_j / sum_{j~i} a_j                                             (3.1)
    C_i     = sum_{j~i} (v_j - mu_i)(v_j - mu_i)^T                                          (3.2)
    n_i     = minor eigenvector of C_i, its sign that of the area-weighted normal
    r_ij    = (v_i - c_j) . n_i
    sigma_i = 1.4826 median_j |r_ij - median_k r_ik|, at least 1e-6 mean edge lengths
    w_ij    = exp(-|v_i - c_j|^2 / (2 sigma_i^2)), exponents relative to the least of them  (3.3)
    FA_i    = sqrt(3/2) |C_i - tr(C_i)/3 I|_F / |C_i|_F                                     (3.4)
    v_i    <- v_i - FA_i (sum_j w_ij r_ij / sum_j w_ij) n_i                                 (3.5)

Where the smaller two eigenvalues of C_i agree to 1e-6 of its deviator's norm over sqrt(6) (two neighbours
only, or a symmetric ring) no direction is singled out, and n_i is the area-weighted normal.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reebase.denoise.filter import Choice, Filter, FloatArray, Step, Surface

__all__ = ["FINITE_VOLUME"]

FLOOR = 1e-6
"""The least sigma, in mean edge lengths: a plane has sigma 0."""


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """The step of (3.5) on this surface."""
    from reebase.denoise.finite_volume_kernels import finite_volume_step

    rings = surface.rings
    minor = parameters["normal"] == "minor_eigenvector"
    robust = parameters["scale"] == "median"

    def step(positions: FloatArray) -> FloatArray:
        return finite_volume_step(
            positions, surface.faces, rings.corner_starts, rings.ring,
            rings.neighbour_starts, rings.neighbours, rings.closed, FLOOR, minor, robust, parameters["anisotropy"],
        )  # fmt: skip

    return step


FINITE_VOLUME = Filter(
    name="finite_volume",
    summary="moves each vertex along a robust normal towards the centroids of its triangles (3.1)-(3.5)",
    prepare=prepare,
    parameters={
        "normal": Choice(
            "minor_eigenvector", ("minor_eigenvector", "area_weighted"),
            "the direction in which a vertex moves",
        ),
        "scale": Choice(
            "median", ("median", "root_mean_square"),
            "sigma: scaled median absolute deviation of r_ij, or root mean square of |v_i - c_j|",
        ),
        "anisotropy": Choice(True, (True, False), "whether the step is scaled by the fractional anisotropy"),
    },
)  # fmt: skip
