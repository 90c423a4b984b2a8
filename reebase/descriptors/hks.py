"""``hks``: the distribution of the heat kernel signature over the surface (Sun, Ovsjanikov, Guibas, SGP 2009).

The idea: heat put at a point leaves it fast on a broad body and slowly at the tip of a limb; over short times the
signature sees curvature, over long ones the whole shape. How its values are distributed over the area describes the
shape.
Use it where shapes bend: of the descriptors that are one vector it is among the best here. It does not see where on
the surface a value occurs, so it cannot explain a result.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.descriptors.surface import Surface
from reebase.descriptors.vectors import weighted_quantiles
from reebase.spectrum.signatures import heat_kernel_signature

__all__ = ["TIMES", "describe", "log_heat"]

TIMES = np.geomspace(0.002, 0.3, 16)
"""Times over the area: from the size of a finger to that of the body (METHOD §6)."""


def log_heat(surface: Surface) -> npt.NDArray[np.float64]:
    """Logarithm of the heat kernel signature at ``TIMES`` and unit area, >= 0, float64, (m, 16)."""
    return np.log(heat_kernel_signature(surface.spectrum(), TIMES))


def describe(surface: Surface) -> npt.NDArray[np.float64]:
    """Ten area-weighted quantiles of log h(., t) at each of 16 times, float64, (160,), quantile by quantile."""
    return weighted_quantiles(surface.shared(log_heat), surface.weights).ravel()
