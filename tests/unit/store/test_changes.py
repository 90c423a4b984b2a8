"""What those who watch are told: tasks by when they changed, and whether what is searched did."""

from __future__ import annotations

from collections.abc import Callable
from datetime import timedelta

import numpy as np
from sqlalchemy import text

from store import changes, results, revision, shapes, tasks
from store.engine import Database
from store.records import Collection, Shape, Task
from tests.unit.store.descriptions import description

Upload = Callable[..., tuple[Shape, Task]]
SHA = "d" * 64


def test_tasks_are_told_when_they_are_queued_run_and_end(
    database: Database, queue: tasks.DatabaseQueue, collection: Collection, upload: Upload
) -> None:
    _, first = upload()
    _, second = upload()
    with database.read() as conn:
        at = changes.recent(conn).at
        assert changes.recent(conn).tasks == {}
        assert changes.recent(conn, at - timedelta(seconds=60)).tasks.keys() == {first.id, second.id}
        assert changes.recent(conn, at + timedelta(seconds=60)).tasks == {}
        assert [task.id for task in changes.first_queued(conn)] == [first.id, second.id]
        assert [task.id for task in changes.first_queued(conn, collection.id, limit=1)] == [first.id]
        assert changes.first_queued(conn, "other") == []
        assert changes.waiting(conn) == {"queued": 2, "running": 0}
    held = queue.claim("w")
    assert held is not None
    with database.read() as conn:
        # What runs is always told, however long ago it was queued.
        assert changes.recent(conn).tasks[first.id].state == "running"
        assert changes.waiting(conn, collection.id) == {"queued": 1, "running": 1}
    with database.write() as conn:
        tasks.succeed(conn, held, {"large": 1})
    with database.read() as conn:
        told = changes.recent(conn, at).tasks[first.id]
        assert (told.state, told.result) == ("succeeded", None)


def test_more_than_can_be_told_is_said_so(database: Database, upload: Upload) -> None:
    for _ in range(4):
        upload()
    with database.read() as conn:
        since = changes.recent(conn).at - timedelta(seconds=60)
        assert changes.recent(conn, since, limit=4).complete
        few = changes.recent(conn, since, limit=3)
    assert (len(few.tasks), few.complete) == (3, False)


def test_looking_uses_indexes_alone(database: Database) -> None:
    with database.read() as conn:
        seen: list[str] = []
        for condition in ("state = 'running'", "finished_at >= 1", "id >= '0'"):
            plan = conn.execute(text(f"EXPLAIN QUERY PLAN SELECT id, kind FROM task WHERE {condition}"))  # noqa: S608 - words of this file
            seen.append(" ".join(row.detail for row in plan))
    assert all("SEARCH" in plan or "task_leases" in plan for plan in seen), seen


def test_what_is_searched_changes_by_description_deletion_and_restoring(
    database: Database, queue: tasks.DatabaseQueue, collection: Collection, upload: Upload
) -> None:
    def moved(after: int) -> tuple[bool, int]:
        with database.read() as conn:
            assert not changes.searchable(conn, "other", -1)
            return changes.searchable(conn, collection.id, after), revision.current(conn)

    shape, _ = upload()
    assert moved(0) == (False, 0)
    held = queue.claim("w")
    assert held is not None
    with database.write() as conn:
        found = description(np.ones((2, 3)))
        results.store_description(conn, held, found, cleaned_sha256=SHA, denoised_sha256=SHA)
    changed, now = moved(0)
    assert changed and moved(now) == (False, now)
    for change in (shapes.delete, shapes.restore):
        before = now
        with database.write() as conn:
            change(conn, collection.id, shape.id)
        changed, now = moved(before)
        assert changed and now > before
        assert moved(now) == (False, now)
