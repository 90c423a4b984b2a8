"""Re-ranking by diffusion: two shapes are alike when their neighbourhoods are (METHOD §6).

The idea: of two poses of one animal that are far apart there are often others in between. Similarity that walks over
the graph of nearest neighbours, from the query and from the candidate at once, meets there (Donoser, Bischof,
"Diffusion Processes for Retrieval Revisited", CVPR 2013).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError

if TYPE_CHECKING:
    from scipy.sparse import csr_array

__all__ = ["CANDIDATES", "rerank", "reranked_matrix"]

Array = npt.NDArray[np.float64]

CANDIDATES = 500
"""The nearest shapes of a large collection among which a query is re-ranked; of a smaller collection all."""

NEIGHBOURS = 10
"""Of each shape in the graph, itself included."""

STEPS = 20
"""Of the walk from either side."""


def rerank(dissimilarities: Array, query: int) -> Array:
    """Re-ranked dissimilarities of one of m shapes to all: row ``query`` of ``reranked_matrix``, float64, (m,).

    dissimilarities: fused ones of all pairs of the query and its candidates, (m, m). Without the whole matrix, in
    O(steps * neighbours * m) beyond finding the neighbours. Raises ParameterError for another shape.
    """
    P = _walk(dissimilarities)
    steps = [np.eye(1, P.shape[0], query)[0]]
    for _ in range(STEPS):
        steps.append(np.asarray(steps[-1] @ P))
    spread = steps.pop()
    for step in reversed(steps):
        spread = P @ spread + step
    return _blended(spread, np.asarray(dissimilarities)[query], spread[query])


def reranked_matrix(dissimilarities: Array) -> Array:
    """Re-ranked dissimilarities of all pairs of n shapes, float64, (n, n), row = query. Raises ParameterError.

    W = exp(-F) on each shape's nearest neighbours, rows summing to 1; X <- W X W^T + I, as often as ``STEPS``. Where X
    reaches from query to candidate the result is 1 - X / X_qq; beyond, 1 and more, in the order of F.
    """
    P = _walk(dissimilarities)
    X = np.eye(P.shape[0])
    for _ in range(STEPS):
        X = np.asarray(P @ np.asarray(P @ X).T)
        X[np.diag_indices_from(X)] += 1.0
    return _blended(X, np.asarray(dissimilarities), np.diag(X)[:, None])


def _walk(dissimilarities: Array) -> csr_array[np.float64]:
    """The transition matrix between nearest neighbours, (n, n)."""
    from scipy.sparse import csr_array

    F = np.asarray(dissimilarities, dtype=np.float64)
    if F.ndim != 2 or F.shape[0] != F.shape[1]:
        raise ParameterError(f"The dissimilarities of all pairs must have shape (n, n); found {F.shape}.")
    count = len(F)
    near = np.argsort(F, axis=1, kind="stable")[:, :NEIGHBOURS]
    values = np.take_along_axis(F, near, axis=1)
    weights = np.exp(values.min(axis=1, initial=np.inf, keepdims=True) - values)
    weights /= weights.sum(axis=1, keepdims=True)
    starts = np.arange(count + 1) * near.shape[1]
    return csr_array((weights.ravel(), near.ravel(), starts), shape=(count, count))


def _blended(spread: Array, dissimilarities: Array, own: Array | np.float64) -> Array:
    near = spread / own
    return np.asarray(np.where(near > 0.0, 1.0 - near, 1.0 + dissimilarities))
