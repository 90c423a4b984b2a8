"""What the client raises.

ReebaseError
├── ServiceError        the service's own code     the service refused the request
├── ServiceUnreachable  service_unreachable        nobody answered, however often it was tried
├── UnexpectedReply     unexpected_reply           something answered that is no Reebase service
├── RequestBroken       request_broken             the request could not be sent whole
├── TaskFailed          task_failed
└── WaitTimeout         wait_timeout               also a TimeoutError
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from reebase.errors import ReebaseError

if TYPE_CHECKING:
    from reebase.client.records import Task

__all__ = ["RequestBroken", "ServiceError", "ServiceUnreachable", "TaskFailed", "UnexpectedReply", "WaitTimeout"]


class ServiceError(ReebaseError):
    """The service refused the request.

    status: the HTTP status, None for one query of a batch. code: the service's stable code. problem: the whole
    problem document; errors: its list of the values that were refused.
    """

    def __init__(self, status: int | None, problem: Mapping[str, Any]) -> None:
        self.status = status
        self.code = str(problem.get("code", "unknown"))
        self.problem = dict(problem)
        self.errors: list[dict[str, Any]] = list(problem.get("errors") or ())
        super().__init__(str(problem.get("detail") or problem.get("title") or f"HTTP {status}"))


class ServiceUnreachable(ReebaseError):
    """The service did not answer."""

    code = "service_unreachable"


class UnexpectedReply(ReebaseError):
    """What answered is not a Reebase service of this version."""

    code = "unexpected_reply"


class RequestBroken(ReebaseError):
    """The request could not be sent whole; a file may have changed while it was read."""

    code = "request_broken"


class TaskFailed(ReebaseError):
    """A task ended without its result."""

    code = "task_failed"

    def __init__(self, task: Task) -> None:
        self.task = task
        why = f"{task.error.detail} [{task.error.code}]" if task.error else "it was cancelled"
        super().__init__(f"The {task.kind} task {task.id} ended as {task.state}: {why}", task=task.id)


class WaitTimeout(ReebaseError, TimeoutError):
    """The task did not end in time; it goes on."""

    code = "wait_timeout"
