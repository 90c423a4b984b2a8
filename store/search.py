"""Ranking one collection: through the index by D, or through the gallery by any ranking.

``search(follower, collection, spec, query, among) -> Found``
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from reebase.matching import as_features
from reebase.ranking import Ranking
from reebase.search import Index
from store.descriptors import SRG
from store.follower import Hung, IndexFollower
from store.query import Query, QuerySpec
from store.records import Collection

__all__ = ["Found", "Ranked", "search"]


@dataclass(frozen=True)
class Ranked:
    """One shape of an answer. parts: descriptor -> its dissimilarity and its share of the similarity."""

    shape_id: str
    dissimilarity: float
    endpoint_count: int
    parts: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Found:
    """The k best. considered: endpoint count -> shapes that were compared. lacking: how many could not be.

    index: the endpoint features, of the same time or later.
    """

    hits: list[Ranked]
    considered: dict[int, int]
    index: Index
    lacking: int = field(default=0)


def search(
    follower: IndexFollower, collection: Collection, spec: QuerySpec, query: Query, among: frozenset[str] | None
) -> Found:
    """Rank a collection. among: only these shapes may be hits. Raises ParameterError, CollectionNotFound."""
    ranking = spec.ranking
    if ranking.name == SRG:
        return _by_index(follower.index(collection.id, collection.profile_key), spec, ranking, query, among)
    hung = follower.gallery(collection.id, collection.profile_key, ranking)
    index = follower.index(collection.id, collection.profile_key)
    return _by_gallery(hung, index, spec, ranking, query, among)


def _by_index(
    index: Index, spec: QuerySpec, ranking: Ranking, query: Query, among: frozenset[str] | None
) -> Found:
    omega = as_features(query.features)
    itself = None if spec.include_self else spec.shape_id
    if among is not None and itself is not None:
        among, itself = among - {itself}, None
    hits = index.query(
        omega, k=spec.k + (itself is not None), tolerance=spec.tolerance, measure=ranking.measure or "matching",
        among=among, max_dissimilarity=spec.max_dissimilarity,
    )  # fmt: skip
    considered = index.considered(len(omega), tolerance=spec.tolerance, among=among)
    if itself is not None and itself in index:
        hits = [hit for hit in hits if hit.id != itself]
        considered[len(omega)] -= 1
    ranked = [
        Ranked(hit.id, hit.dissimilarity, hit.endpoint_count, {SRG: (hit.dissimilarity, 1.0)}) for hit in hits[: spec.k]
    ]
    return Found(ranked, {count: number for count, number in considered.items() if number}, index)


def _by_gallery(
    hung: Hung, index: Index, spec: QuerySpec, ranking: Ranking, query: Query, among: frozenset[str] | None
) -> Found:
    """Everything is compared, and filtered then: what a hit's dissimilarity is does not depend on the filters."""
    gallery = hung.gallery
    ranked = gallery.rank(query.compared, spec.shape_id, again=ranking.rerank)
    counts = [index.endpoint_count(id) for id in gallery.ids]
    itself = None if spec.include_self else spec.shape_id
    count = len(as_features(query.features))
    allowed = [
        place
        for place, (id, own) in enumerate(zip(gallery.ids, counts, strict=True))
        if own is not None and id != itself and (among is None or id in among)
        and (spec.tolerance is None or abs(own - count) <= spec.tolerance)
    ]  # fmt: skip
    best = _least(ranked.dissimilarities, np.array(allowed, dtype=np.int64), spec.k, spec.max_dissimilarity)
    hits = [
        Ranked(
            gallery.ids[place], float(ranked.dissimilarities[place]), counts[place] or 0,
            {part: (float(ranked.distances[part][place]), float(ranked.shares[part][place])) for part in ranking.parts},
        )
        for place in best
    ]  # fmt: skip
    considered = Counter(counts[place] or 0 for place in allowed)
    lacking = hung.lacking if among is None else hung.lacking & among
    return Found(hits, dict(sorted(considered.items())), index, len(lacking - {itself}))


def _least(
    values: npt.NDArray[np.float64], allowed: npt.NDArray[np.int64], k: int, limit: float | None
) -> list[int]:
    """The places of the k least, ties in the order of the ids."""
    near = allowed if limit is None else allowed[values[allowed] <= limit]
    order = np.argsort(values[near], kind="stable")[:k]
    return [int(place) for place in near[order]]
