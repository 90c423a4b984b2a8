"""The compiled loop of ``sh``: spherical harmonics of the directions of points, summed by shells of radius."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["shell_coefficients"]


@njit(cache=True, nogil=True)
def _harmonics(
    x: float, y: float, z: float, norms: npt.NDArray[np.float64], legendre: npt.NDArray[np.float64],
    out: npt.NDArray[np.float64],
) -> None:  # fmt: skip
    """out[l, l + m] = the real orthonormal harmonic of degree l and order m at the unit vector (x, y, z)."""
    degrees = len(norms)
    # (x + i y)^m takes the place of sin^m exp(i m phi), so that the poles are no exception.
    real, imaginary, first = 1.0, 0.0, 1.0
    for m in range(degrees):
        legendre[m] = first
        if m + 1 < degrees:
            legendre[m + 1] = (2.0 * m + 1.0) * z * legendre[m]
        for l in range(m + 2, degrees):  # noqa: E741 - the degree is l
            legendre[l] = ((2.0 * l - 1.0) * z * legendre[l - 1] - (l + m - 1.0) * legendre[l - 2]) / (l - m)
        for l in range(m, degrees):  # noqa: E741 - the degree is l
            value = norms[l, m] * legendre[l]
            out[l, l + m] = value * real
            if m:
                out[l, l - m] = value * imaginary
        real, imaginary = real * x - imaginary * y, real * y + imaginary * x
        first *= 2.0 * m + 1.0


@njit(cache=True, nogil=True)
def shell_coefficients(
    corners: npt.NDArray[np.float64], pieces: npt.NDArray[np.int64], weights: npt.NDArray[np.float64],
    norms: npt.NDArray[np.float64], out: npt.NDArray[np.float64],
) -> None:  # fmt: skip
    """out[s, l, l + m] += weight * Y_lm(direction) for each point, shared between the two nearest shells.

    corners: of the faces, (n, 3, 3), about the origin; shell s has the radius s + 1. Face f is quartered into
    pieces[f]^2 equal triangles whose centroids are the points, each with weights[f]. norms: of the harmonics, (L, L).
    out: (S, L, 2 L - 1), zero.
    """
    shells, degrees = out.shape[0], out.shape[1]
    harmonics = np.zeros((degrees, 2 * degrees - 1))
    legendre = np.empty(degrees)
    for f in range(len(corners)):
        k = pieces[f]
        for i in range(k):
            for j in range(2 * (k - i) - 1):
                # Along a row upright triangles and those on their heads take turns.
                u = (i + (1.0 + j % 2) / 3.0) / k
                v = (j // 2 + (1.0 + j % 2) / 3.0) / k
                w = 1.0 - u - v
                x = w * corners[f, 0, 0] + u * corners[f, 1, 0] + v * corners[f, 2, 0]
                y = w * corners[f, 0, 1] + u * corners[f, 1, 1] + v * corners[f, 2, 1]
                z = w * corners[f, 0, 2] + u * corners[f, 1, 2] + v * corners[f, 2, 2]
                radius = np.sqrt(x * x + y * y + z * z)
                if radius > 0.0:
                    _harmonics(x / radius, y / radius, z / radius, norms, legendre, harmonics)
                else:
                    _harmonics(0.0, 0.0, 1.0, norms, legendre, harmonics)
                at = min(max(radius - 1.0, 0.0), shells - 1.0)
                low = min(int(at), shells - 2)
                upper = at - low
                for l in range(degrees):  # noqa: E741 - the degree is l
                    for m in range(2 * l + 1):
                        value = weights[f] * harmonics[l, m]
                        out[low, l, m] += (1.0 - upper) * value
                        out[low + 1, l, m] += upper * value
