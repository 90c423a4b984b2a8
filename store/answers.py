"""The answer to a query: ranked shapes, and for each why it is where it is.

``answer_query(database, follower, spec, mesh=None) -> dict``, for service and worker alike;
``DescribedMesh``: a query that is no stored shape;
``QuerySpec`` with ``to_params`` and ``from_params`` for a task's ``params``.

The answer, JSON-serialisable::

    {"query": {"shape": id | None, "collection", "endpoint_count", "features", "flags", "measure", "k",
               "tolerance"},
     "hits": [{"rank", "shape": {"id", "name", "label", "tags", "metadata", "filename", "format", "sha256"},
               "dissimilarity", "endpoint_count", "pairs": [{"query", "hit", "distance"}],
               "unmatched_query": [{"endpoint", "charge"}], "unmatched_hit": [{"endpoint", "charge"}],
               "note": str | None}],
     "considered": n, "buckets": [{"endpoint_count", "shapes"}], "took_ms": t}

Endpoints are numbered as in the two skeletons' ``endpoints``.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from sqlalchemy import Connection

from reebase.errors import UnknownName
from reebase.matching import as_features, match
from reebase.pipeline import Description
from reebase.search import Hit, Index
from store import collections, results, shapes
from store.engine import Database
from store.errors import ProfileChanged
from store.follower import IndexFollower
from store.records import Collection, Filters, Shape

__all__ = ["DescribedMesh", "QuerySpec", "answer_query", "shape_summary"]


@dataclass(frozen=True)
class QuerySpec:
    """What is asked. collection: by name. shape_id: the query, or None when its features are given.

    k: at least 1. tolerance: how far endpoint counts may differ, None for any. measure: a name of MEASURES.
    label, tags, metadata: only shapes that have them. max_dissimilarity: only hits with at most this D.
    include_self: whether a stored query shape may be its own hit.
    """

    collection: str
    shape_id: str | None = None
    k: int = 10
    tolerance: int | None = 2
    measure: str = "matching"
    label: str | None = None
    tags: tuple[str, ...] = ()
    metadata: dict[str, Any] = field(default_factory=dict)
    max_dissimilarity: float | None = None
    include_self: bool = False

    def to_params(self) -> dict[str, Any]:
        return {**dataclasses.asdict(self), "tags": list(self.tags)}

    @classmethod
    def from_params(cls, params: Mapping[str, Any]) -> QuerySpec:
        """The inverse of ``to_params``; other keys are left aside."""
        known = {f.name: params[f.name] for f in dataclasses.fields(cls) if f.name in params}
        return cls(**{**known, "tags": tuple(known.get("tags", ()))})

    @property
    def filters(self) -> Filters:
        return Filters(label=self.label, tags=self.tags, metadata=self.metadata)


@dataclass(frozen=True, eq=False)
class DescribedMesh:
    """What is compared of a mesh: its features, (n, 3), under which profile, and what is unusual about it."""

    features: npt.NDArray[np.float64]
    profile_key: str
    flags: tuple[str, ...] = ()

    @classmethod
    def of(cls, description: Description) -> DescribedMesh:
        return cls(description.features, description.profile.key, description.health.flags)


def answer_query(
    database: Database,
    follower: IndexFollower,
    spec: QuerySpec,
    mesh: DescribedMesh | None = None,
) -> dict[str, Any]:
    """The k nearest shapes with their reasons; see the module's docstring for the form.

    mesh: the query, unless ``spec.shape_id`` names a stored shape. Raises CollectionNotFound, ShapeNotFound,
    ResultNotFound for a shape and ProfileChanged for a mesh that is not described under the collection's
    present profile, ParameterError, UnknownName.
    """
    began = time.perf_counter()
    with database.read() as conn:
        collection = collections.get(conn, spec.collection)
        among = shapes.ids_matching(conn, collection.id, spec.filters) if spec.filters else None
        if spec.shape_id is not None:
            mesh = _stored(conn, collection, spec.shape_id)
    if mesh is None:
        raise ValueError("Give either the id of a stored shape or a described mesh.")
    if mesh.profile_key != collection.profile_key:
        raise ProfileChanged(collection=collection.name)
    omega = as_features(mesh.features)
    index = follower.index(collection.id, collection.profile_key)
    hits, considered = _search(index, omega, spec, among)
    with database.read() as conn:
        found = shapes.by_ids(conn, [hit.id for hit in hits])
    explained = [_explain(index, omega, spec.measure, hit, found) for hit in hits]
    return {
        "query": {
            "shape": spec.shape_id,
            "collection": collection.name,
            "endpoint_count": len(omega),
            "features": omega.tolist(),
            "flags": list(mesh.flags),
            "measure": spec.measure,
            "k": spec.k,
            "tolerance": spec.tolerance,
        },
        "hits": [{"rank": rank, **hit} for rank, hit in enumerate(filter(None, explained), start=1)],
        "considered": sum(considered.values()),
        "buckets": [{"endpoint_count": count, "shapes": number} for count, number in considered.items()],
        "took_ms": round((time.perf_counter() - began) * 1000, 3),
    }


def shape_summary(shape: Shape) -> dict[str, Any]:
    """What a hit says about its shape."""
    return {
        "id": shape.id, "name": shape.name, "label": shape.label, "tags": list(shape.tags),
        "metadata": shape.metadata, "filename": shape.filename, "format": shape.format,
        "sha256": shape.sha256,
    }  # fmt: skip


def _stored(conn: Connection, collection: Collection, shape_id: str) -> DescribedMesh:
    shape = shapes.get(conn, collection.id, shape_id)
    found = results.features(conn, shape_id)
    if found.profile_key != collection.profile_key:
        raise results.not_described(
            conn, shape_id, "The shape is not described under the collection's present profile."
        )
    return DescribedMesh(found.features, found.profile_key, shape.flags)


def _search(
    index: Index, omega: npt.NDArray[np.float64], spec: QuerySpec, among: frozenset[str] | None
) -> tuple[list[Hit], dict[int, int]]:
    """The hits, and by endpoint count how many shapes were compared."""
    itself = None if spec.include_self else spec.shape_id
    if among is not None and itself is not None:
        among, itself = among - {itself}, None
    hits = index.query(
        omega, k=spec.k + (itself is not None), tolerance=spec.tolerance, measure=spec.measure, among=among,
        max_dissimilarity=spec.max_dissimilarity,
    )  # fmt: skip
    considered = index.considered(len(omega), tolerance=spec.tolerance, among=among)
    if itself is not None and itself in index:
        hits = [hit for hit in hits if hit.id != itself]
        considered[len(omega)] -= 1
    return hits[: spec.k], {count: number for count, number in considered.items() if number}


def _explain(
    index: Index, omega: npt.NDArray[np.float64], measure: str, hit: Hit, found: Mapping[str, Shape]
) -> dict[str, Any] | None:
    """None for a shape that was deleted in the meantime."""
    if hit.id not in found:
        return None
    try:
        reasons = match(omega, index.features_of(hit.id), measure)
    except UnknownName:
        return None
    return {
        "shape": shape_summary(found[hit.id]),
        "dissimilarity": hit.dissimilarity,
        "endpoint_count": hit.endpoint_count,
        "pairs": [{"query": p.first, "hit": p.second, "distance": p.distance} for p in reasons.pairs],
        "unmatched_query": [{"endpoint": u.endpoint, "charge": u.charge} for u in reasons.unmatched_first],
        "unmatched_hit": [{"endpoint": u.endpoint, "charge": u.charge} for u in reasons.unmatched_second],
        "note": reasons.note,
    }
