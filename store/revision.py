"""The counter that every change of what is searched bumps, so that indexes in memory can follow.

``bump(conn) -> int``, ``current(conn) -> int``, ``floor(conn) -> int``
"""

from __future__ import annotations

from sqlalchemy import Connection, select, update

from store.tables import revision as table

__all__ = ["bump", "current", "floor"]


def bump(conn: Connection) -> int:
    """The next revision; it becomes visible with the transaction's other changes."""
    raised = update(table).values(value=table.c.value + 1).returning(table.c.value)
    return int(conn.execute(raised).scalar_one())


def current(conn: Connection) -> int:
    """The revision of the snapshot that this connection sees."""
    return int(conn.execute(select(table.c.value)).scalar_one())


def floor(conn: Connection) -> int:
    """Tombstones up to this revision are purged; who has seen less must load anew."""
    return int(conn.execute(select(table.c.floor)).scalar_one())
