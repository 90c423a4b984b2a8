"""What operators ask of the whole: how many tasks wait, and when a worker last did anything.

``task_counts(conn) -> {(kind, state): n}``, ``worker_seen(conn) -> datetime | None``
``RecentOverview().read(conn) -> Overview``: both, at most some seconds old
"""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy import Connection, func, select

from store.tables import task as table

__all__ = ["Overview", "RecentOverview", "task_counts", "worker_seen"]


@dataclass(frozen=True)
class Overview:
    """``task_counts`` and ``worker_seen`` of one moment."""

    counts: dict[tuple[str, str], int]
    worker_seen: datetime | None


class RecentOverview:
    """Reads them again only after some seconds, and one thread at a time: it walks through all tasks."""

    def __init__(self, seconds: float = 5.0) -> None:
        self._seconds = seconds
        self._lock = threading.Lock()
        self._until = float("-inf")
        self._found = Overview({}, None)

    def read(self, conn: Connection) -> Overview:
        with self._lock:
            if time.monotonic() >= self._until:
                self._found = Overview(task_counts(conn), worker_seen(conn))
                self._until = time.monotonic() + self._seconds
            return self._found


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
