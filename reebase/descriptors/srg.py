"""``srg``: the endpoints of the spectral Reeb graph (Kacem, chapter 4; METHOD §5).

The idea: where the first non-constant eigenfunction of the Laplace-Beltrami operator ends, a limb ends; how
much area lies there and how far it is along the skeleton does not change when the shape bends.
Use it for articulated shapes of one connected surface. It sees only the ends of limbs, so two shapes with
equally long limbs look alike however different their surfaces are.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.descriptors.surface import Surface

__all__ = ["describe"]


def describe(surface: Surface) -> npt.NDArray[np.float64]:
    """omega = (a, dv, dc) of each endpoint, float64, (k, 3): the description's own, or those of the skeleton with
    the pipeline's default parameters.
    """
    return surface.features
