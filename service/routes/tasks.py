"""Tasks: look, wait, cancel, retry."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import Query
from sqlalchemy import Connection
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request

from service.auth import Principal, Reader, Writer
from service.context import Context, Here
from service.routes.common import Cursor, IdPath, PageSize, api_router, open_collection
from service.schemas.common import PageOf
from service.schemas.tasks import TaskValue
from service.values import task_value, task_values
from service.waiting import wait_for
from store import tasks
from store.errors import TaskNotFound
from store.records import Task, TaskKind

__all__ = ["ASKED_BY", "own_task", "router", "visible_task"]

ASKED_BY = "asked_by"
"""The parameter of the task of a query or a denoising that names the key that asked."""

_OWN = frozenset({"query", "denoise"})

router = api_router("tasks")


def visible_task(conn: Connection, principal: Principal, task_id: str) -> Task:
    """The task. Raises TaskNotFound, also for a task of a collection that the key does not open."""
    task = tasks.get(conn, task_id)
    if not principal.sees(task.collection_id):
        raise _absent(task_id)
    return task


def own_task(conn: Connection, here: Context, principal: Principal, task_id: str) -> Task:
    """The task whose files are asked for. Raises TaskNotFound.

    What was made of a mesh that is kept in no collection is for the key that sent it, and for keys with the scope
    admin; where no keys are needed, for everyone.
    """
    task = visible_task(conn, principal, task_id)
    if task.kind not in _OWN or here.settings.anonymous or principal.scope == "admin":
        return task
    if principal.key_id is None or task.params.get(ASKED_BY) != principal.key_id:
        raise _absent(task_id)
    return task


def _absent(task_id: str) -> TaskNotFound:
    return TaskNotFound(f"There is no task {task_id[:80]!r}.")


@router.get("/tasks", operation_id="listTasks", summary="Tasks, newest first")
def list_tasks(
    here: Here, principal: Reader, limit: PageSize = 50, cursor: Cursor = None,
    state: Literal["queued", "running", "succeeded", "failed", "cancelled"] | None = None,
    kind: TaskKind | None = None,
    collection: str | None = None, shape: str | None = None,
) -> PageOf[TaskValue]:  # fmt: skip
    """All tasks, or those of one state, kind, collection or shape."""
    with here.database.read() as conn:
        whose = principal.collection_id
        if collection is not None:
            whose = open_collection(conn, principal, collection).id
        page = tasks.list_page(
            conn, limit=limit, cursor=cursor, state=state, kind=kind, collection_id=whose, shape_id=shape
        )
        return PageOf(items=task_values(conn, page.items), next=page.next)


@router.get("/tasks/{task}", operation_id="getTask", summary="A task")
async def get_task(
    request: Request, here: Here, principal: Reader, task: IdPath,
    wait: Annotated[
        float, Query(ge=0, le=60, description="Answer once it has ended, or after so many seconds.")
    ] = 0,
) -> TaskValue:  # fmt: skip
    """Its state and progress; why it failed, or the answer of a query by mesh."""
    await run_in_threadpool(_check, here, principal, task)
    if wait > 0:
        await wait_for(request, here, task, min(wait, here.settings.max_wait_seconds))
    return await run_in_threadpool(_check, here, principal, task)


def _check(here: Context, principal: Principal, task_id: str) -> TaskValue:
    with here.database.read() as conn:
        return task_value(conn, visible_task(conn, principal, task_id))


@router.post("/tasks/{task}/cancel", operation_id="cancelTask", summary="Cancel a task")
def cancel_task(here: Here, principal: Reader, task: IdPath) -> TaskValue:
    """A queued task is cancelled at once; a running one as soon as its worker hears of it.

    Needs a key that may write, or for a query the key that asked it.
    """
    with here.database.write() as conn:
        found = visible_task(conn, principal, task)
        if principal.key_id is None or found.params.get(ASKED_BY) != principal.key_id:
            principal.need("write")
        cancelled = tasks.cancel(conn, task)
        value = task_value(conn, cancelled)
    if cancelled.blob is not None:
        here.remove_unnamed(cancelled.blob)
    return value


@router.post("/tasks/{task}/retry", operation_id="retryTask", summary="Queue a task again")
def retry_task(here: Here, principal: Writer, task: IdPath) -> TaskValue:
    """A failed or cancelled task is queued again, as if it had never run."""
    with here.database.write() as conn:
        visible_task(conn, principal, task)
        return task_value(conn, tasks.retry(conn, task))
