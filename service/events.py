"""What happens, told as it happens: one look at the database several times a second for all who watch.

``EventHub(database, most)``: ``subscribe(scope) -> Subscription`` raises TooManyStreams
``Subscription``: ``opening()``, ``async next(seconds)``, ``close()``; it holds at most some hundred events
"""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import Any

import structlog
from sqlalchemy import Connection
from starlette.concurrency import run_in_threadpool

from service.errors import TooManyStreams
from service.values import task_values
from store import changes
from store.engine import Database
from store.records import Task
from store.sql import read_clock

__all__ = ["Event", "EventHub", "Scope", "Subscription"]

_EVERY = 0.25
_OVERLAP = timedelta(seconds=5)  # longer than any transaction is open after it looked at the clock
_MOST_HELD = 256
_AFTER_FAILURE = 1.0
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)

_log = structlog.get_logger("service.events")


@dataclass(frozen=True)
class Event:
    """What goes out. moment: of the database's clock, which makes the id."""

    name: str
    data: dict[str, Any]
    moment: datetime

    def encoded(self) -> bytes:
        number = (self.moment - _EPOCH) // timedelta(microseconds=1)
        return f"id: {number}\nevent: {self.name}\ndata: {json.dumps(self.data)}\n\n".encode()


@dataclass(frozen=True)
class Scope:
    """What a subscriber hears of. sees: whether a task of that collection id may be told."""

    sees: Callable[[str | None], bool]
    collection_id: str | None = None
    collection: str | None = None
    task: str | None = None

    def covers(self, task: Task) -> bool:
        if self.task is not None and task.id != self.task:
            return False
        mine = self.collection_id is None or task.collection_id == self.collection_id
        return mine and self.sees(task.collection_id)


@dataclass
class Subscription:
    """One who watches. Too slow a reader loses what it did not take, and is told so by ``reset``."""

    hub: EventHub
    scope: Scope
    queue: asyncio.Queue[Event] = field(default_factory=lambda: asyncio.Queue(_MOST_HELD))
    revision: int = -1
    waiting: dict[str, Any] = field(default_factory=dict)
    known: dict[str, tuple[object, ...]] = field(default_factory=dict)
    """How the tasks were that the snapshot told."""

    async def opening(self, since: datetime | None) -> list[Event]:
        """How things are now, and what ended since a moment."""
        await self.hub.looked.wait()  # what changes after this is told
        return await run_in_threadpool(self.hub.opening, self, since)

    async def next(self, seconds: float) -> Event | None:
        """The next event, or None when there is none for so long."""
        try:
            return await asyncio.wait_for(self.queue.get(), seconds)
        except TimeoutError:
            return None

    def tell(self, event: Event) -> None:
        if self.queue.full():
            while not self.queue.empty():
                self.queue.get_nowait()
            event = Event("reset", {}, event.moment)
        self.queue.put_nowait(event)

    def close(self) -> None:
        self.hub.subscriptions.discard(self)

    def __hash__(self) -> int:
        return id(self)

    def __eq__(self, other: object) -> bool:
        return self is other


class EventHub:
    """All who watch through this process. Used in its event loop only; looking happens in a thread."""

    def __init__(self, database: Database, most: int) -> None:
        self._database = database
        self._most = most
        self._look: asyncio.Task[None] | None = None
        self._counted = float("-inf")
        self._recount = False
        self.looked = asyncio.Event()
        self.subscriptions: set[Subscription] = set()

    def subscribe(self, scope: Scope) -> Subscription:
        """Raises TooManyStreams."""
        if len(self.subscriptions) >= self._most:
            raise TooManyStreams(
                f"This service tells at most {self._most} listeners at once; ask for tasks now and then instead.",
                limit=self._most, retry_after=5,
            )  # fmt: skip
        made = Subscription(self, scope)
        self.subscriptions.add(made)
        if self._look is None or self._look.done():
            self.looked.clear()
            self._look = asyncio.create_task(self._watch())
        return made

    def opening(self, subscription: Subscription, since: datetime | None) -> list[Event]:
        scope = subscription.scope
        with self._database.read() as conn:
            found = changes.recent(conn, since)
            now = [task for task in found.tasks.values() if scope.covers(task)]
            live = [task for task in now if task.state == "running"]
            queued = [task for task in changes.first_queued(conn, scope.collection_id) if scope.covers(task)]
            data: dict[str, Any] = {
                "tasks": _values(conn, [*live, *queued]), "waiting": changes.waiting(conn, scope.collection_id),
                "revision": found.revision,
            }  # fmt: skip
            events = [Event("snapshot", data, found.at)]
            events += [Event("task", value, found.at) for value in _values(conn, [t for t in now if t.ended])]
        if not found.complete:
            events.append(Event("reset", {}, found.at))
        subscription.revision, subscription.waiting = found.revision, data["waiting"]
        subscription.known = {task.id: _signature(task) for task in [*live, *queued]}
        return events

    async def _watch(self) -> None:
        """Look and tell until nobody listens any more."""
        before: dict[str, tuple[object, ...]] | None = None
        since: datetime | None = None
        while self.subscriptions:
            try:
                found, values = await run_in_threadpool(self._recent, since, before)
                self._tell_tasks(found, values)
                if values:
                    self._recount = True
                await self._tell_waiting(found.at)
                await self._tell_revision(found)
            except Exception:
                _log.exception("looking_failed")  # a database that is busy may be free again
                await asyncio.sleep(_AFTER_FAILURE)
                continue
            before = {task.id: _signature(task) for task in found.tasks.values()}
            since = found.at - _OVERLAP
            self.looked.set()
            await asyncio.sleep(_EVERY)

    def _tell_tasks(self, found: changes.Recent, values: dict[str, dict[str, Any]]) -> None:
        for subscription in self.subscriptions:
            if not found.complete:
                subscription.tell(Event("reset", {}, found.at))
            for task_id, value in values.items():
                task = found.tasks[task_id]
                told = subscription.known.pop(task_id, None) == _signature(task)
                if subscription.scope.covers(task) and not told:
                    subscription.tell(Event("task", value, found.at))

    async def _tell_revision(self, found: changes.Recent) -> None:
        behind = [s for s in self.subscriptions if 0 <= s.revision < found.revision]
        if not behind:
            return
        asked = {(s.scope.collection_id, s.revision) for s in behind if s.scope.collection_id is not None}
        touched = await run_in_threadpool(self._touched, asked)
        for subscription in behind:
            scope = subscription.scope
            if scope.collection_id is None or (scope.collection_id, subscription.revision) in touched:
                told = {"collection": scope.collection, "revision": found.revision}
                subscription.tell(Event("collection", told, found.at))
            subscription.revision = found.revision

    async def _tell_waiting(self, at: datetime) -> None:
        """At most once a second: counting a long queue takes its time."""
        if not self._recount or time.monotonic() - self._counted < 1.0:
            return
        self._recount, self._counted = False, time.monotonic()
        for collection_id in {s.scope.collection_id for s in self.subscriptions}:
            counts = await run_in_threadpool(self._waiting, collection_id)
            for subscription in self.subscriptions:
                if subscription.scope.collection_id == collection_id and subscription.waiting != counts:
                    subscription.waiting = counts
                    subscription.tell(Event("waiting", counts, at))

    def _waiting(self, collection_id: str | None) -> dict[str, Any]:
        with self._database.read() as conn:
            return {**changes.waiting(conn, collection_id)}

    def _recent(
        self, since: datetime | None, before: dict[str, tuple[object, ...]] | None
    ) -> tuple[changes.Recent, dict[str, dict[str, Any]]]:
        with self._database.read() as conn:
            found = changes.recent(conn, since or read_clock(conn) - _OVERLAP)
            new = [t for t in found.tasks.values() if before is not None and before.get(t.id) != _signature(t)]
            return found, dict(zip([task.id for task in new], _values(conn, new), strict=True))

    def _touched(self, asked: Iterable[tuple[str, int]]) -> set[tuple[str, int]]:
        with self._database.read() as conn:
            return {(name, revision) for name, revision in asked if changes.searchable(conn, name, revision)}


def _signature(task: Task) -> tuple[object, ...]:
    return task.state, task.stage, round(task.fraction, 3), task.attempt, task.cancel_requested, task.error_code


def _values(conn: Connection, found: list[Task]) -> list[dict[str, Any]]:
    return [value.model_dump(mode="json") for value in task_values(conn, found)]
