"""D for endpoints that carry their own charge: what one costs when it stays alone is part of its omega.

Rows of omega are (features ..., charge), with Phi the Euclidean distance of whole rows, charge included. So
|c - c~| <= Phi: two charges never differ by more than the endpoints do, which is what makes D a metric.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError
from reebase.matching.comparison import Comparison, Stack
from reebase.matching.explanation import Match, Pair, Unmatched
from reebase.matching.features import LARGEST

__all__ = ["CHARGED", "as_charged", "charged_matrix", "match_charged"]

Array = npt.NDArray[np.float64]


def as_charged(value: npt.ArrayLike, name: str = "endpoints") -> Array:
    """``value`` as endpoints with charges, C-contiguous float64, (k, w), w >= 2; the last column is the charge.

    Raises ParameterError for another shape, numbers that are not finite or beyond ``LARGEST`` (the kernels rely on
    it), and charges that are not positive.
    """
    rows = np.ascontiguousarray(value, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] < 2:
        raise ParameterError(f"{name} must have shape (k, w) with w >= 2; found {rows.shape}.", parameter=name)
    if not (np.abs(rows) <= LARGEST).all() or not (rows[:, -1] > 0.0).all():
        raise ParameterError(
            f"{name} must be between -{LARGEST:g} and {LARGEST:g}, with positive charges in the last column.",
            parameter=name,
        )
    return rows


def charged_matrix(shapes: Sequence[npt.ArrayLike], progress: Callable[[float], None] | None = None) -> Array:
    """D of all pairs of sets of endpoints, float64, (n, n), symmetric to the bit, zero diagonal.

    D^2 = min over partial one-to-one pairings of the sum of Phi^2 over the pairs and of the squared charges of all that
    stay alone, on either side: a pair whose Phi^2 is above both squares together is never made. Squares let one limb
    that differs much count for more than many that differ a little, which pose and tessellation cause. A metric on
    finite multisets, the Wasserstein distance of order 2: add to each set as many copies of one point "nothing", at
    distance c from an endpoint of charge c and 0 from itself, as the other has endpoints. min(Phi, c + c~) with these
    is a metric, since |c - c~| <= Phi, and D is the least root of summed squares over the bijections.
    progress: called with the fraction of the work that is done, after each row. Raises ParameterError.
    """
    return CHARGED.matrix(shapes, "matching", progress)


def match_charged(first: npt.ArrayLike, second: npt.ArrayLike) -> Match:
    """D of two sets of endpoints with its parts, whose squares add up to its square: pairs and their Phi, and who
    stayed alone at what charge.

    The dissimilarity has the bits of ``charged_matrix``. Indices are rows of the arguments. Raises ParameterError.
    """
    from reebase.matching.charged_kernels import one_to_one

    a, b = as_charged(first, "first"), as_charged(second, "second")
    if a.shape[1] != b.shape[1]:
        raise ParameterError(f"first has {a.shape[1]} columns and second {b.shape[1]}.", parameter="second")
    (rows, a_order), (columns, b_order) = _ordered(a), _ordered(b)
    partner = np.empty(len(a), dtype=np.int64)
    total = float(one_to_one(rows, columns, partner))
    pairs = sorted((int(a_order[i]), int(b_order[j])) for i, j in enumerate(partner) if j >= 0)
    return Match(
        total, "matching",
        tuple(Pair(i, j, float(np.linalg.norm(a[i] - b[j]))) for i, j in pairs),
        _alone(a, {i for i, _ in pairs}),
        _alone(b, {j for _, j in pairs}),
        "The squares of the parts add up to the square of the dissimilarity.",
    )  # fmt: skip


def _ordered(rows: Array) -> tuple[Array, npt.NDArray[np.int64]]:
    """By decreasing charge, then the other columns: the same rows for every order of the endpoints."""
    order = np.lexsort((rows[:, 0], -rows[:, -1]))
    first = rows[order][:, [0, -1]]
    if (first[1:] == first[:-1]).all(axis=1).any():  # seldom: the other columns are many
        order = np.lexsort((*rows[:, -2::-1].T, -rows[:, -1]))
    return np.ascontiguousarray(rows[order]), order


def _alone(rows: Array, matched: set[int]) -> tuple[Unmatched, ...]:
    return tuple(Unmatched(i, float(row[-1])) for i, row in enumerate(rows) if i not in matched)


def _one_to_many(query: Array, stack: Stack, _: str) -> Array:
    from reebase.matching.charged_kernels import one_to_many

    out = np.empty(stack.shapes)
    one_to_many(query, stack.values, stack.offsets, out)
    return out


CHARGED = Comparison(
    rows=lambda kept, name: _ordered(as_charged(kept, name))[0],
    one_to_many=_one_to_many,
    explain=lambda first, second, _: match_charged(first, second),
)
"""Sets of endpoints with charges, by ``matching``."""
