"""Bilateral filtering of normals, local scheme: faces average the normals round them that are like their own.

Idea: noise turns normals at random while a feature turns them alike, so weights for distance and for likeness of normal
smooth each side of an edge by itself; vertices then follow the normals. Use it for shapes with and without edges at
noise below a third of an edge; the default is one round of five passes over the normals. Source: Y. Zheng, H. Fu,
O. K.-C. Au and C.-L. Tai, Bilateral Normal Filtering for Mesh Denoising, IEEE TVCG 17 (2011).

    n_t <- normalised sum_s A_s exp(-|c_s - c_t|^2 / 2 sigma_c^2) exp(-|n_s - n_t|^2 / 2 sigma_s^2) n_s

over the faces s that share a vertex with t, ``normal_iterations`` times with the areas A and centroids c of the mesh at
the beginning of the iteration; sigma_c is ``reach`` times the mean distance between centroids across an edge. Then, by
X. Sun et al. 2007, ``vertex_iterations`` times, over the triangles t round a vertex:

    v_i <- v_i + mean_t <c_t - v_i, n_t> n_t
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reebase.denoise.faces import VERTEX_ITERATIONS, centroid_distance, faces_across, followed, pairs_around
from reebase.denoise.filter import Filter, FloatArray, Number, Step, Surface

__all__ = ["BILATERAL_NORMAL"]


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """One round over normals and vertices on this surface."""
    from reebase.denoise.face_kernels import bilateral_normals, face_geometry

    starts, later = pairs_around(surface)
    across = faces_across(surface)

    def step(positions: FloatArray) -> FloatArray:
        normals, areas, centroids = face_geometry(positions, surface.faces)
        sigma_c = parameters["reach"] * centroid_distance(centroids, across)
        for _ in range(parameters["normal_iterations"]):
            normals = bilateral_normals(
                normals, normals, areas, centroids, starts, later, sigma_c, parameters["sigma_s"]
            )
        return followed(surface, positions, normals, parameters["vertex_iterations"]) - positions

    return step


BILATERAL_NORMAL = Filter(
    name="bilateral_normal",
    summary="averages normals that are near and alike, and lets vertices follow (Zheng et al. 2011)",
    prepare=prepare,
    parameters={
        "sigma_s": Number(0.6, 0.01, 10.0, "the difference of unit normals at which they count as unlike"),
        "reach": Number(1.0, 0.1, 10.0, "sigma_c over the mean distance between neighbouring centroids"),
        "normal_iterations": Number(5, 1, 1000, "passes over the normals", whole=True),
        "vertex_iterations": VERTEX_ITERATIONS,
    },
)
