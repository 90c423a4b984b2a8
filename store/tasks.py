"""Tasks: background work that survives the death of whoever does it.

queued -> running -> succeeded | failed | cancelled. A claim holds a task for a lease that heartbeats
extend. It happens at least once, and its effect once: ``attempt`` counts the claims and fences the
writes, so a worker that was thought dead cannot write.

In the caller's transaction
  ``enqueue(conn, kind, *, collection_id, shape_id, params, blob) -> Task``
  ``get(conn, task_id)``, ``list_page(conn, *, limit, cursor, state, kind, collection_id, shape_id)``
  ``cancel(conn, task_id)``, ``retry(conn, task_id)``, ``cancel_live(conn, *, shape_id, ...)``
  ``describe_anew(conn, collection_id)``
  ``succeed(conn, task, result)``, ``fail(conn, task, code, detail)``, ``cancelled(conn, task)``:
  raise StaleClaim unless the claim still holds
In transactions of their own: ``DatabaseQueue(database, settings)``
  ``claim(worker, kinds) -> Task | None``, ``heartbeat(task, stage, fraction) -> ok|cancel|lost``,
  ``crashed(task, code, detail) -> queued|failed|cancelled|lost``, ``release(task) -> bool``,
  and those above as methods.

The state of a shape follows its task in the same transaction; what was described stays ``indexed`` when a
description in its place is cancelled or fails.
"""

from __future__ import annotations

from collections.abc import Collection as Some
from collections.abc import Mapping
from typing import Any, Literal, Protocol

from sqlalchemy import (
    ColumnElement,
    Connection,
    Update,
    and_,
    bindparam,
    case,
    exists,
    literal,
    null,
    or_,
    select,
    update,
)
from sqlalchemy.exc import IntegrityError

from store.engine import Database
from store.errors import StaleClaim, TaskExists, TaskNotCancellable, TaskNotFound, TaskNotRetryable
from store.records import Page, Task, TaskKind
from store.settings import Settings
from store.sql import cursor_after, id_of_cursor, insert, new_id, now
from store.tables import described, present
from store.tables import shape as shape_table
from store.tables import task as table

__all__ = [
    "DatabaseQueue", "Heartbeat", "TaskQueue", "cancel", "cancel_live", "cancelled", "check_held", "describe_anew",
    "enqueue", "fail", "get", "has_state", "list_page", "release_all", "retry", "succeed", "task_of_row",
]  # fmt: skip

Heartbeat = Literal["ok", "cancel", "lost"]
AfterCrash = Literal["queued", "failed", "cancelled", "lost"]
Detail = str | Mapping[str, Any]

# Lower goes first: someone waits for these two.
_PRIORITY: dict[str, int] = {
    "query": 0, "denoise": 0, "describe": 1, "map": 1, "evaluate": 1, "duplicates": 1, "synthesise": 1, "report": 1,
}  # fmt: skip
_LIVE = ("queued", "running")
_NOT_HELD: dict[str, Any] = {"worker": None, "lease_until": None}
_FRESH: dict[str, Any] = {"stage": None, "fraction": 0.0}
_MANY = 500  # ids in one statement
WORKER_DIED = "worker_died"


class TaskQueue(Protocol):
    """What the worker needs of a queue; the ``task`` row stays the truth whatever carries the ids."""

    def enqueue(
        self, conn: Connection, kind: TaskKind, *, collection_id: str | None = None,
        shape_id: str | None = None, params: Mapping[str, Any] | None = None, blob: str | None = None,
    ) -> Task: ...  # fmt: skip

    def claim(self, worker: str, kinds: Some[str] | None = None) -> Task | None: ...

    def heartbeat(self, task: Task, stage: str | None, fraction: float) -> Heartbeat: ...

    def succeed(self, conn: Connection, task: Task, result: Mapping[str, Any] | None = None) -> Task: ...

    def fail(self, conn: Connection, task: Task, code: str, detail: Detail) -> Task: ...

    def cancelled(self, conn: Connection, task: Task) -> Task: ...

    def crashed(self, task: Task, code: str = WORKER_DIED, detail: Detail | None = None) -> AfterCrash: ...

    def release(self, task: Task) -> bool: ...

    def cancel(self, conn: Connection, task_id: str) -> Task: ...

    def retry(self, conn: Connection, task_id: str) -> Task: ...


def task_of_row(row: Any) -> Task:
    """The record of a row of the task table."""
    fields = {name: row[name] for name in Task.__dataclass_fields__}
    # SQLite's RETURNING gives a REAL that is whole as an integer.
    fields["fraction"] = float(fields["fraction"])
    return Task(**{**fields, "cancel_requested": bool(fields["cancel_requested"])})


def enqueue(
    conn: Connection, kind: TaskKind, *, collection_id: str | None = None, shape_id: str | None = None,
    params: Mapping[str, Any] | None = None, blob: str | None = None,
) -> Task:  # fmt: skip
    """A new task that is claimed once the transaction commits.

    blob: an input that is no shape's; once the task ended it is removed.
    Raises TaskExists when kind is "describe" and the shape has a live one.
    """
    values = {
        "id": new_id(), "kind": kind, "state": "queued", "priority": _PRIORITY[kind],
        "collection_id": collection_id, "shape_id": shape_id, "params": dict(params or {}), "blob": blob,
        "fraction": 0.0, "attempt": 0, "crashes": 0, "cancel_requested": 0, "created_at": now(),
    }  # fmt: skip
    try:
        # A savepoint: PostgreSQL gives up the whole transaction at a refused statement.
        with conn.begin_nested():
            row = conn.execute(insert(conn, table).values(values).returning(table)).mappings().one()
    except IntegrityError as error:
        if kind == "describe" and _live_description(conn, shape_id):
            raise TaskExists(shape=shape_id) from error
        raise
    task = task_of_row(row)
    if kind == "describe":
        conn.execute(
            update(shape_table)
            .where(shape_table.c.id == shape_id)
            .values(task_id=task.id, state="queued", updated_at=now())
        )
    return task


def describe_anew(
    conn: Connection, collection_id: str, only: Some[str] | None = None, params: Mapping[str, Any] | None = None
) -> int:
    """Queues a description of every shape of a collection, in place of those that are queued or running.

    only: these shapes, of which none is. In few statements however many there are: other writers wait meanwhile.
    Returns how many.
    """
    mine = and_(table.c.collection_id == collection_id, table.c.kind == "describe", table.c.state.in_(_LIVE))
    if only is None:
        conn.execute(_cancelling().where(mine))
    shapes = select(shape_table.c.id).where(shape_table.c.collection_id == collection_id, present)
    rows = [
        {
            "id": new_id(), "kind": "describe", "state": "queued", "priority": _PRIORITY["describe"],
            "collection_id": collection_id, "shape_id": shape_id, "params": dict(params or {}), "fraction": 0.0,
            "attempt": 0, "crashes": 0, "cancel_requested": 0,
        }
        for shape_id in conn.execute(shapes.order_by(shape_table.c.id)).scalars()
        if only is None or shape_id in only
    ]  # fmt: skip
    if rows:
        conn.execute(insert(conn, table).values(created_at=now()), rows)
    waiting = and_(mine, table.c.state == "queued", table.c.shape_id == shape_table.c.id)
    queued = select(table.c.id).where(waiting).scalar_subquery()
    conn.execute(
        update(shape_table)
        .where(shape_table.c.collection_id == collection_id, present, queued.is_not(None))
        .values(task_id=queued, state="queued", updated_at=now())
    )
    return len(rows)


def get(conn: Connection, task_id: str) -> Task:
    """Raises TaskNotFound."""
    row = conn.execute(select(table).where(table.c.id == task_id)).mappings().first()
    if row is None:
        raise TaskNotFound(f"There is no task {task_id[:80]!r}.")
    return task_of_row(row)


def list_page(
    conn: Connection, *, limit: int = 100, cursor: str | None = None, state: str | None = None,
    kind: str | None = None, collection_id: str | None = None, shape_id: str | None = None,
) -> Page[Task]:  # fmt: skip
    """Newest first, without their results: a page of answers would have no bound. Raises InvalidCursor."""
    wanted = {"state": state, "kind": kind, "collection_id": collection_id, "shape_id": shape_id}
    query = select(*(column for column in table.c if column.name != "result"), null().label("result"))
    for name, value in wanted.items():
        if value is not None:
            query = query.where(table.c[name] == value)
    if cursor is not None:
        query = query.where(table.c.id < id_of_cursor(cursor))
    rows = conn.execute(query.order_by(table.c.id.desc()).limit(limit + 1)).mappings().all()
    items = tuple(task_of_row(row) for row in rows[:limit])
    return Page(items, cursor_after(items[-1].id) if len(rows) > limit else None)


def cancel(conn: Connection, task_id: str) -> Task:
    """A queued task is cancelled at once; a running one is asked to stop, which its heartbeat reports.

    Raises TaskNotFound, TaskNotCancellable.
    """
    task = get(conn, task_id)
    if task.state == "queued":
        return _move(conn, _cancelling().where(table.c.id == task_id, table.c.state == "queued"))[0]
    if task.state == "running":
        asked = update(table).where(table.c.id == task_id, table.c.state == "running")
        return _move(conn, asked.values(cancel_requested=1))[0]
    raise TaskNotCancellable(f"The task has {task.state}, so it cannot be cancelled.", state=task.state)


def cancel_live(
    conn: Connection,
    *,
    shape_id: str | None = None,
    collection_id: str | None = None,
) -> list[Task]:
    """Cancels at once whatever is queued or running for a shape or collection that goes away.

    A running task is taken from its worker: the next heartbeat is "lost", and its result is refused.
    """
    if (shape_id is None) == (collection_id is None):
        raise ValueError("Give either a shape or a collection.")
    whose = table.c.shape_id == shape_id if shape_id is not None else table.c.collection_id == collection_id
    return _move(conn, _cancelling().where(whose, table.c.state.in_(_LIVE)))


def retry(conn: Connection, task_id: str) -> Task:
    """Queues a failed or cancelled task again, as if it had never run.

    Raises TaskNotFound, TaskNotRetryable (also when its shape or its upload is gone).
    """
    task = get(conn, task_id)
    if task.state not in ("failed", "cancelled"):
        raise TaskNotRetryable(
            f"The task is {task.state}; only failed and cancelled ones are retried.", state=task.state
        )
    if task.blob is not None:
        what = "The mesh to denoise is" if task.kind == "denoise" else "The mesh of a query is"
        again = "it" if task.kind == "denoise" else "the query"
        raise TaskNotRetryable(f"{what} not kept after its task ended; send {again} again.")
    if task.kind == "describe":
        if not conn.execute(select(exists().where(shape_table.c.id == task.shape_id, present))).scalar_one():
            raise TaskNotRetryable("The shape of this task was deleted.")
        if _live_description(conn, task.shape_id):
            raise TaskNotRetryable("The shape already has another task that is queued or running.")
        conn.execute(update(shape_table).where(shape_table.c.id == task.shape_id).values(task_id=task.id))
    fresh = {
        **_NOT_HELD, **_FRESH, "state": "queued", "crashes": 0, "cancel_requested": 0, "error_code": None,
        "error_detail": None, "started_at": None, "finished_at": None,
    }  # fmt: skip
    return _move(conn, update(table).where(table.c.id == task_id).values(fresh))[0]


def succeed(conn: Connection, task: Task, result: Mapping[str, Any] | None = None) -> Task:
    """Ends a claimed task well. Raises StaleClaim; let it leave the transaction, so nothing is written."""
    values = {**_NOT_HELD, "state": "succeeded", "result": dict(result or {}), "stage": None, "fraction": 1.0}
    return _fenced(conn, task, update(table).values({**values, "finished_at": now()}))


def fail(conn: Connection, task: Task, code: str, detail: Detail) -> Task:
    """Ends a claimed task with a reason: a message, or ``{"message": ...}`` and more. Raises StaleClaim."""
    return _fenced(conn, task, _failing(code, detail))


def cancelled(conn: Connection, task: Task) -> Task:
    """Ends a claimed task whose heartbeat said "cancel". Raises StaleClaim."""
    return _fenced(conn, task, _cancelling())


def check_held(conn: Connection, task: Task) -> None:
    """For what a task writes before it ends. Raises StaleClaim when the claim is over."""
    if not conn.execute(select(exists().where(_held(task)))).scalar_one():
        raise _stale(task)


def release_all(conn: Connection) -> int:
    """Queues every running task again, without blame: for a restored backup, whose workers are no more."""
    return len(_move(conn, _requeueing(0).where(table.c.state == "running")))


class DatabaseQueue:
    """The queue on the ``task`` table itself."""

    def __init__(self, database: Database, settings: Settings) -> None:
        self._database = database
        self._lease = settings.lease_seconds
        self._max_crashes = settings.max_crashes

    enqueue = staticmethod(enqueue)
    succeed = staticmethod(succeed)
    fail = staticmethod(fail)
    cancelled = staticmethod(cancelled)
    cancel = staticmethod(cancel)
    retry = staticmethod(retry)

    def claim(self, worker: str, kinds: Some[str] | None = None) -> Task | None:
        """The next task, now held by this worker for a lease; None when there is nothing to do.

        Queries first, then the oldest. Before that, tasks whose lease ended are taken from their
        workers: back into the queue, or failed as ``worker_died`` at the last allowed crash.
        """
        waiting = has_state("queued")
        if kinds is not None:
            waiting = and_(waiting, table.c.kind.in_(list(kinds)))
        expired = and_(has_state("running"), table.c.lease_until < now())
        with self._database.read() as conn:
            # An idle worker polls: it must not take the write lock for nothing.
            if not conn.execute(select(or_(exists().where(waiting), exists().where(expired)))).scalar_one():
                return None
        with self._database.write() as conn:
            self._take_back(conn, expired)
            first = (
                select(table.c.id).where(waiting).order_by(table.c.priority, table.c.created_at, table.c.id)
                .limit(1).with_for_update(skip_locked=True).scalar_subquery()
            )  # fmt: skip
            claimed = _move(conn, update(table).where(table.c.id == first).values({
                **_FRESH, "state": "running", "worker": worker, "attempt": table.c.attempt + 1,
                "lease_until": now(self._lease), "started_at": now(),
            }))  # fmt: skip
        return claimed[0] if claimed else None

    def heartbeat(self, task: Task, stage: str | None, fraction: float) -> Heartbeat:
        """Extends the lease and reports progress; fraction in [0, 1] is of the whole."""
        with self._database.write() as conn:
            asked = conn.execute(
                update(table).where(_held(task)).values(
                    stage=stage, fraction=min(max(fraction, 0.0), 1.0), lease_until=now(self._lease)
                ).returning(table.c.cancel_requested)
            ).scalar()  # fmt: skip
        return "lost" if asked is None else "cancel" if asked else "ok"

    def crashed(self, task: Task, code: str = WORKER_DIED, detail: Detail | None = None) -> AfterCrash:
        """The task's process died: counts a crash, then queues it again or fails it with ``code``."""
        with self._database.write() as conn:
            moved = self._take_back(conn, _held(task), code, detail)
        return moved[0].state if moved else "lost"  # type: ignore[return-value]

    def release(self, task: Task) -> bool:
        """Puts a claimed task back without blame, as at SIGTERM; False when the claim was lost."""
        with self._database.write() as conn:
            stopped = _move(conn, _cancelling().where(_held(task), table.c.cancel_requested == 1))
            return bool(stopped or _move(conn, _requeueing(0).where(_held(task))))

    def _take_back(
        self, conn: Connection, which: Any, code: str = WORKER_DIED, detail: Detail | None = None
    ) -> list[Task]:
        last = table.c.crashes + 1 >= self._max_crashes
        reason = detail or (
            f"The worker died {self._max_crashes} times on this task, so it is not tried again: "
            "the mesh may need more memory or time than is allowed."
        )
        failing = _failing(code, reason).values(crashes=table.c.crashes + 1)
        return [
            *_move(conn, _cancelling().where(which, table.c.cancel_requested == 1)),
            *_move(conn, failing.where(which, last)),
            *_move(conn, _requeueing(1).where(which)),
        ]


def has_state(state: str) -> ColumnElement[bool]:
    """Whether a task is in that state, in the words that partial indexes are found by."""
    # Written out and not bound: SQLite uses a partial index only where its condition stands in the statement,
    # and an idle worker that polls must not walk through the tasks of years.
    return table.c.state == bindparam("state", state, literal_execute=True, unique=True)


def _held(task: Task) -> Any:
    return and_(table.c.id == task.id, table.c.attempt == task.attempt, table.c.state == "running")


def _cancelling() -> Update:
    return update(table).values({**_NOT_HELD, "state": "cancelled", "finished_at": now()})


def _requeueing(crashes: int) -> Update:
    return update(table).values(
        {**_NOT_HELD, **_FRESH, "state": "queued", "crashes": table.c.crashes + crashes, "started_at": None}
    )


def _failing(code: str, detail: Detail) -> Update:
    reason = {"message": detail} if isinstance(detail, str) else dict(detail)
    values = {**_NOT_HELD, "state": "failed", "error_code": code, "error_detail": reason}
    return update(table).values({**values, "finished_at": now()})


def _fenced(conn: Connection, task: Task, change: Update) -> Task:
    moved = _move(conn, change.where(_held(task)))
    if not moved:
        raise _stale(task)
    return moved[0]


def _stale(task: Task) -> StaleClaim:
    return StaleClaim(
        f"Claim {task.attempt} of task {task.id} is over, so its result was not written.",
        task=task.id, attempt=task.attempt,
    )  # fmt: skip


def _move(conn: Connection, change: Update) -> list[Task]:
    """Changes tasks, and the shapes whose state follows them."""
    tasks = [task_of_row(row) for row in conn.execute(change.returning(table)).mappings()]
    following: dict[str, list[str]] = {}
    for task in tasks:
        if task.kind == "describe":
            following.setdefault("indexed" if task.state == "succeeded" else task.state, []).append(task.id)
    for state, ids in following.items():
        becomes: ColumnElement[str] = literal(state)
        if state in ("failed", "cancelled"):
            becomes = case((described, "indexed"), else_=becomes)
        for start in range(0, len(ids), _MANY):
            conn.execute(
                update(shape_table)
                .where(shape_table.c.task_id.in_(ids[start : start + _MANY]), shape_table.c.state != becomes)
                .values(state=becomes, updated_at=now())
            )
    return tasks


def _live_description(conn: Connection, shape_id: str | None) -> bool:
    live = and_(table.c.shape_id == shape_id, table.c.kind == "describe", table.c.state.in_(_LIVE))
    return bool(conn.execute(select(exists().where(live))).scalar_one())
