"""``gps``: distances in the global point signature (Rustamov, "Laplace-Beltrami Eigenfunctions for Deformation
Invariant Shape Representation", SGP 2007).

The idea: the coordinates phi_i / sqrt(lambda_i) place each point in a space where the surface has the same form
however it is bent; the distribution of distances there (the D2 of that space) describes the shape.
Use it to compare with the literature: ``hks`` holds the same information without its weakness, that one
eigenfunction which changes places with another moves every distance.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.descriptors.surface import Surface

__all__ = ["describe"]

DIMENSIONS = 25
"""Eigenfunctions after the constant, as in the paper."""

POINTS = 1024
"""Points between which distances are taken: half a million of them."""

LEVELS = (np.arange(64) + 0.5) / 64
"""Quantiles kept of the distances. They need no range of bins, which a histogram would."""

SMALLEST = 1e-12
"""Eigenvalues below this at unit area are rounding."""


def describe(surface: Surface) -> npt.NDArray[np.float64]:
    """64 quantiles of the distances between 1024 points spread over the area, increasing, float64, (64,).

    The points are vertices, at equal steps of the cumulated area in the order of the file: the same mesh in another
    order gives another sample of the same distribution.
    """
    cumulated = np.cumsum(surface.weights)
    steps = (np.arange(POINTS) + 0.5) / POINTS * cumulated[-1]
    chosen = np.minimum(np.searchsorted(cumulated, steps), len(cumulated) - 1)
    read = slice(1, DIMENSIONS + 1)
    scale = np.sqrt(np.maximum(surface.spectrum().eigenvalues[read], SMALLEST))
    points = surface.spectrum().eigenvectors[chosen, read] / scale
    from scipy.spatial.distance import pdist

    return np.quantile(pdist(points), LEVELS)
