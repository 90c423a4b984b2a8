"""Collections: named sets of shapes with one profile of the pipeline.

``create(conn, name, profile=None, description="") -> Collection``, ``get(conn, name)``,
``by_id(conn, id)``, ``list_page(conn, *, limit, cursor) -> Page``,
``update(conn, name, *, description, profile) -> Collection``, ``delete(conn, name)``,
``counts(conn, collection_id) -> Counts``, ``renew_profiles(conn) -> int``
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from typing import Any

from sqlalchemy import Connection, func, select
from sqlalchemy import delete as delete_from
from sqlalchemy import update as update_rows

from reebase.errors import ParameterError, UnknownName
from reebase.pipeline import Profile
from store import tasks
from store.errors import CollectionExists, CollectionNotFound
from store.records import Collection, Counts, Page
from store.revision import bump
from store.sql import cursor_after, id_of_cursor, insert, new_id, now
from store.tables import collection as table
from store.tables import endpoint_features, present
from store.tables import shape as shape_table

__all__ = [
    "NAME", "by_id", "counts", "create", "delete", "get", "list_page", "profile_of", "renew_profiles",
    "update",
]  # fmt: skip


NAME = r"[a-z0-9][a-z0-9._-]{0,62}"
"""What a collection may be called: it stands in URLs and file names."""


def profile_of(values: Mapping[str, Any]) -> Profile:
    """A profile from some of its parameters. Raises UnknownName, ParameterError."""
    known = [field.name for field in dataclasses.fields(Profile)]
    for name in values:
        if name not in known:
            raise UnknownName(
                f"A profile has no parameter {name!r}; it has {', '.join(known)}.",
                parameter=f"profile.{name}", found=name, choices=known,
            )  # fmt: skip
    try:
        return Profile(**values)
    except TypeError as error:
        raise ParameterError(f"The profile is not usable: {error}.", parameter="profile") from error


def create(conn: Connection, name: str, profile: Mapping[str, Any] | None = None, description: str = "") -> Collection:
    """A new, empty collection. profile: the parameters that differ from the defaults.

    Raises ParameterError for a name unlike NAME, CollectionExists, and what ``profile_of`` raises.
    """
    if not re.fullmatch(NAME, name):
        raise ParameterError(
            f"{name[:80]!r} cannot name a collection: 1 to 63 lower-case letters, digits, '.', '_' and '-', "
            "the first a letter or digit.",
            parameter="name",
        )
    chosen = profile_of(profile or {})
    row = conn.execute(
        insert(conn, table)
        .values(
            id=new_id(), name=name, description=description, profile=chosen.to_json(),
            profile_key=chosen.key, created_at=now(), updated_at=now(),
        )
        .on_conflict_do_nothing(index_elements=["name"])
        .returning(table)
    ).mappings().first()  # fmt: skip
    if row is None:
        raise CollectionExists(f"There is already a collection {name!r}.", collection=name)
    return Collection(**row)


def get(conn: Connection, name: str) -> Collection:
    """Raises CollectionNotFound."""
    row = conn.execute(select(table).where(table.c.name == name)).mappings().first()
    if row is None:
        raise CollectionNotFound(f"There is no collection {name[:80]!r}.")
    return Collection(**row)


def by_id(conn: Connection, collection_id: str) -> Collection:
    """Raises CollectionNotFound."""
    row = conn.execute(select(table).where(table.c.id == collection_id)).mappings().first()
    if row is None:
        raise CollectionNotFound("The collection was deleted.")
    return Collection(**row)


def list_page(conn: Connection, *, limit: int = 100, cursor: str | None = None) -> Page[Collection]:
    """Oldest first. Raises InvalidCursor."""
    query = select(table).order_by(table.c.id).limit(limit + 1)
    if cursor is not None:
        query = query.where(table.c.id > id_of_cursor(cursor))
    rows = conn.execute(query).mappings().all()
    items = tuple(Collection(**row) for row in rows[:limit])
    return Page(items, cursor_after(items[-1].id) if len(rows) > limit else None)


def update(
    conn: Connection,
    name: str,
    *,
    description: str | None = None,
    profile: Mapping[str, Any] | None = None,
) -> Collection:
    """Changes what is given; parameters that ``profile`` does not name stay.

    Another profile makes all descriptions incomparable, so every shape is queued to be described anew,
    in this transaction. Raises CollectionNotFound, UnknownName, ParameterError.
    """
    collection = get(conn, name)
    values: dict[str, Any] = {"updated_at": now()}
    if description is not None:
        values["description"] = description
    if profile is not None:
        values["profile"] = profile_of({**collection.profile, **profile}).to_json()
    return _change(conn, collection, values)


def delete(conn: Connection, name: str) -> Collection:
    """Deletes the collection and all in it; live tasks are cancelled, blobs are left to the sweep.

    Returns what it was. Raises CollectionNotFound.
    """
    collection = get(conn, name)
    tasks.cancel_live(conn, collection_id=collection.id)
    conn.execute(delete_from(table).where(table.c.id == collection.id))
    bump(conn)
    return collection


def counts(conn: Connection, collection_id: str) -> Counts:
    """How many shapes there are, by state and by endpoint count under the present profile."""
    states = conn.execute(
        select(shape_table.c.state, func.count())
        .where(shape_table.c.collection_id == collection_id, present)
        .group_by(shape_table.c.state)
        .order_by(shape_table.c.state)
    )
    buckets = conn.execute(
        select(endpoint_features.c.endpoint_count, func.count())
        .join(table, table.c.id == endpoint_features.c.collection_id)
        .join(shape_table, shape_table.c.id == endpoint_features.c.shape_id)
        .where(
            present,
            endpoint_features.c.collection_id == collection_id,
            endpoint_features.c.profile_key == table.c.profile_key,
        )
        .group_by(endpoint_features.c.endpoint_count)
        .order_by(endpoint_features.c.endpoint_count)
    )
    return Counts({row[0]: row[1] for row in states}, {row[0]: row[1] for row in buckets})


def renew_profiles(conn: Connection) -> int:
    """After an upgrade of the pipeline: queues every collection that an older version described.

    Returns how many collections that were. Call it once before workers start.
    """
    outdated = [
        collection
        for collection in (Collection(**row) for row in conn.execute(select(table)).mappings().all())
        if profile_of(collection.profile).key != collection.profile_key
    ]
    for collection in outdated:
        _change(conn, collection, {"profile": profile_of(collection.profile).to_json()})
    return len(outdated)


def _change(conn: Connection, collection: Collection, values: Mapping[str, Any]) -> Collection:
    key = profile_of(values.get("profile", collection.profile)).key
    changed = update_rows(table).where(table.c.id == collection.id).values({**values, "profile_key": key})
    row = conn.execute(changed.returning(table)).mappings().one()
    if key != collection.profile_key:
        tasks.describe_anew(conn, collection.id)
    return Collection(**row)
