"""Claim a task, run it, keep its lease, finish it; stop in order when told so.

One worker does one task at a time, in one thread: whoever wants more of them starts more workers.
"""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable
from typing import Any

import structlog

from reebase.errors import ReebaseError
from reebase.words import program
from store import faults, migrate, sweep
from store.blobs import open_blobs
from store.engine import Database
from store.errors import ProfileChanged, StaleClaim, StorageFull, StoreBusy, UnsupportedDatabase
from store.records import Task
from store.settings import Settings
from store.tasks import DatabaseQueue, TaskQueue
from worker.claim import CancelledError, Claim, LostError, Stop, StoppedError
from worker.guards import ChildLimits
from worker.jobs import denoise, describe, duplicates, evaluate, map, query, report, synthesise
from worker.sandbox import ChildError, Sandbox, SandboxError
from worker.tools import Tools

__all__ = ["Worker", "await_schema", "default_name"]

_POLL_SECONDS = 0.1
_PAUSE_SECONDS = 1.0  # after a failure that time may heal
_SWEEP_SECONDS = 600.0
_MOST_DETAIL = 1000  # characters

_log = structlog.get_logger("worker")

_PASSING = (StoreBusy, StorageFull)
_HEALING = (StorageFull, ProfileChanged)  # of a job: another attempt may end better

_JOBS: dict[str, Callable[[Tools, Claim], None]] = {
    "describe": describe.run,
    "query": query.run,
    "denoise": denoise.run,
    "evaluate": evaluate.run,
    "map": map.run,
    "duplicates": duplicates.run,
    "report": report.run,
    "synthesise": synthesise.run,
}


def default_name() -> str:
    """Host and process, as operators look for it."""
    return f"{socket.gethostname()}:{os.getpid()}"


def await_schema(url: str, stop: Stop, *, patience: float = 60.0) -> None:
    """Wait until the database has the schema of this version; whoever starts the service brings it there.

    patience: in seconds. Raises UnsupportedDatabase when it is over, StoppedError.
    """
    needed = migrate.head()
    end = time.monotonic() + patience
    told = False
    while (found := migrate.current(url)) != needed:
        if stop.requested:
            raise StoppedError
        if time.monotonic() > end:
            raise UnsupportedDatabase(
                f"The database has schema {found or 'none'}, this worker needs {needed}: "
                f"run `{program()} migrate`, then start it again.",
                found=found, needed=needed,
            )  # fmt: skip
        if not told:
            _log.warning("awaiting_migration", found=found, needed=needed, seconds=patience)
            told = True
        time.sleep(_POLL_SECONDS)


class Worker:
    """Everything one worker process has. A context: inside it, ``run`` until told to stop.

    sandbox: one whose zygote may have been launched already; the worker closes it. It must be entered in a
    thread that lives as long as the process (see Sandbox).
    """

    def __init__(
        self,
        settings: Settings,
        name: str | None = None,
        stop: Stop | None = None,
        sandbox: Sandbox | None = None,
    ) -> None:
        self.name = name or default_name()
        self.stop = stop or Stop()
        self._settings = settings
        self._database = Database(settings.database_url)
        self._queue: TaskQueue = DatabaseQueue(self._database, settings)
        self._sandbox = sandbox or Sandbox()
        self._sandbox.limits = _limits(settings)
        self._tools = Tools(settings, self._database, self._queue, open_blobs(settings), self._sandbox)
        self._swept: float | None = None

    def __enter__(self) -> Worker:
        """Start the zygote and say which guards are on. Raises SandboxError, StoppedError."""
        began = time.monotonic()
        self._sandbox.start(self._while_starting)
        _log.info(
            "ready", worker=self.name, zygote=self._sandbox.zygote,
            seconds=round(time.monotonic() - began, 2),
            guards={guard.name: guard.note for guard in self._sandbox.guards if guard.on},
        )  # fmt: skip
        missing = {guard.name: guard.note for guard in self._sandbox.guards if not guard.on}
        if missing:
            _log.warning("guards_missing", worker=self.name, guards=missing)
        return self

    def __exit__(self, *_: object) -> None:
        self._sandbox.close()
        self._database.close()

    def run(self, *, once: bool = False) -> None:
        """Do tasks until told to stop; with ``once``, until none is waiting."""
        while not self.stop.requested:
            try:
                task = self._queue.claim(self.name)
            except _PASSING as error:
                _log.warning("claim_failed", error=error.message)
                self._pause()
                continue
            if task is not None:
                self._do(task)
                # Not only when idle: a queue that never empties must not fill the disk.
                self._sweep_when_due()
            elif once:
                return
            else:
                self._sweep_when_due()
                time.sleep(_POLL_SECONDS)

    def _do(self, task: Task) -> None:
        began = time.monotonic()
        claim = Claim(task, self._queue, self.stop, self._settings.lease_seconds)
        try:
            outcome = self._attempt(claim)
        except (LostError, StaleClaim):
            outcome = "lost"
        except _PASSING as error:
            # Nothing could be written, not even that it failed: the lease ends and the task is taken again.
            outcome = error.code
            self._pause()
        if task.blob is not None:
            self._forget(task.blob)
        _log.info(
            "task_ended", task=task.id, kind=task.kind, attempt=task.attempt, outcome=outcome,
            seconds=round(time.monotonic() - began, 3),
        )  # fmt: skip

    def _attempt(self, claim: Claim) -> str:
        """Do the task and write how it ended; what time may heal is counted as a crash and tried again."""
        task = claim.task
        try:
            faults.point("worker.claimed")
            _JOBS[task.kind](self._tools, claim)
            return "succeeded"
        except CancelledError:
            with self._database.write() as conn:
                self._queue.cancelled(conn, task)
            return "cancelled"
        except StoppedError:
            self._queue.release(task)
            return "released"
        except SandboxError:
            self._queue.release(task)
            raise
        except ChildError as error:
            return self._failed(task, error.code, error.detail, lasting=error.lasting)
        except (LostError, StaleClaim, StoreBusy):
            raise
        except ReebaseError as error:
            detail = {"message": error.message, **error.details}
            return self._failed(task, error.code, detail, lasting=not isinstance(error, _HEALING))
        except Exception as error:
            _log.exception("unexpected_error", task=task.id, kind=task.kind)
            detail = {"message": f"{type(error).__name__}: {error}"[:_MOST_DETAIL]}
            return self._failed(task, "internal_error", detail, lasting=False)

    def _failed(self, task: Task, code: str, detail: dict[str, Any], *, lasting: bool) -> str:
        if lasting:
            with self._database.write() as conn:
                self._queue.fail(conn, task, code, detail)
            return code
        after = self._queue.crashed(task, code, detail)
        self._pause()
        return f"{code}, {after}"

    def _forget(self, sha256: str) -> None:
        """Remove the mesh of a query, unless the task goes on or the bytes are a shape's too."""
        try:
            sweep.remove_unnamed(
                self._database, self._tools.blobs, sha256, self._settings.sweep_grace_seconds
            )
        except (ReebaseError, OSError) as error:
            _log.warning("query_not_removed", error=str(error))  # the sweep will

    def _sweep_when_due(self) -> None:
        now = time.monotonic()
        if self.stop.requested or (self._swept is not None and now - self._swept < _SWEEP_SECONDS):
            return
        self._swept = now
        try:
            sweep.sweep(self._database, self._tools.blobs, self._settings)
        except ReebaseError as error:
            _log.warning("sweep_failed", error=error.message)

    def _while_starting(self) -> None:
        if self.stop.requested:
            raise StoppedError

    def _pause(self) -> None:
        end = time.monotonic() + _PAUSE_SECONDS
        while time.monotonic() < end and not self.stop.requested:
            time.sleep(_POLL_SECONDS)


def _limits(settings: Settings) -> ChildLimits:
    return ChildLimits(
        memory_bytes=settings.child_memory_bytes,
        cpu_seconds=settings.child_cpu_seconds,
        wall_seconds=settings.child_wall_seconds,
        file_bytes=settings.child_file_bytes,
    )
