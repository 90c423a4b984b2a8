"""Descriptors that are vectors: how they are compared, and how the distribution of a function becomes one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError
from reebase.matching import Comparison, Stack

__all__ = ["QUANTILES", "VECTORS", "distances", "vector_distance", "weighted_quantiles"]

Array = npt.NDArray[np.float64]

QUANTILES = (np.arange(10) + 0.5) / 10
"""Ten levels in the middles of ten equal shares of the area."""


def weighted_quantiles(values: Array, weights: Array, levels: Array = QUANTILES) -> Array:
    """Quantiles of each column, float64, (len(levels), n), increasing along each column.

    values: (m, n). weights: (m,), not negative, with a positive sum. A value stands at the middle of its own weight
    in the cumulated weights; between two of them the quantile is linear. Equal values may come in any order.
    """
    share = weights / weights.sum()
    out = np.empty((len(levels), values.shape[1]))
    for column in range(values.shape[1]):
        order = np.argsort(values[:, column])
        sorted_share = share[order]
        out[:, column] = np.interp(levels, np.cumsum(sorted_share) - sorted_share / 2, values[order, column])
    return out


def vector_distance(first: Array, second: Array, measure: str) -> float:
    """Sum of absolute differences for "l1", root of the sum of squares for "l2". Raises as ``distances``."""
    return float(distances([first, second], measure)[0, 1])


def distances(vectors: Sequence[Array], measure: str) -> Array:
    """The distance of all pairs, symmetric, zero diagonal, float64, (n, n).

    Raises ParameterError when the vectors are not all of one length.
    """
    return VECTORS.matrix(vectors, measure)


def _as_row(vector: npt.ArrayLike, name: str) -> Array:
    row = np.ascontiguousarray(vector, dtype=np.float64).reshape(1, -1)
    if not np.isfinite(row).all():
        raise ParameterError(f"{name} has values that are not finite.", parameter=name)
    return row


def _one_to_many(query: Array, stack: Stack, measure: str) -> Array:
    difference = stack.values - query
    return np.asarray(np.abs(difference).sum(axis=1) if measure == "l1" else np.linalg.norm(difference, axis=1))


VECTORS = Comparison(_as_row, _one_to_many)
"""Vectors of one length each, by ``l1`` or ``l2``."""
