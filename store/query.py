"""What is asked of a collection, and by what.

``QuerySpec`` with ``to_params`` and ``from_params`` for a task's ``params``;
``Query``: what is compared; ``Query.stored(conn, collection, spec)`` of a shape, ``Query.of(description, ...)`` of
a mesh.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from sqlalchemy import Connection

from reebase.descriptors import Kept
from reebase.errors import ComputationError
from reebase.pipeline import Description
from reebase.ranking import Ranking, ranking_named
from store import descriptors, results, shapes
from store.descriptors import SRG
from store.errors import ResultNotFound
from store.records import Collection, Filters

__all__ = ["Query", "QuerySpec"]


@dataclass(frozen=True)
class QuerySpec:
    """What is asked. collection: by name. shape_id: the query, or None when a mesh is.

    k: at least 1. tolerance: how far endpoint counts may differ, None for any. descriptor, measure, rerank: see
    ``reebase.ranking.ranking_named``.
    label, tags, metadata: only shapes that have them. max_dissimilarity: only hits at most so far.
    include_self: whether a stored query shape may be its own hit.
    """

    collection: str
    shape_id: str | None = None
    k: int = 10
    tolerance: int | None = 2
    measure: str | None = None
    label: str | None = None
    tags: tuple[str, ...] = ()
    metadata: dict[str, Any] = field(default_factory=dict)
    max_dissimilarity: float | None = None
    include_self: bool = False
    descriptor: str = SRG
    rerank: bool | None = None

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

    @property
    def ranking(self) -> Ranking:
        """Raises UnknownName, ParameterError."""
        return ranking_named(self.descriptor, self.measure, self.rerank)

    @property
    def descriptors(self) -> tuple[str, ...]:
        """What must be kept of a query beside its endpoint features."""
        return tuple(part for part in self.ranking.parts if part != SRG)


@dataclass(frozen=True, eq=False)
class Query:
    """What is compared: endpoint features, (n, 3), and what further descriptors keep; under which profile; and what is
    unusual about the mesh.
    """

    features: npt.NDArray[np.float64]
    profile_key: str
    flags: tuple[str, ...] = ()
    kept: Mapping[str, Kept] = field(default_factory=dict)

    @cached_property
    def compared(self) -> dict[str, npt.NDArray[np.floating[Any]]]:
        """By descriptor, as a gallery wants it."""
        return {SRG: self.features, **{name: one.values for name, one in self.kept.items()}}

    @classmethod
    def of(
        cls, description: Description, kept: Mapping[str, Kept] | None = None,
        refused: Mapping[str, Mapping[str, Any]] | None = None,
    ) -> Query:  # fmt: skip
        """A mesh. refused: the descriptors that could not describe it, each with its ``detail``.

        Raises ComputationError where there are any: without them it cannot be ranked.
        """
        for name, why in (refused or {}).items():
            raise ComputationError(f"{name} could not describe the mesh: {why['detail']}", descriptor=name)
        return cls(description.features, description.profile.key, description.health.flags, kept or {})

    @classmethod
    def stored(cls, conn: Connection, collection: Collection, spec: QuerySpec) -> Query:
        """The shape of a spec. Raises ShapeNotFound, and ResultNotFound when it lacks what is compared."""
        shape_id = spec.shape_id or ""
        shape = shapes.get(conn, collection.id, shape_id)
        found = results.features(conn, shape_id)
        if found.profile_key != collection.profile_key:
            raise results.not_described(
                conn, shape_id, "The shape is not described under the collection's present profile."
            )
        kept = descriptors.of_shapes(conn, [shape_id], spec.descriptors, found.profile_key).get(shape_id, {})
        if missing := [name for name in spec.descriptors if name not in kept]:
            raise _without(conn, shape_id, shape.state, missing)
        return cls(found.features, found.profile_key, shape.flags, kept)


def _without(conn: Connection, shape_id: str, state: str, missing: list[str]) -> ResultNotFound:
    names = ", ".join(missing)
    if state != "indexed":
        return results.not_described(conn, shape_id, f"The shape has no {names} yet.")
    return ResultNotFound(
        f"The shape has no {names}: it was described before that was kept, or could not be described by it. "
        "Reindex the collection with it, or rank by srg.",
        shape=shape_id, state=state, descriptors=missing,
    )  # fmt: skip
