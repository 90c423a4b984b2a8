"""``shape_dna``: the first eigenvalues of the Laplace-Beltrami operator (Reuter, Wolter, Peinecke, "Laplace-Beltrami
spectra as 'Shape-DNA' of surfaces and solids", Computer-Aided Design 38(4), 2006).

The idea: the eigenvalues are the frequencies at which the surface vibrates; they depend on nothing but lengths on it.
Use it where shapes bend and one short vector a shape is all that can be kept. It says nothing about where two shapes
differ, and shapes that are not isometric can sound the same.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.descriptors.surface import Surface

__all__ = ["COUNT", "describe"]

COUNT = 20
"""Eigenvalues that are kept."""

SMALLEST = 1e-12
"""Eigenvalues below this at unit area are rounding."""


def describe(surface: Surface) -> npt.NDArray[np.float64]:
    """log lambda_i of the 20 eigenvalues after the zero one at unit area, increasing, float64, (20,).

    The logarithm keeps the high ones, which grow as 4 pi i (Weyl's law) and vary most, from drowning the low ones. A
    mesh of fewer than 21 vertices lacks some; Weyl's law, from its last one on, stands in for them.
    """
    eigenvalues = np.maximum(surface.spectrum().eigenvalues[1 : COUNT + 1], SMALLEST)
    order = np.arange(len(eigenvalues) + 1, COUNT + 1)
    return np.concatenate([np.log(eigenvalues), np.log(eigenvalues[-1] * order / len(eigenvalues))])
