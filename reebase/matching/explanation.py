"""The explanation of a dissimilarity: which endpoint went with which, and what each part adds to D."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.matching.features import as_features
from reebase.matching.measures import measure_named
from reebase.skeleton.graph import Skeleton

__all__ = ["Match", "Pair", "Unmatched", "match"]

_NOTES = {
    "matching_mean": "The parts add up to the dissimilarity times the larger count of endpoints.",
    "literal": "The measure adds up all pairs of endpoints, so all are listed; none is charged.",
}


@dataclass(frozen=True)
class Pair:
    """Row ``first`` of one set went with row ``second`` of the other; ``distance`` is their Phi (4.16)."""

    first: int
    second: int
    distance: float


@dataclass(frozen=True)
class Unmatched:
    """The endpoint in row ``endpoint`` of its set stayed alone and cost ``charge``, the norm of its omega."""

    endpoint: int
    charge: float


@dataclass(frozen=True)
class Match:
    """D(G, G~) and its parts. Indices are rows of omega, so places in ``skeleton.endpoints``.

    pairs: by ``first``, then ``second``. unmatched_first, unmatched_second: by ``endpoint``.
    Distances and charges add up to D for ``matching``, ``greedy`` and ``literal``, and to max(n1, n2) D for
    ``matching_mean``. For ``literal`` the pairs are all pairs, since these are the terms of its sum; it
    charges nothing, so where one side is empty the other is listed as unmatched at charge 0. Of endpoints that carry
    their own charge the squares of the parts add up to the square of D.
    note: what a reader must know about this measure's parts, or None.
    """

    dissimilarity: float
    measure: str
    pairs: tuple[Pair, ...]
    unmatched_first: tuple[Unmatched, ...]
    unmatched_second: tuple[Unmatched, ...]
    note: str | None = None

    def to_json(self) -> dict[str, Any]:
        """JSON-serialisable; the numbers round-trip."""
        return {
            "dissimilarity": self.dissimilarity,
            "measure": self.measure,
            "pairs": [{"first": p.first, "second": p.second, "distance": p.distance} for p in self.pairs],
            "unmatched_first": [{"endpoint": u.endpoint, "charge": u.charge} for u in self.unmatched_first],
            "unmatched_second": [{"endpoint": u.endpoint, "charge": u.charge} for u in self.unmatched_second],
            "note": self.note,
        }


def match(
    first: Skeleton | npt.ArrayLike, second: Skeleton | npt.ArrayLike, measure: str = "matching"
) -> Match:
    """D(G, G~) with the reasons: as ``dissimilarity``, the same bits, and the parts that it is made of.

    Deterministic; of several optimal matchings the canonical order of the endpoints decides.
    Raises UnknownName for another measure, ParameterError for arrays that are not endpoint features.
    """
    from reebase.matching.assignment_kernels import one_to_one

    code = measure_named(measure).code
    a, b = as_features(first, "first"), as_features(second, "second")
    partner = np.empty(len(a), dtype=np.int64)
    total = float(one_to_one(a, b, code, partner))
    if measure == "literal":
        matched = [(i, j) for i in range(len(a)) for j in range(len(b))]
    else:
        matched = [(i, int(j)) for i, j in enumerate(partner) if j >= 0]
    charged = measure != "literal"
    return Match(
        total, measure,
        tuple(Pair(i, j, _length(a[i] - b[j])) for i, j in matched),
        _left_over(a, {i for i, _ in matched}, charged),
        _left_over(b, {j for _, j in matched}, charged),
        _NOTES.get(measure),
    )  # fmt: skip


def _left_over(features: npt.NDArray[np.float64], matched: set[int], charged: bool) -> tuple[Unmatched, ...]:
    return tuple(
        Unmatched(i, _length(omega) if charged else 0.0)
        for i, omega in enumerate(features)
        if i not in matched
    )


def _length(vector: npt.NDArray[np.float64]) -> float:
    # Written out as the kernel does, so that the parts have the kernel's bits.
    x, y, z = (float(v) for v in vector)
    return float(np.sqrt(x * x + y * y + z * z))
