"""``sh``: spherical harmonics by shells (Kazhdan, Funkhouser, Rusinkiewicz, "Rotation Invariant Spherical Harmonic
Representation of 3D Shape Descriptors", SGP 2003).

The idea: cut space into concentric shells about the centroid; on each, how much of the surface lies in which direction
is a function on the sphere. A rotation moves energy between the harmonics of one degree, never between degrees, so that
the energy of each degree in each shell describes the shape however it is turned, and no alignment can fail.
Use it for rigid shapes of any quality, where ``views`` is too much to keep. A bent limb changes it.
"""

from __future__ import annotations

from math import factorial, pi, sqrt

import numpy as np
import numpy.typing as npt

from reebase.descriptors.surface import Surface
from reebase.mesh.geometry import doubled_normals, lengths

__all__ = ["describe"]

Array = npt.NDArray[np.float64]

SHELLS = 32
"""Radii 1 to 32, where 16 is the mean distance of the surface from its centroid; what is farther is in the last."""

DEGREES = 16
"""Degrees 0 to 15."""

POINTS = 8192
"""Points on the surface, at least: a face gets its share of them by area, and one at least."""


def describe(surface: Surface) -> Array:
    """Norm of the harmonics of each of 16 degrees in each of 32 shells, over the radius, shell by shell, (512,).

    The surface itself, of total area 1, takes the place of the paper's 64^3 voxels: nothing depends on a grid. Over
    the radius, so that sums of squares over the shells are integrals over space.
    """
    from reebase.descriptors.sh_kernels import shell_coefficients

    mesh = surface.body
    corners = mesh.vertices[mesh.faces]
    areas = lengths(doubled_normals(mesh))
    shares = areas / areas.sum()
    centroid = shares @ corners.mean(axis=1)
    # Of the middles of the sides, which also a lone triangle has away from its centroid.
    mean_distance = float(shares @ lengths((corners + corners[:, [1, 2, 0]]) / 2 - centroid).mean(axis=1))
    placed = np.ascontiguousarray((corners - centroid) * (SHELLS / 2 / mean_distance))
    pieces = np.ceil(np.sqrt(shares * POINTS)).astype(np.int64)
    found = np.zeros((SHELLS, DEGREES, 2 * DEGREES - 1))
    shell_coefficients(placed, pieces, shares / pieces**2, _norms(), found)
    radii = np.arange(1, SHELLS + 1)
    return np.asarray(lengths(found) / radii[:, None]).ravel()


def _norms() -> Array:
    """Of the real harmonics: sqrt((2 l + 1) / 4 pi * (l - m)! / (l + m)!), times sqrt 2 for m > 0."""
    return np.array([
        [sqrt((2 * l + 1) / (4 * pi) * factorial(l - m) / factorial(l + m) * (1 + (m > 0))) if m <= l else 0.0
         for m in range(DEGREES)] for l in range(DEGREES)  # noqa: E741 - the degree is l
    ])  # fmt: skip
