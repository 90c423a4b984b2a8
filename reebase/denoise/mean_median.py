"""The mean and the angle-median filter: faces take the normal of their surroundings, and vertices follow.

Idea: normals are smoothed first and positions fitted to them; the mean of the surrounding normals removes Gaussian
noise, the one at the median of the angles leaves sharp edges and removes outliers. Use the mean on organic shapes and
the median on shapes with edges, a few iterations. Source: A. Kacem, Geometric Approaches for 3D Shape Denoising and
Retrieval, (1.9)-(1.11), after Yagou, Ohtake and Belyaev, Mesh Smoothing via Mean and Median Filtering Applied to Face
Normals, GMP 2002.

With t_i* the other triangles that share a vertex with t_i:

    mean     m(t_i) = sum_{t_j in t_i*} A(t_j) n(t_j), normalised                                          (1.9), (1.10)
    median   m(t_i) = n(t^), t^ in t_i* at the median of the angles between n(t_i) and n(t_j); of an even count the
             lower median, so that a triangle attains it
    v_i   <- v_i + sum_t A(t) <c(t) - v_i, m(t)> m(t) / sum_t A(t), t the triangles round v_i                 (1.11)

Triangles without area do not count. At a vertex where more than 128 triangles meet only those belong to t_i* that share
another vertex with t_i too, so that the cost stays linear.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reebase.denoise.faces import faces_around
from reebase.denoise.filter import Filter, FloatArray, Step, Surface

__all__ = ["ANGLE_MEDIAN", "MEAN"]


def prepare_mean(surface: Surface, _: Mapping[str, Any]) -> Step:
    """The step of (1.11) with mean normals."""
    from reebase.denoise.face_kernels import face_geometry, follow_normals, mean_normals

    starts, rows = faces_around(surface)

    def step(positions: FloatArray) -> FloatArray:
        normals, areas, _ = face_geometry(positions, surface.faces)
        return follow_normals(positions, surface.faces, mean_normals(normals, areas, starts, rows), True)

    return step


def prepare_median(surface: Surface, _: Mapping[str, Any]) -> Step:
    """The step of (1.11) with the normals at the median angle."""
    from reebase.denoise.face_kernels import face_geometry, follow_normals, median_normals

    starts, rows = faces_around(surface)

    def step(positions: FloatArray) -> FloatArray:
        normals, areas, _ = face_geometry(positions, surface.faces)
        return follow_normals(positions, surface.faces, median_normals(normals, areas, starts, rows), True)

    return step


MEAN = Filter(
    name="mean",
    summary="fits vertices to the mean of the normals round each face (1.9)-(1.11)",
    prepare=prepare_mean,
)

ANGLE_MEDIAN = Filter(
    name="angle_median",
    summary="fits vertices to the normal at the median angle round each face (1.11)",
    prepare=prepare_median,
)
