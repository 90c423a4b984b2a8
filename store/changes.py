"""What changed lately, for those who watch: cheap to ask several times a second, however many tasks there are.

``recent(conn, since, limit) -> Recent``: tasks that run, or were queued or ended since a moment
``searchable(conn, collection_id, revision) -> bool``: whether what is searched changed after a revision
``waiting(conn, collection_id) -> dict``: how many tasks are queued and running
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any
from uuid import UUID

from sqlalchemy import ColumnElement, Connection, exists, func, null, or_, select

from store import revision
from store.records import Task
from store.sql import read_clock
from store.tables import endpoint_features, tombstone
from store.tables import task as table
from store.tasks import has_state, task_of_row

__all__ = ["Recent", "first_queued", "recent", "searchable", "waiting"]

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True)
class Recent:
    """at: the database's clock. tasks: by id, without results. complete: False when there were more than that."""

    at: datetime
    tasks: dict[str, Task]
    complete: bool
    revision: int


def recent(conn: Connection, since: datetime | None = None, limit: int = 500) -> Recent:
    """Tasks that run now, or were queued or ended since then (default: only those that run)."""
    at = read_clock(conn)
    conditions: list[ColumnElement[bool]] = [has_state("running")]
    if since is not None:
        conditions += [table.c.finished_at >= since, table.c.id >= _first_id(since)]
    found: dict[str, Task] = {}
    complete = True
    # One statement each, as each has an index of its own.
    for condition in conditions:
        rows = conn.execute(select(*_told()).where(condition).limit(limit + 1)).mappings().all()
        complete = complete and len(rows) <= limit
        found.update((row["id"], task_of_row(row)) for row in rows[:limit])
    return Recent(at, found, complete, revision.current(conn))


def first_queued(conn: Connection, collection_id: str | None = None, limit: int = 100) -> list[Task]:
    """Tasks that wait, in the order in which they are claimed."""
    query = select(*_told()).where(has_state("queued"))
    if collection_id is not None:
        query = query.where(table.c.collection_id == collection_id)
    ordered = query.order_by(table.c.priority, table.c.created_at, table.c.id).limit(limit)
    return [task_of_row(row) for row in conn.execute(ordered).mappings()]


def waiting(conn: Connection, collection_id: str | None = None) -> dict[str, int]:
    """How many tasks are queued and running, of a collection or of all."""
    query = select(table.c.state, func.count()).where(or_(has_state("queued"), has_state("running")))
    if collection_id is not None:
        query = query.where(table.c.collection_id == collection_id)
    counts = {"queued": 0, "running": 0}
    counts.update((state, count) for state, count in conn.execute(query.group_by(table.c.state)))
    return counts


def searchable(conn: Connection, collection_id: str, after: int) -> bool:
    """Whether shapes of the collection were described, deleted or restored after that revision."""
    return any(
        conn.execute(select(exists().where(t.c.collection_id == collection_id, t.c.revision > after))).scalar_one()
        for t in (endpoint_features, tombstone)
    )


def _told() -> list[ColumnElement[Any]]:
    return [column if column.name != "result" else null().label("result") for column in table.c]


def _first_id(moment: datetime) -> str:
    """The smallest UUIDv7 of that millisecond."""
    return str(UUID(int=((moment - _EPOCH) // timedelta(milliseconds=1)) << 80))
