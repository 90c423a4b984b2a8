"""The dissimilarity matrix of a set of shapes (Kacem, Table 4.1)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from reebase.matching import as_features, measure_named
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
    from reebase.matching.assignment_kernels import one_to_many

    chosen = measure_named(measure)
    features = [as_features(shape, f"shapes[{i}]") for i, shape in enumerate(shapes)]
    count = len(features)
    offsets = np.cumsum([0, *map(len, features)], dtype=np.int64)
    stacked = np.ascontiguousarray(np.vstack([np.zeros((0, 3)), *features]))
    D = np.zeros((count, count))
    done = 0
    for row, query in enumerate(features):
        first = row if chosen.symmetric else 0
        found = np.empty(count - first)
        one_to_many(query, stacked, offsets[first:-1], offsets[first + 1 :], chosen.code, found)
        D[row, first:] = found
        if chosen.symmetric:
            D[row:, row] = found
        done += count - first
        if progress is not None:
            progress(done / (count * (count + 1) / 2 if chosen.symmetric else count * count))
    return D
