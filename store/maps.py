"""The map of a collection: what it is of, the latest one, and whether shapes came or went since.

``mapped(conn, collection, ranking) -> Mapped``: what a map is made of
``stamp(conn, collection) -> [revision, shapes]``: equal stamps mean equal sets of descriptions
``latest(conn, collection_id, descriptor) -> (newest task, newest that succeeded)``
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from sqlalchemy import Connection, func, select

from reebase.embedding import MOST
from reebase.ranking import Ranking
from store import descriptors
from store.records import Collection, Task
from store.tables import endpoint_features, present, shape
from store.tables import task as table
from store.tasks import task_of_row

__all__ = ["Mapped", "latest", "mapped", "stamp"]


@dataclass(frozen=True, eq=False)
class Mapped:
    """The shapes that a map shows, by id. kept: of each part of the ranking, as long.

    left_out: how many more there are. stamp: of the set.
    """

    ids: list[str]
    kept: dict[str, list[npt.NDArray[np.floating[Any]]]]
    left_out: int
    stamp: list[int]


def stamp(conn: Connection, collection: Collection) -> list[int]:
    """The newest revision among the collection's descriptions, and their number.

    Whatever comes or changes has a newer revision, and what goes lowers the number.
    """
    rows = endpoint_features
    found = conn.execute(
        select(func.coalesce(func.max(rows.c.revision), 0), func.count())
        .join(shape, shape.c.id == rows.c.shape_id)
        .where(rows.c.collection_id == collection.id, rows.c.profile_key == collection.profile_key, present)
    ).one()
    return [int(found[0]), int(found[1])]


def mapped(conn: Connection, collection: Collection, ranking: Ranking) -> Mapped:
    """Of more shapes than a map holds a sample is taken that stays the same as others come and go."""
    parts = tuple(ranking.parts)
    found = Mapped([], {part: [] for part in parts}, 0, stamp(conn, collection))
    rows = endpoint_features
    ids = (
        select(rows.c.shape_id)
        .join(shape, shape.c.id == rows.c.shape_id)
        .where(rows.c.collection_id == collection.id, rows.c.profile_key == collection.profile_key, present)
    )
    chosen = sorted(conn.execute(ids).scalars(), key=_drawn)[:MOST]
    among = endpoint_features.c.shape_id.in_(chosen)
    for one in descriptors.described(conn, parts, collection.profile_key, among):
        if len(one.kept) == len(parts):
            found.ids.append(one.shape_id)
            for part, kept in one.kept.items():
                found.kept[part].append(kept)
    return Mapped(found.ids, found.kept, found.stamp[1] - len(found.ids), found.stamp)


def latest(conn: Connection, collection_id: str, descriptor: str) -> tuple[Task | None, Task | None]:
    """The newest task that maps the collection by this descriptor, and the newest that succeeded."""
    newest = (
        select(table)
        .where(table.c.collection_id == collection_id, table.c.kind == "map")
        .order_by(table.c.id.desc())
    )
    first = done = None
    for row in conn.execute(newest.limit(100)).mappings():
        task = task_of_row(row)
        if task.params.get("descriptor") != descriptor:
            continue
        first = first or task
        if task.state == "succeeded":
            done = task
            break
    return first, done


def _drawn(shape_id: str) -> bytes:
    return hashlib.blake2b(shape_id.encode(), digest_size=8).digest()
