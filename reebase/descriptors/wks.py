"""``wks``: the distribution of the wave kernel signature over the surface (Aubry, Schlickewei, Cremers, ICCV
Workshops 2011).

The idea: as ``hks``, but each entry looks at one band of frequencies, where heat mixes all that are low. So detail is
not drowned by what is large.
Use it where shapes bend and differ in detail, or where classes are close to one another; it is more easily disturbed
by holes and coarse meshes than ``hks``.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.descriptors.surface import Surface
from reebase.descriptors.vectors import weighted_quantiles
from reebase.spectrum.signatures import wave_kernel_signature

__all__ = ["describe", "waves"]

def waves(surface: Surface) -> npt.NDArray[np.float64]:
    """The wave kernel signature at 16 energies, float64, (m, 16)."""
    return wave_kernel_signature(surface.spectrum())


def describe(surface: Surface) -> npt.NDArray[np.float64]:
    """Ten area-weighted quantiles of w(., e) at each of 16 energies, float64, (160,), quantile by quantile."""
    return weighted_quantiles(surface.shared(waves), surface.weights).ravel()
