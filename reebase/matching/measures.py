"""The measures of D(G, G~), by name: which endpoints go with which, and what those left over cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError, unknown_name
from reebase.matching.features import as_features
from reebase.skeleton.graph import Skeleton

__all__ = ["MEASURES", "Measure", "dissimilarities", "dissimilarity", "measure_named"]


@dataclass(frozen=True)
class Measure:
    """One definition of D. Every D is >= 0 and does not depend on the order of the endpoints.

    code: the kernels' number for it. symmetric: D(G, G~) = D(G~, G), to the bit.
    reflexive: D(G, G) = 0, exactly. metric: on finite multisets of non-zero omega.
    bounded: never less than ``matching`` (divided by max(n1, n2) if ``mean``), so that the bound of the
    search holds.
    """

    name: str
    code: int
    symmetric: bool
    reflexive: bool
    metric: bool
    bounded: bool
    mean: bool
    summary: str

    def to_json(self) -> dict[str, Any]:
        """What a caller may know of it, JSON-serialisable: without the kernels' side."""
        return {
            "name": self.name, "summary": self.summary,
            "symmetric": self.symmetric, "reflexive": self.reflexive, "metric": self.metric,
        }  # fmt: skip


MEASURES: Mapping[str, Measure] = MappingProxyType({
    measure.name: measure
    for measure in (
        Measure("matching", 0, True, True, True, True, False,
                "The cheapest one-to-one matching of the endpoints; each one left over adds its norm."),
        Measure("matching_mean", 1, True, True, False, True, True,
                "The matching's sum, divided by the larger count of endpoints."),
        Measure("greedy", 2, False, True, False, True, False,
                "The query's endpoints, largest area first, each take the nearest one that is free; "
                "each one left over adds its norm."),
        Measure("literal", 3, True, False, False, False, False,
                "The sum over all pairs, as printed; it grows with the counts and D(G, G) is not 0."),
    )
})  # fmt: skip
"""name -> measure, in the order of METHOD §5."""


def measure_named(name: str) -> Measure:
    """The measure of that name. Raises UnknownName with the names that would do."""
    if name not in MEASURES:
        raise unknown_name("measure", name, MEASURES)
    return MEASURES[name]


def dissimilarity(
    first: Skeleton | npt.ArrayLike, second: Skeleton | npt.ArrayLike, measure: str = "matching"
) -> float:
    """D(G, G~) of two skeletons, or of their endpoint features of shapes (k, 3) and (l, 3) (METHOD §5).

    With Phi(v_i, v~_j) = |omega_i - omega~_j| (4.16):

    ``matching``: min over one-to-one pairings of the sum of Phi over the pairs and |omega| over the endpoints
    left over, both taken into account at once. It makes no difference whether the pairing must be maximum:
    where both sides have an endpoint left over, Phi <= |omega| + |omega~| lets the two be paired at no
    greater cost, so some optimal pairing uses up the smaller set. A metric: pad both multisets with zero
    vectors to one common size, and D is the least cost of a bijection under the metric Phi; composing two
    bijections gives the triangle inequality, and D = 0 means equal up to zero vectors.
    ``matching_mean``: the same over max(k, l); 0 for two empty sets. Symmetric, not a metric.
    ``greedy``: Algorithm 2. As printed it depends on the order of the query's endpoints, so they come by
    decreasing a, ties by increasing dv, then dc; each takes the nearest of those that are free (the first in
    that same order when equally near). What is left over on either side is charged |omega|, as in
    ``matching``, to which it is thus an upper bound. Not symmetric.
    ``literal``: (4.17) as printed, the sum of Phi over all k l pairs; 0 if either set is empty.

    Raises UnknownName for another measure, ParameterError for arrays that are not endpoint features.
    """
    from reebase.matching.assignment_kernels import one_to_one

    code = measure_named(measure).code
    a, b = as_features(first, "first"), as_features(second, "second")
    return float(one_to_one(a, b, code, np.empty(len(a), dtype=np.int64)))


def dissimilarities(
    query: Skeleton | npt.ArrayLike,
    offsets: npt.ArrayLike,
    stacked: npt.ArrayLike,
    measure: str = "matching",
) -> npt.NDArray[np.float64]:
    """D(query, candidate) for n candidates at once, float64, (n,), the same bits as ``dissimilarity``.

    offsets: integers, (n + 1,); candidate c has the rows offsets[c]..offsets[c + 1] of ``stacked``, which has
    shape (offsets[n], 3). An exact assignment each, O(k^2 l) for k <= l endpoints, compiled, without the
    interpreter's lock.
    Raises UnknownName, ParameterError.
    """
    from reebase.matching.assignment_kernels import one_to_many

    code = measure_named(measure).code
    features, rows = as_features(query, "query"), as_features(stacked, "stacked")
    given = np.asarray(offsets)
    bounds = np.ascontiguousarray(given if given.dtype.kind in "iu" else [], dtype=np.int64)
    spans = bounds.ndim == 1 and len(bounds) > 0 and bounds[0] == 0 and bounds[-1] == len(rows)
    if not spans or bool((np.diff(bounds) < 0).any()):
        raise ParameterError(
            f"offsets must be whole numbers that rise from 0 to {len(rows)}, the number of rows of stacked.",
            parameter="offsets",
        )
    out = np.empty(len(bounds) - 1)
    one_to_many(features, rows, bounds[:-1], bounds[1:], code, out)
    return out
