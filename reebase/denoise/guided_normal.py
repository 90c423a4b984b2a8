"""Guided normal filtering, local scheme: likeness is judged on the normals of the most even patch round each face.

Idea: noisy normals say little about whether two faces lie on one side of an edge; the mean normal of the patch that
bends least among those which hold a face says more, and guides a bilateral filter. Use it for shapes with sharp edges,
at strong noise too; the default is one round of five passes. Source: W. Zhang, B. Deng, J. Zhang, S. Bouaziz and
L. Liu, Guided Mesh Normal Filtering, Computer Graphics Forum 34 (2015).

The patch P_t is t and the faces that share a vertex with it. With phi_e the difference of the normals across an edge e
between two faces of the patch,

    H(P) = max_{s, r in P} |n_s - n_r| * max_e phi_e / (1e-9 + sum_e phi_e)
    g_t  = normalised sum_{s in P} A_s n_s of the patch P with the least H among those of t and the faces that share a
           vertex with it
    n_t <- normalised sum_s A_s exp(-|c_s - c_t|^2 / 2 sigma_c^2) exp(-|g_s - g_t|^2 / 2 sigma_s^2) n_s

over the faces s that share a vertex with t; sigma_c is ``reach`` times the mean distance between centroids across an
edge. After each of ``normal_iterations`` passes vertices follow ``vertex_iterations`` times, by X. Sun et al. 2007,
and everything is computed anew.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reebase.denoise.faces import (
    VERTEX_ITERATIONS,
    centroid_distance,
    faces_across,
    faces_around,
    followed,
    later_beside,
    pairs_around,
)
from reebase.denoise.filter import Filter, FloatArray, Number, Step, Surface

__all__ = ["GUIDED_NORMAL"]


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """One round of passes on this surface."""
    from reebase.denoise.face_kernels import bilateral_normals, face_geometry
    from reebase.denoise.guided_normal_kernels import guiding_normals, within_patches

    starts, rows = faces_around(surface)
    pairs = pairs_around(surface)
    across = faces_across(surface)
    beside = later_beside(surface)
    if "patches" not in surface.known:
        surface.known["patches"] = within_patches(starts, rows, beside)

    def step(positions: FloatArray) -> FloatArray:
        begin = positions
        for _ in range(parameters["normal_iterations"]):
            normals, areas, centroids = face_geometry(positions, surface.faces)
            guides = guiding_normals(normals, areas, starts, rows, beside, *surface.known["patches"])
            sigma_c = parameters["reach"] * centroid_distance(centroids, across)
            normals = bilateral_normals(
                normals, guides, areas, centroids, *pairs, sigma_c, parameters["sigma_s"]
            )
            positions = followed(surface, positions, normals, parameters["vertex_iterations"])
        return positions - begin

    return step


GUIDED_NORMAL = Filter(
    name="guided_normal",
    summary="averages normals that are near and alike by the evenest patch round each (Zhang et al. 2015)",
    prepare=prepare,
    parameters={
        "sigma_s": Number(0.5, 0.01, 10.0, "the difference of guiding normals at which faces count as unlike"),
        "reach": Number(1.0, 0.1, 10.0, "sigma_c over the mean distance between neighbouring centroids"),
        "normal_iterations": Number(5, 1, 1000, "passes over the normals, each followed by the vertices", whole=True),
        "vertex_iterations": VERTEX_ITERATIONS,
    },
)
