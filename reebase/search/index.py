"""The index: shapes by id, their endpoint features by endpoint count, the nearest by D."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from threading import Lock
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError, UnknownName
from reebase.matching import Measure, as_features, measure_named
from reebase.search.bucket import Bucket, project
from reebase.skeleton.graph import Skeleton

__all__ = ["Hit", "Index"]

_FIRST_BATCH = 64
"""At least so many candidates are compared before bounds decide about the rest."""

_SLACK = 1e-9
"""Relative; a bound may exceed D by rounding (about 1e-15), and no candidate may be lost to that."""


@dataclass(frozen=True)
class Hit:
    """One answer: the shape's id, its D to the query, its count of endpoints."""

    id: str
    dissimilarity: float
    endpoint_count: int


class Index:
    """Endpoint features of many shapes in memory, for exact nearest-neighbour queries by D.

    Any number of threads may read while others write: a reader works on the snapshot that was current when it
    began. Writers take turns. The arithmetic runs without the interpreter's lock.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._buckets: Mapping[int, Bucket] = MappingProxyType({})
        self._places: dict[str, tuple[int, int]] = {}

    def __len__(self) -> int:
        return len(self._places)

    def __contains__(self, name: object) -> bool:
        return name in self._places

    def add(self, id: str, features: Skeleton | npt.ArrayLike) -> None:
        """Hold these features, shape (k, 3), under that id, in place of what it had before.

        The features are copied. Raises ParameterError when they are not endpoint features.
        """
        rows = as_features(features)
        with self._lock:
            buckets = dict(self._buckets)
            self._forget(buckets, id)
            bucket = buckets.get(len(rows)) or Bucket.empty(len(rows))
            self._places[id] = (len(rows), bucket.rows)
            buckets[len(rows)] = bucket.appended(id, rows)
            self._buckets = MappingProxyType(buckets)

    def remove(self, id: str) -> bool:
        """Forget the shape; whether it was there."""
        with self._lock:
            buckets = dict(self._buckets)
            known = self._forget(buckets, id)
            self._buckets = MappingProxyType(buckets)
            return known

    def features_of(self, id: str) -> npt.NDArray[np.float64]:
        """The features as they were added, float64, (k, 3). Raises UnknownName."""
        with self._lock:
            if id not in self._places:
                raise UnknownName(f"The index holds no shape {id!r}.", parameter="shape", found=id)
            count, row = self._places[id]
            return np.array(self._buckets[count].features[row])

    def endpoint_count(self, id: str) -> int | None:
        """Of a shape; None when it is not here."""
        place = self._places.get(id)
        return None if place is None else place[0]

    def counts(self) -> dict[int, int]:
        """Endpoint count -> how many shapes have it, in increasing order, without the empty ones."""
        buckets = self._buckets
        return {count: len(buckets[count]) for count in sorted(buckets) if len(buckets[count])}

    def considered(
        self, endpoint_count: int, *, tolerance: int | None = 2, among: frozenset[str] | None = None
    ) -> dict[int, int]:
        """Endpoint count -> how many shapes a query is compared with. Raises ParameterError."""
        found = {
            bucket.count: len(bucket.selected(among))
            for bucket in _reachable(self._buckets, endpoint_count, tolerance)
        }
        return {count: number for count, number in found.items() if number}

    def query(
        self,
        features: Skeleton | npt.ArrayLike,
        *,
        k: int = 10,
        tolerance: int | None = 2,
        measure: str = "matching",
        among: frozenset[str] | None = None,
        max_dissimilarity: float | None = None,
    ) -> list[Hit]:
        """The k shapes of least D(query, shape), by increasing D, ties by id; fewer where there are fewer.

        features: of the query, shape (n, 3). tolerance: shapes with n - tolerance to n + tolerance endpoints
        are compared (section 4.3.1), None for all. among: only these ids, None for all. max_dissimilarity:
        only shapes with at most this D. Exact: a candidate is skipped only when a lower bound of its D
        exceeds k known D's.
        Raises ParameterError, UnknownName.
        """
        chosen = measure_named(measure)
        rows = as_features(features)
        if k % 1 or k < 1:
            raise ParameterError(f"k must be a whole number of at least 1; found {k}.", parameter="k", found=k)
        limit = math.inf if max_dissimilarity is None else float(max_dissimilarity)
        if not limit >= 0:
            raise ParameterError(
                f"max_dissimilarity must be at least 0; found {max_dissimilarity}.",
                parameter="max_dissimilarity",
            )
        reachable = _reachable(self._buckets, len(rows), tolerance)
        return _Candidates(rows, chosen, reachable, among).nearest(k, limit)

    def _forget(self, buckets: dict[int, Bucket], name: str) -> bool:
        """Take the shape out of ``buckets``, under the lock. A bucket of which half is gone is packed."""
        if name not in self._places:
            return False
        count, row = self._places.pop(name)
        bucket = buckets[count].without(row)
        if 2 * bucket.removed > bucket.rows:
            bucket = bucket.compacted()
            self._places.update((kept, (count, place)) for place, kept in enumerate(bucket.ids))
        buckets[count] = bucket
        return True


def _reachable(buckets: Mapping[int, Bucket], count: int, tolerance: int | None) -> list[Bucket]:
    if tolerance is None:
        return [buckets[size] for size in sorted(buckets)]
    if not tolerance >= 0:
        raise ParameterError(
            f"tolerance must be at least 0, or None for all; found {tolerance}.",
            parameter="tolerance", found=tolerance,
        )  # fmt: skip
    return [buckets[size] for size in sorted(buckets) if abs(size - count) <= tolerance]


class _Candidates:
    """The shapes that one query is compared with, numbered from 0 over all its buckets."""

    def __init__(
        self,
        query: npt.NDArray[np.float64],
        measure: Measure,
        buckets: list[Bucket],
        among: frozenset[str] | None,
    ) -> None:
        self._query = query
        self._measure = measure
        self._buckets = buckets
        rows = [bucket.selected(among) for bucket in buckets]
        self._rows = np.concatenate(rows) if rows else np.empty(0, dtype=np.int64)
        self._starts = np.cumsum([0, *map(len, rows)])

    def nearest(self, k: int, limit: float) -> list[Hit]:
        """The k nearest with D <= limit, by increasing D, ties by id."""
        everything = np.arange(len(self._rows))
        batch = max(_FIRST_BATCH, 4 * k)
        if not self._measure.bounded or len(everything) <= batch:
            return self._hits(everything, self._compare(everything), k, limit)
        bounds = self._bounds()
        order = np.argpartition(bounds, batch - 1)
        first, rest = order[:batch], order[batch:]
        known = self._compare(first)
        limit = min(limit, float(np.partition(known, k - 1)[k - 1]))
        rest = rest[bounds[rest] * (1 - _SLACK) <= limit]
        values = np.concatenate([known, self._compare(rest)])
        return self._hits(np.concatenate([first, rest]), values, k, limit)

    def _parts(self, candidates: npt.NDArray[np.int64]) -> list[tuple[Bucket, npt.NDArray[np.int64]]]:
        """For each bucket, at which places of ``candidates`` its shapes stand."""
        owners = self._owners(candidates)
        return [(bucket, np.flatnonzero(owners == b)) for b, bucket in enumerate(self._buckets)]

    def _compare(self, candidates: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
        """D of each candidate."""
        from reebase.matching.assignment_kernels import one_to_many

        result = np.empty(len(candidates))
        for bucket, places in self._parts(candidates):
            starts = self._rows[candidates[places]] * bucket.count
            found = np.empty(len(places))
            stacked = bucket.features.reshape(-1, 3)
            one_to_many(self._query, stacked, starts, starts + bucket.count, self._measure.code, found)
            result[places] = found
        return result

    def _bounds(self) -> npt.NDArray[np.float64]:
        """A lower bound of D of each candidate."""
        from reebase.matching.assignment_kernels import lower_bounds

        projected = project(self._query)
        bounds = np.empty(len(self._rows))
        for b, bucket in enumerate(self._buckets):
            found = np.empty(bucket.rows)
            lower_bounds(projected, bucket.projections[: bucket.rows], found)
            if self._measure.mean:
                found /= max(len(self._query), bucket.count, 1)
            part = slice(self._starts[b], self._starts[b + 1])
            bounds[part] = found[self._rows[part]]
        return bounds

    def _hits(
        self, candidates: npt.NDArray[np.int64], values: npt.NDArray[np.float64], k: int, limit: float
    ) -> list[Hit]:
        """The k least of ``values``; where several are as near as the k-th, their ids decide."""
        if len(values) > k:
            limit = min(limit, float(np.partition(values, k - 1)[k - 1]))
        near = np.flatnonzero(values <= limit)
        candidates = candidates[near]
        rows, owners = self._rows[candidates].tolist(), self._owners(candidates).tolist()
        found = [
            (value, self._buckets[owner].ids[row], self._buckets[owner].count)
            for value, row, owner in zip(values[near].tolist(), rows, owners, strict=True)
        ]
        found.sort()
        return [Hit(name, value, count) for value, name, count in found[:k]]

    def _owners(self, candidates: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """The place in ``self._buckets`` of each candidate's bucket."""
        return np.searchsorted(self._starts, candidates, side="right") - 1
