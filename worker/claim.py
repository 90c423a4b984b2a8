"""The claim of a worker on a task: kept by heartbeats, given up for a cancellation or a stop."""

from __future__ import annotations

import os
import select
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field

import structlog

from store.errors import StorageFull, StoreBusy
from store.records import Task
from store.tasks import Heartbeat, TaskQueue

__all__ = ["CancelledError", "Claim", "LostError", "Stop", "StoppedError"]

_MOST_BETWEEN_HEARTBEATS = 0.5  # seconds; progress is seen, and a cancellation obeyed, within this time

_log = structlog.get_logger("worker")


class CancelledError(Exception):
    """Somebody cancelled the task."""


class LostError(Exception):
    """The claim is over: the lease ended and the task is another worker's, or its shape was deleted."""


class StoppedError(Exception):
    """The worker was told to stop and the grace for what it runs is over."""


@dataclass
class Stop:
    """Whether the worker was told to stop: by a signal, or because whoever holds its lifeline is gone.

    grace_seconds: how long what runs may go on after that. lifeline: a descriptor that is at its end once
    the process that started this worker has died, None when there is none.
    """

    grace_seconds: float = 5.0
    lifeline: int | None = None
    since: float | None = None

    def request(self) -> None:
        """The first time begins the grace; the second ends it."""
        self.since = time.monotonic() if self.since is None else float("-inf")

    @property
    def requested(self) -> bool:
        if self.since is None and self.lifeline is not None:
            readable, _, _ = select.select([self.lifeline], [], [], 0)
            if readable and not os.read(self.lifeline, 1):
                self.request()
        return self.since is not None

    @property
    def overdue(self) -> bool:
        return self.requested and time.monotonic() - (self.since or 0.0) > self.grace_seconds


@dataclass
class Claim:
    """A task, and how far it is. ``progress`` and ``tick`` are what a sandbox calls while a child works."""

    task: Task
    queue: TaskQueue
    stop: Stop
    lease_seconds: float
    stage: str | None = None
    fraction: float = 0.0
    _beaten: float = field(init=False)

    def __post_init__(self) -> None:
        self._beaten = time.monotonic()  # a claim is as good as a heartbeat

    def progress(self, stage: str, fraction: float) -> None:
        """The stage that begins and the fraction of the whole that is done; the next heartbeat writes it."""
        self.stage, self.fraction = stage, fraction

    def tick(self) -> None:
        """Send a heartbeat when one is due. Raises CancelledError, LostError, StoppedError."""
        if self.stop.overdue:
            raise StoppedError
        now = time.monotonic()
        if now - self._beaten < self._interval:
            return
        self._beaten = now
        answer = self._beat()
        if answer == "cancel":
            raise CancelledError
        if answer == "lost":
            raise LostError

    @contextmanager
    def kept(self) -> Iterator[None]:
        """Heartbeats from another thread while this one waits for a disk, which may take longer than the lease.

        Raises what ``tick`` raises once it is done: until then nobody hears of a cancellation.
        """
        done = threading.Event()

        def beat() -> None:
            with suppress(StorageFull):  # the work itself meets that
                while not done.wait(self._interval):
                    self._beat()

        thread = threading.Thread(target=beat, name="heartbeat", daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()
        self.tick()

    @property
    def _interval(self) -> float:
        return min(self.lease_seconds / 3, _MOST_BETWEEN_HEARTBEATS)

    def _beat(self) -> Heartbeat | None:
        """The answer to a heartbeat, None when it did not get through."""
        try:
            return self.queue.heartbeat(self.task, self.stage, self.fraction)
        except StoreBusy as error:
            # The lease is several heartbeats long; if none gets through, the claim is lost by itself.
            _log.warning("heartbeat_failed", task=self.task.id, error=error.message)
            return None
