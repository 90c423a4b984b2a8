"""The dissimilarity matrix of a set of shapes (Kacem, Table 4.1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from reebase.matching import ENDPOINTS, measure_named
from reebase.skeleton.graph import Skeleton

__all__ = ["dissimilarity_matrix"]


def dissimilarity_matrix(
    shapes: Sequence[Skeleton | npt.ArrayLike],
    measure: str = "matching",
    *,
    progress: Callable[[float], None] | None = None,
) -> npt.NDArray[np.float64]:
    """D of every shape, as query, with every shape: float64, shape (n, n), row = query.

    shapes: skeletons or endpoint features of shape (k, 3). Of a symmetric measure one half is computed, and
    the other is its mirror image, to the bit. The diagonal is D(G, G), which ``literal`` does not make 0.
    progress: called with the fraction of the work that is done, after each row.
    Raises UnknownName, ParameterError.
    """
    return ENDPOINTS.matrix(shapes, measure_named(measure).name, progress)
