"""Shapes: meshes in a collection, each set of bytes once.

``add(conn, collection_id, *, sha256, bytes, format, name, filename, label, tags, metadata, owner)
-> (Shape, created)``, ``get(conn, collection_id, shape_id)``, ``by_ids(conn, shape_ids) -> dict``,
``list_page(conn, collection_id, filters, *, limit, cursor) -> Page``,
``update(conn, collection_id, shape_id, *, name, label, tags, metadata)``, ``delete(...)``,
``ids_matching(conn, collection_id, filters) -> frozenset``

``add`` does not queue anything; call ``tasks.enqueue(conn, "describe", ...)`` in the same transaction
when ``created`` is true.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

from sqlalchemy import Connection, Select, select
from sqlalchemy import delete as delete_from
from sqlalchemy import update as update_rows

from store import tasks
from store.errors import ShapeNotFound
from store.records import Filters, Page, Shape
from store.revision import bump
from store.sql import canonical_json, cursor_after, id_of_cursor, insert, new_id, now
from store.tables import endpoint_features, health, shape_metadata, shape_tag, tombstone
from store.tables import shape as table

__all__ = ["UNSET", "Unset", "add", "by_ids", "delete", "get", "ids_matching", "list_page", "update"]

_MANY = 500  # ids in one statement, below every database's limit of parameters


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
        .on_conflict_do_nothing(index_elements=["collection_id", "sha256"])
        .returning(table.c.id)
    ).scalar()
    if created is None:
        same = (table.c.collection_id == collection_id, table.c.sha256 == sha256)
        return _read(conn, select(table).where(*same))[0], False
    _write_tags(conn, created, tags)
    _write_metadata(conn, created, metadata or {})
    return get(conn, collection_id, created), True


def get(conn: Connection, collection_id: str, shape_id: str) -> Shape:
    """Raises ShapeNotFound."""
    found = _read(conn, select(table).where(table.c.id == shape_id, table.c.collection_id == collection_id))
    if not found:
        raise ShapeNotFound(f"There is no shape {shape_id[:80]!r} in this collection.")
    return found[0]


def by_ids(conn: Connection, shape_ids: Iterable[str]) -> dict[str, Shape]:
    """Those of the shapes that are there, by id."""
    wanted = list(dict.fromkeys(shape_ids))
    found: dict[str, Shape] = {}
    for start in range(0, len(wanted), _MANY):
        some = select(table).where(table.c.id.in_(wanted[start : start + _MANY]))
        found.update((shape.id, shape) for shape in _read(conn, some))
    return found


def list_page(
    conn: Connection,
    collection_id: str,
    filters: Filters | None = None,
    *,
    limit: int = 100,
    cursor: str | None = None,
) -> Page[Shape]:
    """Oldest first. Raises InvalidCursor."""
    query = _filtered(select(table), collection_id, filters or Filters())
    if cursor is not None:
        query = query.where(table.c.id > id_of_cursor(cursor))
    found = _read(conn, query.order_by(table.c.id).limit(limit + 1))
    items = tuple(found[:limit])
    return Page(items, cursor_after(items[-1].id) if len(found) > limit else None)


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
    which = (table.c.id == shape_id, table.c.collection_id == collection_id)
    if not conn.execute(update_rows(table).where(*which).values(values)).rowcount:
        raise ShapeNotFound(f"There is no shape {shape_id[:80]!r} in this collection.")
    if not isinstance(tags, Unset):
        conn.execute(delete_from(shape_tag).where(shape_tag.c.shape_id == shape_id))
        _write_tags(conn, shape_id, tags)
    if not isinstance(metadata, Unset):
        conn.execute(delete_from(shape_metadata).where(shape_metadata.c.shape_id == shape_id))
        _write_metadata(conn, shape_id, metadata)
    return get(conn, collection_id, shape_id)


def delete(conn: Connection, collection_id: str, shape_id: str) -> Shape:
    """Deletes the rows and cancels live tasks; blobs are left to the sweep.

    Returns what it was. Raises ShapeNotFound.
    """
    shape = get(conn, collection_id, shape_id)
    tasks.cancel_live(conn, shape_id=shape_id)
    conn.execute(delete_from(table).where(table.c.id == shape_id))
    conn.execute(
        insert(conn, tombstone).values(
            shape_id=shape_id, collection_id=collection_id, revision=bump(conn), deleted_at=now()
        )
    )
    return shape


def _filtered(query: Select[Any], collection_id: str, filters: Filters) -> Select[Any]:
    query = query.where(table.c.collection_id == collection_id)
    for name in ("label", "state", "sha256"):
        value = getattr(filters, name)
        if value is not None:
            query = query.where(table.c[name] == value)
    for tag in filters.tags:
        query = query.where(table.c.id.in_(select(shape_tag.c.shape_id).where(shape_tag.c.tag == tag)))
    for key, value in filters.metadata.items():
        same = (shape_metadata.c.key == key, shape_metadata.c.value == _comparable(value))
        query = query.where(table.c.id.in_(select(shape_metadata.c.shape_id).where(*same)))
    return query


def _read(conn: Connection, query: Select[Any]) -> list[Shape]:
    described = (
        query.outerjoin(endpoint_features, endpoint_features.c.shape_id == table.c.id)
        .outerjoin(health, health.c.shape_id == table.c.id)
        .add_columns(endpoint_features.c.endpoint_count, health.c.report)
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
        )
        for row in rows
    ]


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
