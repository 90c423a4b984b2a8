"""Waiting for a task inside a request, without holding a thread."""

from __future__ import annotations

import asyncio
import time

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request

from service.context import Context
from store import tasks
from store.records import Task

__all__ = ["wait_for"]

FIRST_PAUSE = 0.02
LAST_PAUSE = 0.25


def _task(context: Context, task_id: str) -> Task:
    with context.database.read() as conn:
        return tasks.get(conn, task_id)


async def wait_for(request: Request, context: Context, task_id: str, seconds: float) -> Task:
    """The task once it has ended, or as it is after ``seconds``, when the client left, or at shutdown.

    The worker is another process and SQLite tells nobody, so the row is polled, with growing pauses.
    """
    until = time.monotonic() + seconds
    pause = FIRST_PAUSE
    while True:
        task = await run_in_threadpool(_task, context, task_id)
        left = until - time.monotonic()
        if task.ended or left <= 0 or context.stopping.is_set() or await request.is_disconnected():
            return task
        await asyncio.sleep(min(pause, left))
        pause = min(pause * 1.2, LAST_PAUSE)
