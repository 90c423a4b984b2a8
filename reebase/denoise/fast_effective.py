"""Fast and effective feature-preserving denoising: faces average the normals round them above a threshold of likeness.

Idea: a neighbour's normal counts by the square of what its cosine exceeds a threshold by, so that those beyond an edge
do not count at all, without an exponential. Use it as the cheapest filter that keeps edges, for moderate noise on any
shape; the default is one round of five passes over the normals. Source: X. Sun, P. L. Rosin, R. R. Martin and F. C.
Langbein, Fast and Effective Feature-Preserving Mesh Denoising, IEEE TVCG 13 (2007).

    n_t <- normalised sum_s max(0, n_s . n_t - ``threshold``)^2 n_s

over t and the faces s that share a vertex with it, ``normal_iterations`` times. Then ``vertex_iterations`` times, over
the triangles t round a vertex, with c_t their centroids:

    v_i <- v_i + mean_t <c_t - v_i, n_t> n_t
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reebase.denoise.faces import VERTEX_ITERATIONS, faces_around, followed
from reebase.denoise.filter import Filter, FloatArray, Number, Step, Surface

__all__ = ["FAST_EFFECTIVE"]


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """One round over normals and vertices on this surface."""
    from reebase.denoise.face_kernels import face_geometry, normals_above

    starts, rows = faces_around(surface)

    def step(positions: FloatArray) -> FloatArray:
        normals, _, _ = face_geometry(positions, surface.faces)
        for _ in range(parameters["normal_iterations"]):
            normals = normals_above(normals, starts, rows, parameters["threshold"])
        return followed(surface, positions, normals, parameters["vertex_iterations"]) - positions

    return step


FAST_EFFECTIVE = Filter(
    name="fast_effective",
    summary="averages normals above a threshold of likeness, and lets vertices follow (Sun et al. 2007)",
    prepare=prepare,
    parameters={
        "threshold": Number(0.1, 0.0, 0.999, "the cosine of two normals from which they count"),
        "normal_iterations": Number(5, 1, 1000, "passes over the normals", whole=True),
        "vertex_iterations": VERTEX_ITERATIONS,
    },
)
