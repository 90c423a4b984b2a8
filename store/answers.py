"""The answer to a query: ranked shapes, and for each why it is where it is.

``answer_query(database, follower, spec, mesh=None) -> dict``, for service and worker alike.

The answer, JSON-serialisable::

    {"query": {"shape": id | None, "collection", "descriptor", "measure": str | None, "rerank",
               "endpoint_count", "features", "flags", "positions": {descriptor: [[x, y, z]]}, "k", "tolerance"},
     "hits": [{"rank", "shape": {"id", "name", "label", "tags", "metadata", "filename", "format", "sha256"},
               "dissimilarity", "graph_dissimilarity", "endpoint_count",
               "pairs": [{"query", "hit", "distance"}], "unmatched_query": [{"endpoint", "charge"}],
               "unmatched_hit": [{"endpoint", "charge"}], "note": str | None,
               "parts": [{"descriptor", "measure", "dissimilarity", "share", "matched": None | {"pairs",
                          "unmatched_query", "unmatched_hit", "note", "positions": [[x, y, z]] | None}}]}],
     "considered": n, "buckets": [{"endpoint_count", "shapes"}], "left_out": [{"code", "shapes", "detail"}],
     "took_ms": t}

``dissimilarity`` is what ranks. ``graph_dissimilarity`` is D(G, G~) whatever ranks, and pairs, unmatched and note
are its parts, with endpoints numbered as in the two skeletons' ``endpoints``; those of a part's ``matched`` are
numbered as that descriptor's ``positions``.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.descriptors import Kept, descriptor_named
from reebase.errors import UnknownName
from reebase.matching import Match, match
from store import collections, descriptors, shapes
from store.descriptors import SRG
from store.engine import Database
from store.errors import ProfileChanged
from store.follower import IndexFollower
from store.query import Query, QuerySpec
from store.records import Shape
from store.search import Found, Ranked, search

__all__ = ["answer_query", "shape_summary"]


def answer_query(
    database: Database, follower: IndexFollower, spec: QuerySpec, mesh: Query | None = None
) -> dict[str, Any]:
    """The k nearest shapes with their reasons; see the module's docstring for the form.

    mesh: the query, unless ``spec.shape_id`` names a stored shape. Raises CollectionNotFound, ShapeNotFound,
    ResultNotFound for a shape and ProfileChanged for a mesh that is not described under the collection's
    present profile, ParameterError, UnknownName.
    """
    began = time.perf_counter()
    ranking = spec.ranking
    with database.read() as conn:
        collection = collections.get(conn, spec.collection)
        among = shapes.ids_matching(conn, collection.id, spec.filters) if spec.filters else None
        query = mesh if spec.shape_id is None else Query.stored(conn, collection, spec)
    if query is None:
        raise ValueError("Give either the id of a stored shape or a described mesh.")
    if query.profile_key != collection.profile_key:
        raise ProfileChanged(collection=collection.name)
    found = search(follower, collection, spec, query, among)
    ids = [hit.shape_id for hit in found.hits]
    with database.read() as conn:
        known = shapes.by_ids(conn, ids)
        kept = descriptors.of_shapes(conn, ids, _explained(spec), collection.profile_key)
    hits = [_hit(found, one, spec, query, known, kept.get(one.shape_id, {})) for one in found.hits]
    return {
        "query": {
            "shape": spec.shape_id, "collection": collection.name,
            "descriptor": ranking.name, "measure": ranking.measure, "rerank": ranking.rerank,
            "endpoint_count": len(query.features), "features": query.features.tolist(), "flags": list(query.flags),
            "positions": {
                name: places for name in _explained(spec) if (places := _places(query.kept[name])) is not None
            },
            "k": spec.k, "tolerance": spec.tolerance,
        },
        "hits": [{"rank": rank, **hit} for rank, hit in enumerate(filter(None, hits), start=1)],
        "considered": sum(found.considered.values()),
        "buckets": [{"endpoint_count": count, "shapes": number} for count, number in found.considered.items()],
        "left_out": _left_out(found.lacking, ranking.name),
        "took_ms": round((time.perf_counter() - began) * 1000, 3),
    }  # fmt: skip


def shape_summary(shape: Shape) -> dict[str, Any]:
    """What a hit says about its shape."""
    return {
        "id": shape.id, "name": shape.name, "label": shape.label, "tags": list(shape.tags),
        "metadata": shape.metadata, "filename": shape.filename, "format": shape.format,
        "sha256": shape.sha256,
    }  # fmt: skip


def _explained(spec: QuerySpec) -> list[str]:
    """The parts, beside ``srg``, that say which endpoint went with which."""
    return [name for name in spec.descriptors if descriptor_named(name).comparison.explain is not None]


def _hit(
    found: Found, hit: Ranked, spec: QuerySpec, query: Query, known: Mapping[str, Shape], kept: Mapping[str, Kept]
) -> dict[str, Any] | None:
    """None for a shape that was deleted in the meantime."""
    ranking = spec.ranking
    if hit.shape_id not in known:
        return None
    try:
        measure = (ranking.measure if ranking.name == SRG else None) or "matching"
        reasons = match(query.features, found.index.features_of(hit.shape_id), measure)
    except UnknownName:
        return None
    return {
        "shape": shape_summary(known[hit.shape_id]),
        "dissimilarity": hit.dissimilarity,
        "graph_dissimilarity": reasons.dissimilarity,
        "endpoint_count": hit.endpoint_count,
        **_matched(reasons),
        "note": reasons.note,
        "parts": [
            {
                "descriptor": part, "measure": measure, "dissimilarity": hit.parts[part][0],
                "share": hit.parts[part][1], "matched": _matched_part(part, measure, query, kept),
            }
            for part, measure in ranking.parts.items()
        ],
    }  # fmt: skip


def _matched_part(part: str, measure: str, query: Query, kept: Mapping[str, Kept]) -> dict[str, Any] | None:
    """None for a part that explains nothing, and for one that was described anew in the meantime."""
    if part not in kept:
        return None
    reasons = descriptor_named(part).explain(_wide(query.kept[part]), _wide(kept[part]), measure)
    if reasons is None:
        return None
    return {**_matched(reasons), "note": reasons.note, "positions": _places(kept[part])}


def _wide(kept: Kept) -> npt.NDArray[np.float64]:
    return kept.values.astype(np.float64)


def _places(kept: Kept) -> list[list[float]] | None:
    return None if kept.places is None else kept.places.tolist()


def _matched(reasons: Match) -> dict[str, Any]:
    return {
        "pairs": [{"query": p.first, "hit": p.second, "distance": p.distance} for p in reasons.pairs],
        "unmatched_query": [{"endpoint": u.endpoint, "charge": u.charge} for u in reasons.unmatched_first],
        "unmatched_hit": [{"endpoint": u.endpoint, "charge": u.charge} for u in reasons.unmatched_second],
    }


def _left_out(lacking: int, descriptor: str) -> list[dict[str, Any]]:
    if not lacking:
        return []
    detail = (
        f"They were described before what {descriptor} compares was kept, or could not be described by it; "
        "reindex the collection with it."
    )
    return [{"code": "without_descriptor", "shapes": lacking, "detail": detail}]
