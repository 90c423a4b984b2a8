"""Signatures of the points of a surface, made of its eigenpairs: how heat, or a wave, behaves around each point.

Both are free of the signs of the eigenvectors and of the basis of a multiple eigenvalue, and do not change when the
surface bends without stretching. At unit area they are free of units.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError
from reebase.spectrum.eigen import Spectrum

__all__ = ["heat_kernel_signature", "wave_kernel_signature"]

Array = npt.NDArray[np.float64]

SMALLEST = 1e-12
"""Eigenvalues below this, at unit area, count as this in logarithms; on a connected surface only the constant's is."""


def heat_kernel_signature(spectrum: Spectrum, times: npt.ArrayLike) -> Array:
    """h(v, t) = sum_i exp(-lambda_i t) phi_i(v)^2, float64, (m, len(times)), the constant's term included.

    The heat left at a point after time t of what was put there (Sun, Ovsjanikov, Guibas, "A Concise and Provably
    Informative Multi-Scale Signature Based on Heat Diffusion", SGP 2009). times: in units of the area, not negative.
    At unit area h >= 1, since phi_1 = 1, and its area-weighted mean is the heat trace sum_i exp(-lambda_i t).
    Raises ParameterError.
    """
    t = np.atleast_1d(np.asarray(times, dtype=np.float64))
    if t.ndim != 1 or not (np.isfinite(t) & (t >= 0.0)).all():
        raise ParameterError("times must be finite numbers that are not negative.", parameter="times")
    return np.asarray(spectrum.eigenvectors**2 @ np.exp(-np.outer(spectrum.eigenvalues, t)))


def wave_kernel_signature(spectrum: Spectrum, energies: int = 16, width: float = 0.07) -> Array:
    """w(v, e) = sum_i g_e(lambda_i) phi_i(v)^2 / sum_i g_e(lambda_i), i >= 2, float64, (m, energies).

    The mean probability of finding a quantum particle of energy about e at a point (Aubry, Schlickewei, Cremers, "The
    Wave Kernel Signature", ICCV Workshops 2011): g_e is a Gaussian of log lambda round e, and the energies are spread
    evenly from log lambda_2 to log lambda_k.
    width: standard deviation of g_e over that range; the paper's 7 steps of 100. The area-weighted mean is 1 for each.
    Raises ParameterError for fewer than two eigenpairs, and for energies or width that are not positive.
    """
    if len(spectrum.eigenvalues) < 2:
        raise ParameterError("The wave kernel signature needs two eigenpairs or more.", parameter="spectrum")
    if energies < 1 or not 0.0 < width < np.inf:
        raise ParameterError(f"energies and width must be positive; found {energies} and {width}.")
    levels = np.log(np.maximum(spectrum.eigenvalues[1:], SMALLEST))
    lowest, highest = levels[0], levels[-1]
    at = np.linspace(lowest, highest, energies)
    sigma = max(width * (highest - lowest), np.finfo(np.float64).tiny ** 0.25)
    exponent = -((levels[:, None] - at) ** 2) / (2.0 * sigma**2)
    # Between two eigenvalues far apart all of g_e may underflow: its largest term counts as 1.
    weights = np.exp(exponent - exponent.max(axis=0))
    return np.asarray(spectrum.eigenvectors[:, 1:] ** 2 @ (weights / weights.sum(axis=0)))
