"""What operators ask of the whole: how many tasks wait, and when a worker last did anything.

``task_counts(conn) -> {(kind, state): n}``, ``worker_seen(conn) -> datetime | None``
"""

from __future__ import annotations

from datetime import datetime

from sqlalchemy import Connection, func, select

from store.tables import task as table

__all__ = ["task_counts", "worker_seen"]


def task_counts(conn: Connection) -> dict[tuple[str, str], int]:
    """How many tasks there are of each kind and state; combinations without a task are left out."""
    rows = conn.execute(
        select(table.c.kind, table.c.state, func.count()).group_by(table.c.kind, table.c.state)
    )
    return {(kind, state): count for kind, state, count in rows}


def worker_seen(conn: Connection) -> datetime | None:
    """When a worker last began or ended a task; None when none ever did."""
    began, ended = conn.execute(select(func.max(table.c.started_at), func.max(table.c.finished_at))).one()
    return max((moment for moment in (began, ended) if moment is not None), default=None)
