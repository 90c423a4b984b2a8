"""Near-duplicates of a collection: what they are sought by, and the latest findings.

``sought(conn, collection) -> Sought``: the shapes, their signatures and their cleaned meshes
``latest(conn, collection_id) -> (newest task, newest that succeeded)``
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from sqlalchemy import Connection, select

from reebase.duplicates import NUMBERS
from store import descriptors, maps
from store.descriptors import DUPLICATES
from store.records import Collection, Task
from store.tables import endpoint_features, present, shape, skeleton
from store.tables import task as table
from store.tasks import task_of_row

__all__ = ["Sought", "latest", "sought"]


@dataclass(frozen=True, eq=False)
class Sought:
    """Shapes by id. signatures: float64, (n, 102). meshes: the blobs of the cleaned meshes (PLY).

    left_out: described shapes without a signature. stamp: of the set.
    """

    ids: list[str]
    signatures: npt.NDArray[np.float64]
    meshes: list[str]
    left_out: int
    stamp: list[int]


def sought(conn: Connection, collection: Collection) -> Sought:
    """All described shapes that have a signature."""
    mine = endpoint_features.c.collection_id == collection.id
    rows = {
        one.shape_id: one.kept[DUPLICATES][0]
        for one in descriptors.described(conn, [DUPLICATES], collection.profile_key, mine)
        if DUPLICATES in one.kept
    }
    known = select(shape.c.id, skeleton.c.cleaned_sha256).join(skeleton, skeleton.c.shape_id == shape.c.id)
    rows_of = conn.execute(known.where(shape.c.collection_id == collection.id, present))
    found = {row.id: row.cleaned_sha256 for row in rows_of}
    ids = [id for id in rows if id in found]
    stamp = maps.stamp(conn, collection)
    signatures = np.array([rows[id] for id in ids], dtype=np.float64).reshape(len(ids), NUMBERS)
    return Sought(ids, signatures, [found[id] for id in ids], stamp[1] - len(ids), stamp)


def latest(conn: Connection, collection_id: str) -> tuple[Task | None, Task | None]:
    """The newest task that sought duplicates in the collection, and the newest that succeeded."""
    mine = select(table).where(table.c.collection_id == collection_id, table.c.kind == "duplicates")
    newest, done = (
        conn.execute(query.order_by(table.c.id.desc()).limit(1)).mappings().first()
        for query in (mine, mine.where(table.c.state == "succeeded"))
    )
    return None if newest is None else task_of_row(newest), None if done is None else task_of_row(done)
