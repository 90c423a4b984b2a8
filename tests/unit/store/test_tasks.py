"""The task engine: at least once, its effect once, nothing lost, a reason for every failure."""

from __future__ import annotations

import multiprocessing
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from sqlalchemy import event, func, select, update
from sqlalchemy.exc import IntegrityError

from store import collections, results, shapes, tables, tasks
from store.engine import Database
from store.errors import (
    InvalidCursor,
    ResultNotFound,
    StaleClaim,
    TaskExists,
    TaskNotCancellable,
    TaskNotFound,
    TaskNotRetryable,
)
from store.records import Collection, Shape, Task
from store.settings import Settings
from store.sql import now
from tests.unit.store.descriptions import description

Upload = Callable[..., tuple[Shape, Task]]
SHA = "f" * 64


def read(database: Database, task: Task) -> Task:
    with database.read() as conn:
        return tasks.get(conn, task.id)


def state_of(database: Database, shape: Shape) -> str:
    with database.read() as conn:
        return shapes.get(conn, shape.collection_id, shape.id).state


def expire(database: Database, task: Task) -> None:
    with database.write() as conn:
        conn.execute(update(tables.task).where(tables.task.c.id == task.id).values(lease_until=now(-1)))


def claimed(queue: tasks.DatabaseQueue, worker: str = "w") -> Task:
    task = queue.claim(worker)
    assert task is not None
    return task


def test_a_task_goes_from_queued_to_succeeded_and_its_shape_follows(
    database: Database, queue: tasks.DatabaseQueue, upload: Upload
) -> None:
    shape, queued = upload()
    assert (queued.state, queued.attempt, state_of(database, shape)) == ("queued", 0, "queued")
    task = claimed(queue)
    assert (task.id, task.state, task.attempt, task.worker) == (queued.id, "running", 1, "w")
    assert task.lease_until is not None and task.started_at is not None
    assert 29 < (task.lease_until - task.started_at).total_seconds() < 31
    assert state_of(database, shape) == "running"
    assert queue.heartbeat(task, "denoise", 0.5) == "ok"
    assert (read(database, task).stage, read(database, task).fraction) == ("denoise", 0.5)
    with database.write() as conn:
        done = queue.succeed(conn, task, {"endpoint_count": 3})
    assert done.stage is None
    assert (done.state, done.result, done.fraction) == ("succeeded", {"endpoint_count": 3}, 1.0)
    assert done.finished_at is not None and done.worker is None
    assert state_of(database, shape) == "indexed"
    assert queue.claim("w") is None


def test_oldest_first_but_someone_waits_for_a_query(database: Database, queue: tasks.DatabaseQueue) -> None:
    with database.write() as conn:
        first = tasks.enqueue(conn, "evaluate")
        second = tasks.enqueue(conn, "evaluate")
        drawn = tasks.enqueue(conn, "map")
        query = tasks.enqueue(conn, "query", blob=SHA)
    assert queue.claim("w", kinds=["describe"]) is None
    assert [claimed(queue).id for _ in range(4)] == [query.id, first.id, second.id, drawn.id]


def test_claiming_does_not_walk_through_the_tasks_of_the_past(
    database: Database, queue: tasks.DatabaseQueue, upload: Upload
) -> None:
    upload()
    asked: list[tuple[str, Any]] = []
    for engine in (database._readers, database._writer):
        event.listen(engine, "before_cursor_execute", lambda *seen: asked.append(seen[2:4]))
    claimed(queue)
    plans = [
        (statement, row[3])
        for statement, parameters in asked.copy()
        if "FROM task" in statement or "UPDATE task" in statement
        for row in _plan(database, statement, parameters)
    ]
    assert len({statement for statement, _ in plans}) == 5
    assert [step for _, step in plans if step == "SCAN task"] == []


def _plan(database: Database, statement: str, parameters: Any) -> list[Any]:
    with database.read() as conn:
        return list(conn.exec_driver_sql(f"EXPLAIN QUERY PLAN {statement}", parameters))


def test_an_uncommitted_task_is_not_there(database: Database, queue: tasks.DatabaseQueue) -> None:
    with pytest.raises(ZeroDivisionError), database.write() as conn:
        tasks.enqueue(conn, "evaluate")
        1 / 0  # noqa: B018 - to raise
    assert queue.claim("w") is None


def test_a_late_result_after_the_lease_was_retaken_writes_nothing(
    database: Database, queue: tasks.DatabaseQueue, upload: Upload
) -> None:
    shape, _ = upload()
    frozen = claimed(queue, "frozen")
    expire(database, frozen)
    second = claimed(queue, "second")
    assert (second.id, second.attempt, second.crashes) == (frozen.id, 2, 1)
    assert queue.heartbeat(frozen, "read", 0.1) == "lost"
    found = description(np.ones((2, 3)))
    with pytest.raises(StaleClaim), database.write() as conn:
        results.store_description(conn, frozen, found, cleaned_sha256=SHA, denoised_sha256=SHA)
    with pytest.raises(StaleClaim), database.write() as conn:
        queue.fail(conn, frozen, "malformed_file", "late")
    assert queue.crashed(frozen) == "lost"
    assert queue.release(frozen) is False
    with database.read() as conn, pytest.raises(ResultNotFound):
        results.features(conn, shape.id)
    assert read(database, second) == second
    with database.write() as conn:
        results.store_description(conn, second, found, cleaned_sha256=SHA, denoised_sha256=SHA)
    # Twice is too late as well.
    with pytest.raises(StaleClaim), database.write() as conn:
        results.store_description(conn, second, found, cleaned_sha256=SHA, denoised_sha256=SHA)


def test_a_stale_claim_takes_the_whole_transaction_with_it(
    database: Database, queue: tasks.DatabaseQueue, upload: Upload
) -> None:
    shape, _ = upload()
    frozen = claimed(queue)
    expire(database, frozen)
    claimed(queue)
    with pytest.raises(StaleClaim), database.write() as conn:
        shapes.update(conn, shape.collection_id, shape.id, name="changed")
        queue.succeed(conn, frozen)
    with database.read() as conn:
        assert shapes.get(conn, shape.collection_id, shape.id).name == shape.name


def test_a_heartbeat_keeps_a_lease_that_nobody_took(
    database: Database, queue: tasks.DatabaseQueue, upload: Upload
) -> None:
    upload()
    task = claimed(queue)
    expire(database, task)
    assert queue.heartbeat(task, "read", 0.0) == "ok"
    assert queue.claim("other") is None


def test_the_third_death_fails_the_task_and_the_queue_goes_on(
    database: Database, queue: tasks.DatabaseQueue, upload: Upload
) -> None:
    shape, poison = upload()
    _, healthy = upload()
    for crashes in (1, 2):
        expire(database, claimed(queue))
        after = read(database, poison)
        assert after.state == "running"
        with database.read() as conn:
            assert tasks.get(conn, poison.id).crashes == crashes - 1
    expire(database, claimed(queue))
    assert claimed(queue).id == healthy.id
    dead = read(database, poison)
    assert (dead.state, dead.error_code, dead.crashes, dead.attempt) == ("failed", "worker_died", 3, 3)
    assert dead.error_detail is not None and "3 times" in dead.error_detail["message"]
    assert state_of(database, shape) == "failed"


def test_a_child_that_dies_counts_as_a_crash_at_once(
    database: Database, queue: tasks.DatabaseQueue, upload: Upload
) -> None:
    upload()
    reason = {"message": "The mesh needs more than 4 GiB.", "limit": 4}
    assert queue.crashed(claimed(queue)) == "queued"
    assert queue.crashed(claimed(queue)) == "queued"
    last = claimed(queue)
    assert queue.crashed(last, "out_of_memory", reason) == "failed"
    dead = read(database, last)
    assert (dead.error_code, dead.error_detail) == ("out_of_memory", reason)


def test_release_is_no_crash(database: Database, queue: tasks.DatabaseQueue, upload: Upload) -> None:
    shape, _ = upload()
    task = claimed(queue)
    queue.heartbeat(task, "denoise", 0.4)
    assert queue.release(task)
    again = read(database, task)
    assert (again.state, again.crashes, again.stage, again.fraction) == ("queued", 0, None, 0.0)
    assert state_of(database, shape) == "queued"
    assert claimed(queue).attempt == 2


def test_cancelling_a_queued_task_is_at_once(
    database: Database, queue: tasks.DatabaseQueue, upload: Upload
) -> None:
    shape, task = upload()
    with database.write() as conn:
        assert queue.cancel(conn, task.id).state == "cancelled"
    assert state_of(database, shape) == "cancelled"
    assert queue.claim("w") is None
    with pytest.raises(TaskNotCancellable), database.write() as conn:
        queue.cancel(conn, task.id)


def test_cancelling_a_running_task_asks_its_worker(
    database: Database, queue: tasks.DatabaseQueue, upload: Upload
) -> None:
    shape, _ = upload()
    task = claimed(queue)
    with database.write() as conn:
        assert queue.cancel(conn, task.id).cancel_requested
    assert read(database, task).state == "running"
    assert queue.heartbeat(task, "skeleton", 0.8) == "cancel"
    with database.write() as conn:
        queue.cancelled(conn, task)
    assert (read(database, task).state, state_of(database, shape)) == ("cancelled", "cancelled")


@pytest.mark.parametrize("end", ["lease", "crash", "release"])
def test_a_worker_that_is_gone_cannot_hinder_a_cancellation(
    database: Database, queue: tasks.DatabaseQueue, upload: Upload, end: str
) -> None:
    upload()
    task = claimed(queue)
    with database.write() as conn:
        queue.cancel(conn, task.id)
    if end == "lease":
        expire(database, task)
        assert queue.claim("w") is None
    elif end == "crash":
        assert queue.crashed(task) == "cancelled"
    else:
        assert queue.release(task)
    assert read(database, task).state == "cancelled"


def test_retry_starts_anew(database: Database, queue: tasks.DatabaseQueue, upload: Upload) -> None:
    shape, _ = upload()
    task = claimed(queue)
    with database.write() as conn:
        failed = queue.fail(conn, task, "no_faces", "The file holds no faces.")
    assert failed.error_detail == {"message": "The file holds no faces."}
    assert state_of(database, shape) == "failed"
    with database.write() as conn:
        again = queue.retry(conn, task.id)
    assert (again.state, again.crashes, again.error_code, again.finished_at) == ("queued", 0, None, None)
    assert state_of(database, shape) == "queued"
    with pytest.raises(TaskNotRetryable), database.write() as conn:
        queue.retry(conn, task.id)
    # The fencing token goes on rising: the first claim must never fit again.
    assert claimed(queue).attempt == task.attempt + 1
    with pytest.raises(StaleClaim), database.write() as conn:
        queue.succeed(conn, task)


def test_what_cannot_be_retried(database: Database, queue: tasks.DatabaseQueue, upload: Upload) -> None:
    shape, task = upload()
    with database.write() as conn:
        queue.cancel(conn, task.id)
        other = tasks.enqueue(conn, "describe", collection_id=shape.collection_id, shape_id=shape.id)
    with pytest.raises(TaskNotRetryable, match="another task"), database.write() as conn:
        queue.retry(conn, task.id)
    with database.write() as conn:
        shapes.delete(conn, shape.collection_id, shape.id)
    with pytest.raises(TaskNotRetryable, match="deleted"), database.write() as conn:
        queue.retry(conn, other.id)
    with database.write() as conn:
        query = tasks.enqueue(conn, "query", blob=SHA)
        queue.cancel(conn, query.id)
    with pytest.raises(TaskNotRetryable, match="send the query again"), database.write() as conn:
        queue.retry(conn, query.id)
    with database.write() as conn:
        denoising = tasks.enqueue(conn, "denoise", blob=SHA)
        queue.cancel(conn, denoising.id)
    with pytest.raises(TaskNotRetryable, match="mesh to denoise is not kept") as refused, database.write() as conn:
        queue.retry(conn, denoising.id)
    assert "query" not in str(refused.value)


@pytest.mark.parametrize("end", ["cancelled", "cancelled while it ran", "failed", "crashed"])
def test_what_is_searched_stays_indexed_when_it_is_not_described_anew(
    database: Database, queue: tasks.DatabaseQueue, collection: Collection, upload: Upload, end: str
) -> None:
    shape, _ = upload()
    first = claimed(queue)
    with database.write() as conn:
        results.store_description(
            conn, first, description(np.ones((2, 3))), cleaned_sha256=SHA, denoised_sha256=SHA
        )
        assert tasks.describe_anew(conn, collection.id, {shape.id}) == 1
    assert state_of(database, shape) == "queued"
    if end == "cancelled":
        with database.write() as conn:
            task = queue.cancel(conn, shapes.get(conn, collection.id, shape.id).task_id or "")
    else:
        task = claimed(queue)
        assert state_of(database, shape) == "running"
        if end == "crashed":
            for _ in range(3):
                queue.crashed(task)
                task = queue.claim("w") or task
        else:
            with database.write() as conn:
                if end == "failed":
                    queue.fail(conn, task, "broken", "It is broken.")
                else:
                    queue.cancelled(conn, task)
    ended = read(database, task)
    assert ended.state == ("failed" if end == "crashed" else end.split(maxsplit=1)[0])
    assert (ended.error_code is None) == end.startswith("cancelled")
    assert state_of(database, shape) == "indexed"


def test_what_was_described_otherwise_is_not_indexed_when_its_task_fails(
    database: Database, queue: tasks.DatabaseQueue, collection: Collection, upload: Upload
) -> None:
    shape, _ = upload()
    first = claimed(queue)
    with database.write() as conn:
        results.store_description(
            conn, first, description(np.ones((2, 3))), cleaned_sha256=SHA, denoised_sha256=SHA
        )
        collections.update(conn, collection.name, profile={"bands": 17})
    second = claimed(queue)
    with database.write() as conn:
        queue.fail(conn, second, "broken", "It is broken.")
    assert state_of(database, shape) == "failed"


def test_deleting_a_shape_takes_its_task_from_the_worker(
    database: Database, queue: tasks.DatabaseQueue, upload: Upload
) -> None:
    shape, _ = upload()
    task = claimed(queue)
    with database.write() as conn:
        shapes.delete(conn, shape.collection_id, shape.id)
    assert read(database, task).state == "cancelled"
    assert queue.heartbeat(task, "read", 0.2) == "lost"
    with pytest.raises(StaleClaim), database.write() as conn:
        results.store_description(
            conn, task, description(np.ones((2, 3))), cleaned_sha256=SHA, denoised_sha256=SHA
        )


def test_one_live_description_a_shape(database: Database, upload: Upload) -> None:
    shape, task = upload()
    with database.write() as conn:
        with pytest.raises(TaskExists):
            tasks.enqueue(conn, "describe", collection_id=shape.collection_id, shape_id=shape.id)
        # The refusal leaves the transaction usable.
        assert tasks.get(conn, task.id).state == "queued"
    with pytest.raises(IntegrityError), database.write() as conn:
        tasks.enqueue(conn, "describe")


def test_pages_newest_first(database: Database, collection: Collection) -> None:
    with database.write() as conn:
        made = [tasks.enqueue(conn, "evaluate", collection_id=collection.id) for _ in range(5)]
        tasks.enqueue(conn, "query", blob=SHA)
    found: list[str] = []
    cursor = None
    with database.read() as conn:
        while True:
            page = tasks.list_page(conn, limit=2, cursor=cursor, kind="evaluate", collection_id=collection.id)
            found += [task.id for task in page.items]
            cursor = page.next
            if cursor is None:
                break
        assert found == [task.id for task in reversed(made)]
        assert tasks.list_page(conn, state="failed").items == ()
        with pytest.raises(TaskNotFound):
            tasks.get(conn, "nothing")
        for wrong in ("?", "aaaa", "é"):
            with pytest.raises(InvalidCursor):
                tasks.list_page(conn, cursor=wrong)


def test_a_page_leaves_results_out(database: Database, queue: tasks.DatabaseQueue) -> None:
    with database.write() as conn:
        tasks.enqueue(conn, "query", blob=SHA)
    task = claimed(queue)
    with database.write() as conn:
        queue.succeed(conn, task, {"hits": ["many"]})
    with database.read() as conn:
        (listed,) = tasks.list_page(conn).items
    assert (listed.state, listed.result) == ("succeeded", None)
    assert read(database, task).result == {"hits": ["many"]}


def test_a_result_that_json_cannot_hold_is_refused(database: Database, queue: tasks.DatabaseQueue) -> None:
    with database.write() as conn:
        tasks.enqueue(conn, "evaluate")
    task = claimed(queue)
    with pytest.raises(Exception, match="JSON compliant"), database.write() as conn:
        queue.succeed(conn, task, {"map": float("nan")})
    assert read(database, task).state == "running"


def live(database: Database) -> bool:
    with database.read() as conn:
        states = conn.execute(select(tables.task.c.state).distinct()).scalars().all()
    return bool({"queued", "running"} & set(states))


def work(url: str, name: str, started: Any, done: Any) -> None:
    """A worker that claims until nothing is left, and loses some of its claims on purpose."""
    database = Database(url)
    queue = tasks.DatabaseQueue(database, Settings(lease_seconds=1.0, max_crashes=100))
    started.wait()
    while live(database):
        task = queue.claim(name)
        if task is None:
            time.sleep(0.02)
            continue
        done.put(("claimed", task.id, task.attempt))
        if task.attempt == 1 and int(task.params["number"]) % 7 == 0:
            continue  # as if it had died: another claim follows when the lease ends
        try:
            with database.write() as conn:
                queue.succeed(conn, task, {"by": name})
        except StaleClaim:  # on a busy machine a lease may end under a worker that lives
            continue
        done.put(("succeeded", task.id, task.attempt))
    database.close()
    done.put(("stopped", name, 0))


def test_several_processes_never_share_a_claim_and_lose_nothing(
    database: Database, settings: Settings
) -> None:
    count, workers = 60, 4
    with database.write() as conn:
        made = {tasks.enqueue(conn, "evaluate", params={"number": n}).id for n in range(count)}
    context = multiprocessing.get_context("spawn")
    started, done = context.Event(), context.Queue()
    processes = [
        context.Process(target=work, args=(settings.database_url, f"w{n}", started, done))
        for n in range(workers)
    ]
    for process in processes:
        process.start()
    started.set()
    seen: list[tuple[str, str, int]] = []
    while sum(what == "stopped" for what, _, _ in seen) < workers:
        seen.append(done.get(timeout=60))
    for process in processes:
        process.join(timeout=30)
        assert process.exitcode == 0
    claims = Counter((task, attempt) for what, task, attempt in seen if what == "claimed")
    assert set(claims.values()) == {1}
    assert Counter(task for what, task, _ in seen if what == "succeeded") == dict.fromkeys(made, 1)
    with database.read() as conn:
        states = conn.execute(select(tables.task.c.state, func.count()).group_by(tables.task.c.state)).all()
        crashes = conn.execute(select(func.sum(tables.task.c.crashes))).scalar_one()
    assert [tuple(row) for row in states] == [("succeeded", count)]
    assert crashes == len(claims) - count >= len(range(0, count, 7))


def test_who_no_longer_holds_a_task_may_not_write_before_its_end_either(
    database: Database, queue: tasks.DatabaseQueue
) -> None:
    with database.write() as conn:
        task = tasks.enqueue(conn, "synthesise")
    held = queue.claim("one")
    assert held is not None
    with database.write() as conn:
        tasks.check_held(conn, held)
        tasks.cancel_live(conn, shape_id="none")
        tasks.check_held(conn, held)
    queue.release(held)
    again = queue.claim("two")
    assert again is not None and again.id == task.id
    with database.read() as conn:
        tasks.check_held(conn, again)
        with pytest.raises(StaleClaim):
            tasks.check_held(conn, held)
