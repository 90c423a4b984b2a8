"""Shapes: meshes in a collection, each set of bytes once.

``add(conn, collection_id, *, sha256, bytes, format, name, filename, label, tags, metadata, owner)
-> (Shape, created)``, ``get(conn, collection_id, shape_id)``, ``by_ids(conn, shape_ids) -> dict``,
``list_page(conn, collection_id, filters, *, limit, cursor, sort) -> Page``, ``count(conn, collection_id, filters)``,
``labels(conn, collection_id) -> [(label, shapes)]``, ``summaries(conn, collection_id, ids) -> {id: (name, label)}``,
``update(conn, collection_id, shape_id, *, name, label, tags, metadata)``, ``label_many(conn, ...)``,
``delete(conn, collection_id, shape_id)``, ``restore(conn, collection_id, shape_id)``, ``purge(conn, keep_seconds)``,
``ids_matching(conn, collection_id, filters) -> frozenset``

``add`` does not queue anything; call ``tasks.enqueue(conn, "describe", ...)`` in the same transaction
when ``created`` is true.

A deleted shape keeps its rows for a while, so that it can be restored; nothing but ``restore`` and
``purge`` sees it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from sqlalchemy import ColumnElement, Connection, Select, func, literal, or_, select, tuple_
from sqlalchemy import delete as delete_from
from sqlalchemy import update as update_rows

from reebase.errors import unknown_name
from store import tasks
from store.errors import InvalidCursor, ShapeExists, ShapeNotFound
from store.records import Filters, Page, Shape
from store.revision import bump
from store.sql import canonical_json, cursor_beyond, insert, new_id, now, values_of_cursor
from store.tables import described, endpoint_features, health, present, shape_metadata, shape_tag, skeleton, tombstone
from store.tables import shape as table

__all__ = [
    "SORTS", "UNSET", "Unset", "add", "by_ids", "count", "delete", "get", "ids_matching", "label_many", "labels",
    "list_page", "purge", "restore", "summaries", "update",
]  # fmt: skip

SORTS = ("created", "name", "label", "endpoints", "bytes")
"""What a list can be sorted by; shapes without a label or a description come first."""

_MANY = 500  # ids in one statement, below every database's limit of parameters
_KEYS: dict[str, tuple[type, ColumnElement[Any]]] = {
    "created": (str, table.c.id),
    "name": (str, func.lower(table.c.name)),
    "label": (str, func.coalesce(func.lower(table.c.label), "")),
    "endpoints": (int, func.coalesce(endpoint_features.c.endpoint_count, -1)),
    "bytes": (int, table.c.bytes),
}


class Unset:
    """The type of UNSET."""

    def __repr__(self) -> str:
        return "UNSET"


UNSET: Final = Unset()
"""Leaves a field as it is, where None would clear it."""


def add(
    conn: Connection, collection_id: str, *, sha256: str, bytes: int, format: str, name: str,
    filename: str | None = None, label: str | None = None, tags: Iterable[str] = (),
    metadata: Mapping[str, Any] | None = None, owner: str | None = None,
) -> tuple[Shape, bool]:  # fmt: skip
    """A new shape, or the one that has these bytes already, as it is; and whether it is new.

    sha256, bytes, format: of the upload, whose blob is already kept. owner: id of an API key.
    """
    values = {
        "id": new_id(), "collection_id": collection_id, "sha256": sha256, "bytes": bytes, "format": format,
        "filename": filename, "name": name, "label": label, "metadata": dict(metadata or {}),
        "state": "queued", "owner": owner, "created_at": now(), "updated_at": now(),
    }  # fmt: skip
    created = conn.execute(
        insert(conn, table)
        .values(values)
        .on_conflict_do_nothing(index_elements=["collection_id", "sha256"], index_where=present)
        .returning(table.c.id)
    ).scalar()
    if created is None:
        same = (table.c.collection_id == collection_id, table.c.sha256 == sha256, present)
        return _read(conn, select(table).where(*same))[0], False
    _write_tags(conn, created, tags)
    _write_metadata(conn, created, metadata or {})
    return get(conn, collection_id, created), True


def get(conn: Connection, collection_id: str, shape_id: str) -> Shape:
    """Raises ShapeNotFound."""
    found = _read(conn, select(table).where(*_named(collection_id, shape_id), present))
    if not found:
        raise ShapeNotFound(f"There is no shape {shape_id[:80]!r} in this collection.")
    return found[0]


def by_ids(conn: Connection, shape_ids: Iterable[str]) -> dict[str, Shape]:
    """Those of the shapes that are there, by id."""
    wanted = list(dict.fromkeys(shape_ids))
    found: dict[str, Shape] = {}
    for start in range(0, len(wanted), _MANY):
        some = select(table).where(table.c.id.in_(wanted[start : start + _MANY]), present)
        found.update((shape.id, shape) for shape in _read(conn, some))
    return found


def list_page(
    conn: Connection,
    collection_id: str,
    filters: Filters | None = None,
    *,
    limit: int = 100,
    cursor: str | None = None,
    sort: str = "created",
) -> Page[Shape]:
    """In the order of ``sort``, one of SORTS, which a "-" before it turns round; equals by age.

    Raises InvalidCursor, UnknownName.
    """
    name = sort.removeprefix("-")
    if name not in SORTS:
        raise unknown_name("order", sort[:80], [*SORTS, *(f"-{known}" for known in SORTS)])
    turned = sort.startswith("-")
    kind, key = _KEYS[name]
    query = _filtered(select(table), collection_id, filters or Filters())
    place = tuple_(key, table.c.id)
    if cursor is not None:
        order, value, shape_id = values_of_cursor(cursor, str, kind, str)
        if order != sort:
            raise InvalidCursor("The cursor is of the same list in another order.", parameter="cursor")
        beyond = tuple_(literal(value), literal(shape_id))
        query = query.where(place < beyond if turned else place > beyond)
    both = (key.desc(), table.c.id.desc()) if turned else (key, table.c.id)
    found = _read(conn, query.order_by(*both).limit(limit + 1))
    items = tuple(found[:limit])
    if len(found) <= limit:
        return Page(items, None)
    last = conn.execute(_joined(select(key)).where(table.c.id == items[-1].id)).scalar_one()
    return Page(items, cursor_beyond(sort, last, items[-1].id))


def count(conn: Connection, collection_id: str, filters: Filters | None = None) -> int:
    """How many shapes the filters let pass."""
    return int(conn.execute(_filtered(select(func.count()), collection_id, filters or Filters())).scalar_one())


def summaries(
    conn: Connection, collection_id: str, shape_ids: Sequence[str]
) -> dict[str, tuple[str, str | None]]:
    """Name and label of those of the shapes that are there, by id."""
    columns = select(table.c.id, table.c.name, table.c.label).where(table.c.collection_id == collection_id, present)
    found: dict[str, tuple[str, str | None]] = {}
    for start in range(0, len(shape_ids), _MANY):
        rows = conn.execute(columns.where(table.c.id.in_(shape_ids[start : start + _MANY])))
        found.update((row.id, (row.name, row.label)) for row in rows)
    return found


def labels(conn: Connection, collection_id: str) -> list[tuple[str | None, int]]:
    """Every label with the number of its shapes, and None with that of shapes without one; most first."""
    number = func.count().label("number")
    rows = conn.execute(
        select(table.c.label, number)
        .where(table.c.collection_id == collection_id, present)
        .group_by(table.c.label)
        .order_by(number.desc(), table.c.label)
    )
    return [(label, count) for label, count in rows]


def ids_matching(conn: Connection, collection_id: str, filters: Filters) -> frozenset[str]:
    """The ids of all shapes that the filters let pass."""
    return frozenset(conn.execute(_filtered(select(table.c.id), collection_id, filters)).scalars())


def update(
    conn: Connection, collection_id: str, shape_id: str, *, name: str | Unset = UNSET,
    label: str | Unset | None = UNSET, tags: Iterable[str] | Unset = UNSET,
    metadata: Mapping[str, Any] | Unset = UNSET,
) -> Shape:  # fmt: skip
    """Changes what is given; tags and metadata are replaced whole. Raises ShapeNotFound."""
    values: dict[str, Any] = {"updated_at": now()}
    if not isinstance(name, Unset):
        values["name"] = name
    if not isinstance(label, Unset):
        values["label"] = label
    if not isinstance(metadata, Unset):
        values["metadata"] = dict(metadata)
    which = update_rows(table).where(*_named(collection_id, shape_id), present)
    if not conn.execute(which.values(values)).rowcount:
        raise ShapeNotFound(f"There is no shape {shape_id[:80]!r} in this collection.")
    if not isinstance(tags, Unset):
        conn.execute(delete_from(shape_tag).where(shape_tag.c.shape_id == shape_id))
        _write_tags(conn, shape_id, tags)
    if not isinstance(metadata, Unset):
        conn.execute(delete_from(shape_metadata).where(shape_metadata.c.shape_id == shape_id))
        _write_metadata(conn, shape_id, metadata)
    return get(conn, collection_id, shape_id)


def label_many(conn: Connection, collection_id: str, shape_ids: Sequence[str], label: str | None) -> int:
    """Gives all of the shapes one label, or none; says how many are there."""
    mine = (table.c.collection_id == collection_id, present)
    return sum(
        conn.execute(
            update_rows(table)
            .where(table.c.id.in_(shape_ids[start : start + _MANY]), *mine)
            .values(label=label, updated_at=now())
        ).rowcount
        for start in range(0, len(shape_ids), _MANY)
    )


def delete(conn: Connection, collection_id: str, shape_id: str) -> Shape:
    """Takes the shape away and cancels its live tasks; ``restore`` brings it back until it is purged.

    Returns what it was. Raises ShapeNotFound.
    """
    shape = get(conn, collection_id, shape_id)
    tasks.cancel_live(conn, shape_id=shape_id)
    conn.execute(update_rows(table).where(table.c.id == shape_id).values(deleted_at=now()))
    conn.execute(
        insert(conn, tombstone).values(
            shape_id=shape_id, collection_id=collection_id, revision=bump(conn), deleted_at=now()
        )
    )
    return shape


def restore(conn: Connection, collection_id: str, shape_id: str) -> Shape:
    """Brings a deleted shape back; one that is there is left as it is.

    What is described under the collection's present profile is indexed; else it is queued to be described, unless
    that failed. Raises
    ShapeNotFound once it is purged, ShapeExists when its bytes were uploaded again meanwhile.
    """
    named = _named(collection_id, shape_id)
    found = conn.execute(select(table.c.sha256, table.c.deleted_at, table.c.state).where(*named)).first()
    if found is None:
        raise ShapeNotFound(f"There is no shape {shape_id[:80]!r} in this collection, nor can one be restored.")
    if found.deleted_at is None:
        return get(conn, collection_id, shape_id)
    same = (table.c.collection_id == collection_id, table.c.sha256 == found.sha256, present)
    other = conn.execute(select(table.c.id).where(*same)).scalar()
    if other is not None:
        raise ShapeExists(shape=other)
    conn.execute(update_rows(table).where(*named).values(deleted_at=None, updated_at=now()))
    conn.execute(delete_from(tombstone).where(tombstone.c.shape_id == shape_id))
    # A new revision, so that the indexes in memory take it up again.
    mine = update_rows(endpoint_features).where(endpoint_features.c.shape_id == shape_id)
    conn.execute(mine.values(revision=bump(conn)))
    # It may have been deleted while it was described anew.
    if conn.execute(update_rows(table).where(*named, described).values(state="indexed")).rowcount:
        return get(conn, collection_id, shape_id)
    if found.state != "failed":
        tasks.enqueue(conn, "describe", collection_id=collection_id, shape_id=shape_id)
    return get(conn, collection_id, shape_id)


def purge(conn: Connection, keep_seconds: float) -> int:
    """Deletes for good what was deleted longer ago; its blobs are left to the sweep. Says how many."""
    return conn.execute(delete_from(table).where(table.c.deleted_at < now(-keep_seconds))).rowcount


def _named(collection_id: str, shape_id: str) -> tuple[ColumnElement[bool], ColumnElement[bool]]:
    return table.c.id == shape_id, table.c.collection_id == collection_id


def _filtered(query: Select[Any], collection_id: str, filters: Filters) -> Select[Any]:
    query = query.where(table.c.collection_id == collection_id, present)
    for name in ("label", "state", "sha256"):
        value = getattr(filters, name)
        if value is not None:
            query = query.where(table.c[name] == value)
    if filters.unlabelled:
        query = query.where(table.c.label.is_(None))
    if filters.text:
        columns = (table.c.name, table.c.filename, table.c.label)
        query = query.where(or_(*(column.icontains(filters.text, autoescape=True) for column in columns)))
    for tag in filters.tags:
        query = query.where(table.c.id.in_(select(shape_tag.c.shape_id).where(shape_tag.c.tag == tag)))
    for key, value in filters.metadata.items():
        same = (shape_metadata.c.key == key, shape_metadata.c.value == _comparable(value))
        query = query.where(table.c.id.in_(select(shape_metadata.c.shape_id).where(*same)))
    return query


def _read(conn: Connection, query: Select[Any]) -> list[Shape]:
    described = (
        _joined(query)
        .outerjoin(health, health.c.shape_id == table.c.id)
        .outerjoin(skeleton, skeleton.c.shape_id == table.c.id)
        .add_columns(endpoint_features.c.endpoint_count, health.c.report, skeleton.c.thumbnail_sha256)
    )
    rows = conn.execute(described).mappings().all()
    tags: dict[str, list[str]] = {row["id"]: [] for row in rows}
    named = select(shape_tag).where(shape_tag.c.shape_id.in_(tags)).order_by(shape_tag.c.tag)
    for shape_id, tag in conn.execute(named):
        tags[shape_id].append(tag)
    return [
        Shape(
            **{column.name: row[column.name] for column in table.columns},
            tags=tuple(tags[row["id"]]),
            endpoint_count=row["endpoint_count"],
            flags=tuple((row["report"] or {}).get("flags", ())),
            thumbnail_sha256=row["thumbnail_sha256"],
        )
        for row in rows
    ]


def _joined(query: Select[Any]) -> Select[Any]:
    return query.select_from(table).outerjoin(endpoint_features, endpoint_features.c.shape_id == table.c.id)


def _write_tags(conn: Connection, shape_id: str, tags: Iterable[str]) -> None:
    rows = [{"shape_id": shape_id, "tag": tag} for tag in dict.fromkeys(tags)]
    if rows:
        conn.execute(insert(conn, shape_tag), rows)


def _write_metadata(conn: Connection, shape_id: str, metadata: Mapping[str, Any]) -> None:
    rows = [{"shape_id": shape_id, "key": k, "value": _comparable(v)} for k, v in metadata.items()]
    if rows:
        conn.execute(insert(conn, shape_metadata), rows)


def _comparable(value: Any) -> str:
    return canonical_json(_plain(value))


def _plain(value: Any) -> Any:
    """JSON has one kind of number: 1 and 1.0 are the same value."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_plain(inner) for inner in value]
    return value
