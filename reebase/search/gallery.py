"""The shapes of a collection in memory with what is kept of each, ranked by any ``Ranking``."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from threading import RLock
from typing import Any, NamedTuple
from zlib import crc32

import numpy as np
import numpy.typing as npt

from reebase.descriptors import descriptor_named
from reebase.matching import Stack
from reebase.ranking import (
    CANDIDATES,
    REFERENCES,
    UNREACHED,
    Fused,
    Ranking,
    Statistics,
    fuse,
    fused_matrix,
    rerank,
    statistics,
)

__all__ = ["Gallery", "Ranked"]

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.floating[Any]]

_CHUNK = 2048
"""Shapes that are widened to double precision at once."""


class Ranked(NamedTuple):
    """One query against all n shapes of a gallery, in the order of its ids.

    dissimilarities: what ranks, (n,). distances: part -> (n,). shares: part -> its share of the similarity, (n,).
    """

    dissimilarities: Array
    distances: Mapping[str, Array]
    shares: Mapping[str, Array]


class _Kept(NamedTuple):
    """Of one part: the rows of all shapes in single precision, where those of each begin, and how they are compared."""

    values: npt.NDArray[np.float32]
    offsets: npt.NDArray[np.int64]
    precision: type[np.floating[Any]]

    @classmethod
    def of(cls, part: str, shapes: Sequence[Floats] = ()) -> _Kept:
        stack = Stack.of(shapes)
        return cls(stack.values.astype(np.float32), stack.offsets, descriptor_named(part).comparison.precision)

    def stack(self, first: int = 0, last: int | None = None) -> Stack:
        offsets = self.offsets[first : None if last is None else last + 1]
        values = self.values[offsets[0] : offsets[-1]].astype(self.precision, copy=False)
        return Stack(values, offsets - offsets[0])

    def taken(self, places: npt.NDArray[np.int64]) -> _Kept:
        """Of these shapes, in this order."""
        if np.array_equal(places, np.arange(len(self.offsets) - 1)):
            return self
        lengths = np.diff(self.offsets)[places]
        offsets = np.concatenate([[0], np.cumsum(lengths)])
        rows = np.repeat(self.offsets[places] - offsets[:-1], lengths) + np.arange(offsets[-1])
        return _Kept(self.values[rows], offsets, self.precision)

    def joined(self, other: _Kept) -> _Kept:
        if len(other.offsets) == 1:
            return self
        if len(self.offsets) == 1:
            return other
        return _Kept(
            np.concatenate([self.values, other.values]),
            np.concatenate([self.offsets, self.offsets[-1] + other.offsets[1:]]), self.precision,
        )  # fmt: skip


class _Known(NamedTuple):
    """Distances that were computed before: part -> (k, r), of the shapes with these ids to these references."""

    ids: tuple[str, ...]
    references: tuple[str, ...]
    distances: Mapping[str, Array]


class Gallery:
    """A snapshot that never changes; ``changed`` gives the next one. Any number of threads may read it.

    What is kept is held in single precision, as it is stored. A fused ranking needs of the shapes that it compares the
    distances to at most REFERENCES of all, which give their scales. They are computed when first needed, and taken over
    into later snapshots; while there are no more shapes than that, these are the distances of all pairs. Beyond
    CANDIDATES shapes only the nearest so many are compared so, so that no query has to measure a large collection.
    """

    def __init__(self, ranking: Ranking) -> None:
        self.ranking = ranking
        self.ids: tuple[str, ...] = ()
        self._kept = {part: _Kept.of(part) for part in ranking.parts}
        self._known = _Known((), (), {})
        # An earlier snapshot that was measuring its distances when this one was made, and what was lost since.
        self._awaited: tuple[Gallery, frozenset[str]] | None = None
        self._lock = RLock()

    def __len__(self) -> int:
        return len(self.ids)

    @cached_property
    def places(self) -> Mapping[str, int]:
        """id -> its place in ``ids``."""
        return {id: place for place, id in enumerate(self.ids)}

    @property
    def bytes(self) -> int:
        """Memory of what is kept and of the distances computed so far."""
        held = [kept.values.nbytes + kept.offsets.nbytes for kept in self._kept.values()]
        return sum(held) + sum(found.nbytes for found in self._known.distances.values())

    def changed(self, put: Mapping[str, Mapping[str, Floats]], gone: Collection[str] = ()) -> Gallery:
        """The snapshot with some shapes put in, by id and part, in place of what they had, and others taken out.

        Raises ParameterError for what the parts' descriptors did not make.
        """
        after = Gallery(self.ranking)
        lost = {*put, *gone}
        stay = np.array([place for place, id in enumerate(self.ids) if id not in lost], dtype=np.int64)
        ids = [*(self.ids[place] for place in stay), *put]
        order = np.array(sorted(range(len(ids)), key=ids.__getitem__), dtype=np.int64)
        after.ids = tuple(ids[place] for place in order)
        for part in self._kept:
            rows = descriptor_named(part).comparison.rows
            new = _Kept.of(part, [rows(np.float32(kept[part]), part) for kept in put.values()])
            after._kept[part] = self._kept[part].taken(stay).joined(new).taken(order)
        self._hand_on(after, frozenset(lost))
        return after

    def rank(self, query: Mapping[str, Floats], id: str | None = None, *, again: bool = False) -> Ranked:
        """Compare a query with every shape. query: what is kept of it by each part. id: its own, where it is here.

        again: re-rank a fused ranking. Exact; of a shape that is here, and of a copy of it, the row of
        ``Ranking.matrix`` of all. Beyond CANDIDATES shapes a fused ranking compares the nearest so many, as the query's
        own scales tell, and the others come after them in that order. Raises ParameterError.
        """
        distances = {part: self._to_all(part, query[part], measure) for part, measure in self.ranking.parts.items()}
        if self.ranking.measure is not None:
            only = distances[self.ranking.name]
            return Ranked(only, distances, {self.ranking.name: np.ones(len(only))})
        place = self.places.get(id) if id is not None else _copy(distances)
        among = {part: found[None, self._references] for part, found in distances.items()}
        scales = statistics(among, np.where(self._references == place, 0, -1)).scales
        own = {part: float(scale[0]) for part, scale in scales.items()}
        chosen, fused = self._fused_with(distances, own, place)
        found = fused.dissimilarities
        if again and len(self):
            found = self._reranked(found, chosen, place)
        return Ranked(found, distances, fused.shares)

    def _fused_with(
        self, distances: Mapping[str, Array], own: Mapping[str, float], place: int | None
    ) -> tuple[npt.NDArray[np.int64], Fused]:
        """The nearest shapes, increasing, and all fused with a query: these by their scales, all others after them."""
        if len(self) <= CANDIDATES:
            every = np.arange(len(self))
            return every, fuse(distances, own, self._statistics(every))
        alike = Statistics({part: np.full(len(self), scale) for part, scale in own.items()})
        out, shares = fuse(distances, own, alike)
        nearest = np.argsort(out, kind="stable")[:CANDIDATES]
        if place is not None and place not in nearest:
            nearest[-1] = place
        chosen = np.sort(nearest)
        among = {part: found[chosen] for part, found in distances.items()}
        exact = fuse(among, own, self._statistics(chosen))
        others = np.setdiff1d(np.arange(len(self)), chosen)
        out[others] += exact.dissimilarities.max() - out[others].min()
        out[chosen] = exact.dissimilarities
        for part, share in exact.shares.items():
            shares[part][chosen] = share
        return chosen, Fused(out, shares)

    def _to_all(self, part: str, query: Floats, measure: str) -> Array:
        comparison = descriptor_named(part).comparison
        rows = comparison.rows(np.float32(query), part)
        return np.concatenate([
            np.empty(0),
            *(comparison.one_to_many(rows, self._kept[part].stack(first, min(first + _CHUNK, len(self))), measure)
              for first in range(0, len(self), _CHUNK)),
        ])  # fmt: skip

    @cached_property
    def _references(self) -> npt.NDArray[np.int64]:
        """A fair sample that hardly changes when shapes come and go: those whose ids have the smallest checksums."""
        order = np.argsort([crc32(id.encode()) for id in self.ids], kind="stable")
        return np.sort(order[:REFERENCES])

    def _statistics(self, places: npt.NDArray[np.int64]) -> Statistics:
        """Of these shapes."""
        at = {int(place): row for row, place in enumerate(places)}
        references = np.array([at.get(int(place), -1) for place in self._references], dtype=np.int64)
        return statistics(self._distances(places), references)

    @cached_property
    def _fused(self) -> Array:
        """Of all pairs; for no more shapes than there may be references."""
        every = np.arange(len(self))
        return fused_matrix(self._distances(every), self._statistics(every))

    def _distances(self, places: npt.NDArray[np.int64]) -> Mapping[str, Array]:
        """part -> (k, r), of these shapes to the references; what this or an earlier snapshot knows stays known.

        When the references change, what is known of other shapes is forgotten: a change of all must not be paid for
        at once.
        """
        with self._lock:
            if self._awaited is not None:
                before, lost = self._awaited
                with before._lock:
                    self._known, self._awaited = before._known_without(lost), None
            references = tuple(self.ids[place] for place in self._references)
            ids = [self.ids[place] for place in places]
            row_of = {id: row for row, id in enumerate(self._known.ids)}
            if not self._known.distances or self._known.references != references:
                found = {part: self._completed(part, measure, places) for part, measure in self.ranking.parts.items()}
                self._known = _Known(tuple(ids), references, found)
                return found
            missing = [place for place, id in zip(places, ids, strict=True) if id not in row_of]
            if missing:
                new = np.array(missing, dtype=np.int64)
                found = {
                    part: np.concatenate([self._known.distances[part], self._completed(part, measure, new)])
                    for part, measure in self.ranking.parts.items()
                }
                known = (*self._known.ids, *(self.ids[place] for place in missing))
                self._known = _Known(known, references, found)
                row_of = {id: row for row, id in enumerate(known)}
            rows = [row_of[id] for id in ids]
            return {part: found[rows] for part, found in self._known.distances.items()}

    def _completed(self, part: str, measure: str, places: npt.NDArray[np.int64]) -> Array:
        """Of one part, of these shapes to the references, from what is known of it."""
        one_to_many = descriptor_named(part).comparison.one_to_many
        out = np.empty((len(places), len(self._references)))
        ids = [self.ids[place] for place in places]
        columns, old_columns = _common(self._known.references, [self.ids[place] for place in self._references])
        rows, old_rows = _common(self._known.ids, ids) if columns else ([], [])
        if rows:
            out[np.ix_(rows, columns)] = self._known.distances[part][np.ix_(old_rows, old_columns)]
        stack = self._kept[part].taken(places).stack()
        new = np.setdiff1d(np.arange(len(places)), rows)
        if len(new):
            among = self._kept[part].taken(self._references).stack()
            for row in new:
                out[row] = one_to_many(_rows_of(stack, row), among, measure)
        if rows:
            of_known = self._kept[part].taken(places[rows]).stack()
            for column in np.setdiff1d(np.arange(len(self._references)), columns):
                reference = self._kept[part].taken(self._references[[column]]).stack().values
                out[rows, column] = one_to_many(reference, of_known, measure)
        return out

    def _hand_on(self, after: Gallery, lost: frozenset[str]) -> None:
        """Give a later snapshot what is known; where it is just being measured, let that one wait for it if it must."""
        if not self._lock.acquire(blocking=False):
            after._awaited = (self, lost)
            return
        try:
            if self._awaited is None:
                after._known = self._known_without(lost)
            else:
                before, earlier = self._awaited
                after._awaited = (before, earlier | lost)
        finally:
            self._lock.release()

    def _known_without(self, lost: Collection[str]) -> _Known:
        known = self._known
        rows = [place for place, id in enumerate(known.ids) if id not in lost]
        columns = [place for place, id in enumerate(known.references) if id not in lost]
        if len(rows) == len(known.ids) and len(columns) == len(known.references):
            return known
        return _Known(
            tuple(known.ids[row] for row in rows), tuple(known.references[column] for column in columns),
            {part: found[np.ix_(rows, columns)] for part, found in known.distances.items()},
        )  # fmt: skip

    def _reranked(self, fused: Array, chosen: npt.NDArray[np.int64], place: int | None) -> Array:
        """Re-ranked among the nearest; all others after these, in the order that they had."""
        pairs = self._pairs(chosen)
        out = UNREACHED + fused
        if place is None:
            bordered = np.zeros((len(chosen) + 1, len(chosen) + 1))
            bordered[:-1, :-1] = pairs
            bordered[-1, :-1] = bordered[:-1, -1] = fused[chosen]
            out[chosen] = rerank(bordered, len(chosen))[:-1]
        else:
            out[chosen] = rerank(pairs, int(np.flatnonzero(chosen == place)[0]))
        return out

    def _pairs(self, chosen: npt.NDArray[np.int64]) -> Array:
        """Fused dissimilarities of all pairs of these shapes."""
        if len(self) <= REFERENCES:
            with self._lock:
                return self._fused[np.ix_(chosen, chosen)]
        found = {}
        for part, measure in self.ranking.parts.items():
            stack = self._kept[part].taken(chosen).stack()
            shapes = [_rows_of(stack, shape) for shape in range(stack.shapes)]
            found[part] = descriptor_named(part).comparison.all_pairs(shapes, measure)
        return fused_matrix(found, self._statistics(chosen))


def _copy(distances: Mapping[str, Array]) -> int | None:
    """The first shape that is at distance 0 in every part."""
    same = np.flatnonzero(np.logical_and.reduce([found == 0.0 for found in distances.values()]))
    return int(same[0]) if len(same) else None


def _rows_of(stack: Stack, shape: int) -> Floats:
    return stack.values[stack.offsets[shape] : stack.offsets[shape + 1]]


def _common(before: Sequence[str], now: Sequence[str]) -> tuple[list[int], list[int]]:
    """Of the ids that are in both: their places now, and their places before."""
    old = {id: place for place, id in enumerate(before)}
    both = [(place, old[id]) for place, id in enumerate(now) if id in old]
    return [place for place, _ in both], [place for _, place in both]
