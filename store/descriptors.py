"""What descriptors keep of each shape: rows of float32 by name and version.

``write(conn, shape_id, profile_key, kept)``, ``names_of(conn, shape_id)``;
``of_shapes(conn, ids, names, profile_key) -> {id: {name: Kept}}``;
``described(conn, names, profile_key, *where) -> Iterator[Described]``, shape by shape and in bounded memory;
``coverage(conn, collection, names) -> {name: shapes that have it}``, ``lacking(conn, collection, names) -> [id]``,
``check_any(conn, collection, names)`` raises NothingToCompare

``srg`` is not among them: it is the endpoint features, which every described shape has; the functions that read
give these for it. A row is of the pipeline's version and parameters and of the descriptor's own version, and no
other is read.
"""

from __future__ import annotations

from collections.abc import Collection as Some
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from sqlalchemy import ColumnElement, Connection, and_, delete, exists, false, func, or_, select

from reebase.descriptors import Kept, descriptor_named
from reebase.duplicates.signature import VERSION as SIGNATURE
from store.errors import NothingToCompare
from store.records import Collection
from store.sql import insert
from store.tables import descriptor as table
from store.tables import endpoint_features, present, shape, task

__all__ = [
    "DUPLICATES", "SRG", "Described", "check_any", "coverage", "described", "lacking", "names_of", "of_shapes", "write",
]  # fmt: skip

SRG = "srg"
DUPLICATES = "duplicates"
"""What near-duplicates are sought by: it is kept as a descriptor is, and ranks nothing."""

_MANY = 500  # ids in one statement


class Described(NamedTuple):
    """A described shape. current: whether under the profile that was asked for. kept: of the names asked for, those
    that are there: (k, w) each.
    """

    shape_id: str
    current: bool
    kept: dict[str, npt.NDArray[np.floating[Any]]]


def write(conn: Connection, shape_id: str, profile_key: str, kept: Mapping[str, Kept]) -> None:
    """In place of all that was kept of the shape."""
    conn.execute(delete(table).where(table.c.shape_id == shape_id))
    rows = [
        {
            "shape_id": shape_id, "name": name, "version": _version(name, profile_key),
            "width": one.values.shape[1], "values": one.values.astype("<f4").tobytes(),
            "positions": None if one.places is None else one.places.astype("<f4").tobytes(),
        }
        for name, one in kept.items()
    ]  # fmt: skip
    if rows:
        conn.execute(insert(conn, table), rows)


def of_shapes(
    conn: Connection, ids: Sequence[str], names: Some[str], profile_key: str
) -> dict[str, dict[str, Kept]]:
    """By id and name, of the shapes that have any; ``srg`` is none of these."""
    found: dict[str, dict[str, Kept]] = {}
    columns = (table.c.shape_id, table.c.name, table.c.width, table.c["values"], table.c.positions)
    for start in range(0, len(ids), _MANY):
        some = table.c.shape_id.in_(ids[start : start + _MANY])
        for row in conn.execute(select(*columns).where(some, _present_version(names, profile_key))):
            values = np.frombuffer(row.values, dtype="<f4").reshape(-1, row.width)
            places = None if row.positions is None else np.frombuffer(row.positions, dtype="<f4").reshape(-1, 3)
            found.setdefault(row.shape_id, {})[row.name] = Kept(values, places)
    return found


def described(
    conn: Connection, names: Some[str], profile_key: str, *where: ColumnElement[bool]
) -> Iterator[Described]:
    """All described shapes, in the order of their ids. where: on ``endpoint_features`` and ``shape``."""
    rows = endpoint_features
    found = conn.execute(
        select(rows.c.shape_id, rows.c.profile_key, rows.c.features)
        .join(shape, shape.c.id == rows.c.shape_id)
        .where(present, *where)
        .order_by(rows.c.shape_id)
    )
    for part in found.partitions(_MANY):
        kept = of_shapes(conn, [row.shape_id for row in part], names, profile_key)
        for row in part:
            current = row.profile_key == profile_key
            own = {name: one.values for name, one in kept.get(row.shape_id, {}).items()} if current else {}
            if current and SRG in names:
                own[SRG] = np.frombuffer(row.features, dtype="<f8").reshape(-1, 3)
            yield Described(row.shape_id, current, own)


def names_of(conn: Connection, shape_id: str) -> frozenset[str]:
    """Of which descriptors something is kept of the shape, of whatever version."""
    return frozenset(conn.execute(select(table.c.name).where(table.c.shape_id == shape_id)).scalars())


def coverage(conn: Connection, collection: Collection, names: Some[str]) -> dict[str, int]:
    """How many shapes that are described under the present profile have each of these, of its present version."""
    query = (
        select(table.c.name, func.count().label("shapes"))
        .join(endpoint_features, endpoint_features.c.shape_id == table.c.shape_id)
        .join(shape, shape.c.id == table.c.shape_id)
        .where(_present_version(names, collection.profile_key), *_described_in(collection))
        .group_by(table.c.name)
    )
    counted: dict[str, int] = {row.name: row.shapes for row in conn.execute(query)}
    rows = endpoint_features.join(shape, shape.c.id == endpoint_features.c.shape_id)
    every = select(func.count()).select_from(rows).where(*_described_in(collection))
    counted[SRG] = conn.execute(every).scalar_one()
    return {name: counted.get(name, 0) for name in names}


def check_any(conn: Connection, collection: Collection, names: Some[str]) -> None:
    """Raises NothingToCompare when the described shapes of the collection lack one of these, all of them."""
    found = coverage(conn, collection, {SRG, *names})
    missing = sorted(name for name, shapes in found.items() if shapes == 0)
    if found[SRG] and missing:
        raise NothingToCompare(
            f"None of the {found[SRG]} described shapes has {', '.join(missing)}. Reindex the collection with "
            "descriptors that it should have.",
            descriptors=missing,
        )


def lacking(conn: Connection, collection: Collection, names: Some[str]) -> list[str]:
    """The shapes that are described under the present profile without all of these, and wait for no description."""
    stored = [name for name in names if name != SRG]
    here = and_(table.c.shape_id == shape.c.id, _present_version(stored, collection.profile_key))
    counted = select(func.count()).select_from(table).where(here).correlate(shape).scalar_subquery()
    waiting = exists().where(
        task.c.shape_id == shape.c.id, task.c.kind == "describe", task.c.state.in_(("queued", "running"))
    )
    return list(
        conn.execute(
            select(shape.c.id)
            .join(endpoint_features, endpoint_features.c.shape_id == shape.c.id)
            .where(*_described_in(collection), counted < len(stored), ~waiting)
            .order_by(shape.c.id)
        ).scalars()
    )


def _described_in(collection: Collection) -> tuple[ColumnElement[bool], ...]:
    rows = endpoint_features
    return (rows.c.collection_id == collection.id, rows.c.profile_key == collection.profile_key, present)


def _present_version(names: Some[str], profile_key: str) -> ColumnElement[bool]:
    return or_(false(), *(
        and_(table.c.name == name, table.c.version == _version(name, profile_key)) for name in names if name != SRG
    ))  # fmt: skip


def _version(name: str, profile_key: str) -> str:
    return f"{profile_key}.{SIGNATURE if name == DUPLICATES else descriptor_named(name).version}"
