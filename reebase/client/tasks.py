"""Calls about tasks."""

from __future__ import annotations

import time
from collections.abc import Iterator

from reebase.client import received
from reebase.client.errors import TaskFailed, WaitTimeout
from reebase.client.records import Task
from reebase.client.requests import Requests, given, segment
from reebase.errors import ParameterError

__all__ = ["TaskCalls"]


class TaskCalls(Requests):
    """What the service does in the background."""

    def task(self, task: str, *, wait: float = 0.0) -> Task:
        """A task; with ``wait`` once it has ended, or after so many seconds (60 at most)."""
        return self._get(received.task_of, f"/v1/tasks/{segment(task)}", params={"wait": wait} if wait > 0 else {})

    def tasks(
        self, *, state: str | None = None, kind: str | None = None, collection: str | None = None,
        shape: str | None = None,
    ) -> Iterator[Task]:  # fmt: skip
        """Tasks, newest first; those that have all that is given."""
        filters = given({"state": state, "kind": kind, "collection": collection, "shape": shape})
        return self._pages(received.task_of, "/v1/tasks", filters)

    def cancel(self, task: str) -> Task:
        """Cancel a task; a running one stops as soon as its worker hears of it.

        Raises ServiceError: ``task_not_cancellable`` when it has ended.
        """
        return self._get(received.task_of, f"/v1/tasks/{segment(task)}/cancel", method="POST")

    def retry(self, task: str) -> Task:
        """Queue a failed or cancelled task again. Raises ServiceError: ``task_not_retryable``."""
        return self._get(received.task_of, f"/v1/tasks/{segment(task)}/retry", method="POST")

    def wait(self, task: Task | str | None, *, timeout: float = 600.0) -> Task:
        """The task once it succeeded.

        Raises TaskFailed when it fails or is cancelled, WaitTimeout after ``timeout`` seconds.
        """
        if task is None:
            raise ParameterError("There is no task to wait for.", parameter="task")
        identifier = task if isinstance(task, str) else task.id
        end = time.monotonic() + timeout
        while True:
            began = time.monotonic()
            now = self.task(identifier, wait=min(max(end - began, 0.0), self._poll))
            if now.state == "succeeded":
                return now
            if now.ended:
                raise TaskFailed(now)
            if time.monotonic() >= end:
                raise WaitTimeout(f"Task {identifier} is still {now.state} after {timeout:g} seconds; it goes on.")
            # A service that stops answers long polls at once.
            time.sleep(max(0.0, 0.1 - (time.monotonic() - began)))
