"""``srg``: the endpoints of the spectral Reeb graph (Kacem, chapter 4; METHOD §5).

The idea: where the first non-constant eigenfunction of the Laplace-Beltrami operator ends, a limb ends; how
much area lies there and how far it is along the skeleton does not change when the shape bends.
Use it for articulated shapes of one connected surface. It sees only the ends of limbs, so two shapes with
equally long limbs look alike however different their surfaces are.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.matching import dissimilarity, endpoint_features
from reebase.pipeline import Description
from reebase.skeleton.graph import Skeleton

__all__ = ["compare", "describe"]


def describe(shape: Description | Skeleton) -> npt.NDArray[np.float64]:
    """omega of each endpoint, float64, (k, 3): the description's own, or the skeleton's (``area="band"``)."""
    if isinstance(shape, Description):
        return shape.features
    return endpoint_features(shape)


def compare(
    first: npt.NDArray[np.float64], second: npt.NDArray[np.float64], measure: str = "matching"
) -> float:
    """D of two sets of endpoint features. Raises UnknownName for another measure."""
    return dissimilarity(first, second, measure)
