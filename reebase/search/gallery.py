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
    Ranking,
    Statistics,
    fuse,
    fused_matrix,
    query_scales,
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
    """Of one part: the rows of all shapes in single precision, and where those of each begin."""

    values: npt.NDArray[np.float32]
    offsets: npt.NDArray[np.int64]

    @classmethod
    def of(cls, shapes: Sequence[Array]) -> _Kept:
        stack = Stack.of(shapes)
        return cls(stack.values.astype(np.float32), stack.offsets)

    def stack(self, first: int = 0, last: int | None = None) -> Stack:
        offsets = self.offsets[first : None if last is None else last + 1]
        return Stack(self.values[offsets[0] : offsets[-1]].astype(np.float64), offsets - offsets[0])

    def taken(self, places: npt.NDArray[np.int64]) -> _Kept:
        """Of these shapes, in this order."""
        lengths = np.diff(self.offsets)[places]
        offsets = np.concatenate([[0], np.cumsum(lengths)])
        rows = np.repeat(self.offsets[places] - offsets[:-1], lengths) + np.arange(offsets[-1])
        return _Kept(self.values[rows], offsets)

    def joined(self, other: _Kept) -> _Kept:
        if len(other.offsets) == 1:
            return self
        if len(self.offsets) == 1:
            return other
        return _Kept(
            np.concatenate([self.values, other.values]),
            np.concatenate([self.offsets, self.offsets[-1] + other.offsets[1:]]),
        )


class _Known(NamedTuple):
    """Distances that were computed before: part -> (n, r), of the shapes with these ids to these references."""

    ids: tuple[str, ...]
    references: tuple[str, ...]
    distances: Mapping[str, Array]


class Gallery:
    """A snapshot that never changes; ``changed`` gives the next one. Any number of threads may read it.

    What is kept is held in single precision, as it is stored. For a fused ranking the distances of all shapes to
    at most REFERENCES of them are computed when first needed, and taken over into later snapshots; while there
    are no more shapes than that, these are the distances of all pairs.
    """

    def __init__(self, ranking: Ranking) -> None:
        self.ranking = ranking
        self.ids: tuple[str, ...] = ()
        self._kept = {part: _Kept.of([]) for part in ranking.parts}
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
        held = [array.nbytes for kept in self._kept.values() for array in kept]
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
            new = _Kept.of([rows(np.float32(kept[part]), part) for kept in put.values()])
            after._kept[part] = self._kept[part].taken(stay).joined(new).taken(order)
        self._hand_on(after, frozenset(lost))
        return after

    def rank(self, query: Mapping[str, Floats], id: str | None = None, *, again: bool = False) -> Ranked:
        """Compare a query with every shape. query: what is kept of it by each part. id: its own, where it is here.

        again: re-rank a fused ranking. Exact; of a shape that is here, and of a copy of it, the row of
        ``Ranking.matrix`` of all. Beyond CANDIDATES shapes the nearest so many are re-ranked, and the others come
        after them. Raises ParameterError.
        """
        distances = {part: self._to_all(part, query[part], measure) for part, measure in self.ranking.parts.items()}
        if self.ranking.measure is not None:
            only = distances[self.ranking.name]
            return Ranked(only, distances, {self.ranking.name: np.ones(len(only))})
        place = self.places.get(id) if id is not None else _copy(distances)
        with self._lock:
            known = self._statistics
        if place is None:
            own = query_scales({part: found[self._references] for part, found in distances.items()})
        else:
            own = {part: float(scales[place]) for part, scales in known.scales.items()}
        fused = fuse(distances, own, known)
        found = fused.dissimilarities
        if again and len(self):
            found = self._reranked(found, place)
        return Ranked(found, distances, fused.shares)

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

    @cached_property
    def _statistics(self) -> Statistics:
        return statistics(self._distances(), self._references)

    @cached_property
    def _fused(self) -> Array:
        """Of all pairs; for no more shapes than there may be references."""
        return fused_matrix(self._distances(), self._statistics)

    def _distances(self) -> Mapping[str, Array]:
        """part -> (n, r), the distances to the references; what an earlier snapshot knew is not computed again."""
        with self._lock:
            if self._awaited is not None:
                before, lost = self._awaited
                with before._lock:
                    self._known, self._awaited = before._known_without(lost), None
            references = tuple(self.ids[place] for place in self._references)
            known = self._known
            if not known.distances or (known.ids, known.references) != (self.ids, references):
                found = {part: self._completed(part, measure) for part, measure in self.ranking.parts.items()}
                self._known = _Known(self.ids, references, found)
            return self._known.distances

    def _completed(self, part: str, measure: str) -> Array:
        """Of one part, from what is known of it."""
        one_to_many, stack = descriptor_named(part).comparison.one_to_many, self._kept[part].stack()
        out = np.empty((len(self), len(self._references)))
        rows = [self.places[id] for id in self._known.ids]
        columns, old = _common(self._known.references, [self.ids[place] for place in self._references])
        if columns:
            out[np.ix_(rows, columns)] = self._known.distances[part][:, old]
            among = self._kept[part].taken(self._references[columns]).stack()
            for row in np.setdiff1d(np.arange(len(self)), rows):
                out[row, columns] = one_to_many(_rows_of(stack, row), among, measure)
        for column in np.setdiff1d(np.arange(len(self._references)), columns):
            out[:, column] = one_to_many(_rows_of(stack, self._references[column]), stack, measure)
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
        if len(rows) == len(known.ids):
            return known
        return _Known(
            tuple(known.ids[row] for row in rows), tuple(known.references[column] for column in columns),
            {part: found[np.ix_(rows, columns)] for part, found in known.distances.items()},
        )  # fmt: skip

    def _reranked(self, fused: Array, place: int | None) -> Array:
        """Re-ranked among the nearest; all others after these, in the order that they had."""
        chosen = np.arange(len(self))
        if len(self) > CANDIDATES:
            chosen = np.sort(np.argsort(fused, kind="stable")[:CANDIDATES])
            if place is not None and place not in chosen:
                chosen[-1] = place
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
        return fused_matrix(found, self._statistics.among(chosen))


def _copy(distances: Mapping[str, Array]) -> int | None:
    """The first shape that is at distance 0 in every part."""
    same = np.flatnonzero(np.logical_and.reduce([found == 0.0 for found in distances.values()]))
    return int(same[0]) if len(same) else None


def _rows_of(stack: Stack, shape: int) -> Array:
    return stack.values[stack.offsets[shape] : stack.offsets[shape + 1]]


def _common(before: Sequence[str], now: Sequence[str]) -> tuple[list[int], list[int]]:
    """Of the ids that are in both: their places now, and their places before."""
    old = {id: place for place, id in enumerate(before)}
    both = [(place, old[id]) for place, id in enumerate(now) if id in old]
    return [place for place, _ in both], [place for _, place in both]
