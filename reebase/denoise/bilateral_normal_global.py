"""Bilateral filtering of normals, global scheme: all normals at once, near the given ones and near their neighbours'.

Idea: what many passes of the local scheme approach step by step is solved for, with weights from the normals as they
came, so that nothing is blurred by repetition. Use it for CAD-like shapes at little noise; strong noise makes its
weights random. Source: Y. Zheng, H. Fu, O. K.-C. Au and C.-L. Tai, Bilateral Normal Filtering for Mesh Denoising,
IEEE TVCG 17 (2011), global scheme.

With w_ts the bilateral weights of ``bilateral_normal`` over the faces s that share a vertex with t, each row scaled to
sum 1, the normals m minimise

    (1 - ``fidelity``) sum_t A_t |m_t - sum_s w_ts m_s|^2 + ``fidelity`` sum_t A_t |m_t - n_t|^2

and are then scaled to length 1; A_t is at least 1e-6 squared mean edge lengths. The equations are solved by conjugate
gradients to a residual of 1e-13. Then vertices follow, as in the local scheme.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from reebase.denoise.faces import VERTEX_ITERATIONS, centroid_distance, faces_across, faces_around, followed
from reebase.denoise.filter import Filter, FloatArray, Number, Step, Surface
from reebase.denoise.solving import conjugate_gradients
from reebase.mesh.geometry import normalised

__all__ = ["BILATERAL_NORMAL_GLOBAL"]

LEAST_AREA = 1e-6
MOST_ROUNDS = 2000


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """One solution and the vertices that follow it."""
    from reebase.denoise.face_kernels import bilateral_weights, face_geometry

    starts, rows = faces_around(surface)
    across = faces_across(surface)
    fidelity = parameters["fidelity"]

    def step(positions: FloatArray) -> FloatArray:
        from scipy.sparse import csr_array

        normals, areas, centroids = face_geometry(positions, surface.faces)
        sigma_c = parameters["reach"] * centroid_distance(centroids, across)
        weights = bilateral_weights(normals, areas, centroids, starts, rows, sigma_c, parameters["sigma_s"])
        mean = csr_array((weights, rows, starts), shape=(len(normals), len(normals)))
        back = mean.T.tocsr()
        mass = np.maximum(areas, LEAST_AREA)[:, None]

        def matrix(vectors: FloatArray) -> FloatArray:
            apart = mass * (vectors - mean @ vectors)
            return np.asarray((1 - fidelity) * (apart - back @ apart) + fidelity * mass * vectors)

        diagonal = mass + (1 - fidelity) * (back.power(2) @ mass)
        # What is solved for is the change of the normals, which is small where they agree.
        change, _ = conjugate_gradients(matrix, fidelity * mass * normals - matrix(normals), diagonal, MOST_ROUNDS)
        found = normalised(normals + change)
        found = np.where((found**2).sum(axis=1)[:, None] > 0, found, normals)
        return followed(surface, positions, found, parameters["vertex_iterations"]) - positions

    return step


BILATERAL_NORMAL_GLOBAL = Filter(
    name="bilateral_normal_global",
    summary="solves for normals near the given ones and near those beside them (Zheng et al. 2011, global)",
    prepare=prepare,
    parameters={
        "sigma_s": Number(0.6, 0.01, 10.0, "the difference of unit normals at which they count as unlike"),
        "reach": Number(1.0, 0.1, 10.0, "sigma_c over the mean distance between neighbouring centroids"),
        "fidelity": Number(0.01, 0.0, 1.0, "lambda, how much the given normals count", above_low=True),
        "vertex_iterations": VERTEX_ITERATIONS,
    },
)
