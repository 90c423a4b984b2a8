"""Requests that send a mesh which is not kept in a collection, and are answered by a task: queries, denoisings."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pydantic import BaseModel
from sqlalchemy import Connection
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import Response

from service.auth import Principal
from service.context import Context
from service.problems import task_problem
from service.replay import REPLAYED, json_response, once, same_request
from service.routes.common import open_collection
from service.routes.tasks import ASKED_BY
from service.uploads import Upload
from service.values import task_value
from service.waiting import wait_for
from store import faults, tasks
from store.errors import Conflict, NotFound
from store.records import Task, TaskKind

__all__ = ["answer_of_task", "enqueue"]

Pending = Callable[..., BaseModel]
"""A schema with the one member ``task``."""


def enqueue(
    request: Request, here: Context, principal: Principal, upload: Upload, kind: TaskKind, params: dict[str, Any],
    idempotency_key: str | None, pending: Pending, collection: str | None = None,
) -> tuple[str, Response]:  # fmt: skip
    """The id of the task that will answer, and the answer that names it."""
    sha256 = upload.keep()
    faults.point("upload.blob_stored")
    asked = same_request(request, principal, idempotency_key, {"sha256": sha256, **params})
    try:
        with here.database.write() as conn:
            opened = None if collection is None else open_collection(conn, principal, collection).id

            def work() -> Response:
                upload.check_kept(sha256)
                asking = {**params, ASKED_BY: principal.key_id}
                task = tasks.enqueue(conn, kind, collection_id=opened, params=asking, blob=sha256)
                return _named(conn, task, pending, {})

            response = once(conn, here, asked, work)
    except (Conflict, NotFound):
        here.remove_unnamed(sha256, 0.0)
        raise
    if REPLAYED in response.headers:
        here.remove_unnamed(sha256, 0.0)  # the task that has it may have ended long ago
    faults.point("upload.row_committed")
    return response.headers["location"].rsplit("/", 1)[-1], response


async def answer_of_task(
    request: Request, here: Context, enqueued: tuple[str, Response], wait: float,
    answer: Callable[[Task], BaseModel], pending: Pending,
) -> Response:  # fmt: skip
    """The answer when it came in time, the problem when the task failed, else the task as it is."""
    task_id, first = enqueued
    task = await wait_for(request, here, task_id, min(wait, here.settings.max_wait_seconds))
    replayed = {name: value for name, value in first.headers.items() if name == REPLAYED.lower()}
    if task.state == "succeeded":
        return json_response(answer(task), 200, replayed)
    if task.ended:
        return task_problem(request, task)
    return await run_in_threadpool(_pending, here, task, pending, replayed)


def _pending(here: Context, task: Task, pending: Pending, headers: dict[str, str]) -> Response:
    with here.database.read() as conn:
        return _named(conn, task, pending, headers)


def _named(conn: Connection, task: Task, pending: Pending, headers: dict[str, str]) -> Response:
    location = {"Location": f"/v1/tasks/{task.id}"}
    return json_response(pending(task=task_value(conn, task)), 202, {**headers, **location})
