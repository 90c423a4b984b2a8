"""What a task made that is no JSON, by name; kept as long as the task.

``complete(conn, task, result, outputs) -> Task`` (fenced; raises StaleClaim), ``find(conn, task, name) -> sha256``
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sqlalchemy import Connection, select

from store import tasks
from store.errors import ResultNotFound
from store.records import Task
from store.sql import insert
from store.tables import task_output as table

__all__ = ["complete", "find"]


def complete(conn: Connection, task: Task, result: Mapping[str, Any], outputs: Mapping[str, str]) -> Task:
    """Ends a claimed task well. outputs: blobs by name, which have been put before.

    Raises StaleClaim; let it leave the transaction, so nothing is written.
    """
    done = tasks.succeed(conn, task, result)
    rows = [{"task_id": done.id, "name": name, "sha256": sha256} for name, sha256 in outputs.items()]
    if rows:
        conn.execute(insert(conn, table), rows)
    return done


def find(conn: Connection, task: Task, name: str) -> str:
    """The blob of an output. Raises ResultNotFound."""
    wanted = select(table.c.sha256).where(table.c.task_id == task.id, table.c.name == name)
    found = conn.execute(wanted).scalar()
    if found is None:
        raise ResultNotFound(f"The task is {task.state} and has no {name}.", state=task.state, task=task.id)
    return str(found)
