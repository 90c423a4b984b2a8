"""What happens, as server-sent events."""

from __future__ import annotations

import time
from collections.abc import AsyncIterator
from datetime import UTC, datetime, timedelta
from typing import Annotated, Any

from fastapi import Header, Query
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response, StreamingResponse

from service.auth import Principal, Reader
from service.context import Context, Here
from service.events import Event, Scope, Subscription
from service.routes.common import api_router, open_collection
from service.routes.tasks import visible_task
from service.schemas.common import COLLECTION_NAME

__all__ = ["router"]

router = api_router("tasks")

_TICK = 0.25  # how soon a stream ends when the service stops
_BEAT = 15.0

_NAMES = ["snapshot", "task", "waiting", "collection", "reset", "bye"]
_EVENT = {
    "type": "object", "required": ["event", "data"],
    "properties": {
        "id": {"type": "string"}, "event": {"type": "string", "enum": _NAMES},
        "data": {"type": "string", "description": "A JSON object."},
    },
}  # fmt: skip

_STREAM: dict[int | str, dict[str, Any]] = {
    200: {
        "description": "Events until the client leaves, the service stops or the stream's time is over.",
        "content": {"text/event-stream": {"schema": _EVENT}},
    },
}


@router.get(
    "/events", operation_id="streamEvents", summary="What happens, as it happens", response_class=Response,
    responses=_STREAM,
)  # fmt: skip
async def stream_events(
    here: Here, principal: Reader,
    collection: Annotated[str | None, Query(pattern=COLLECTION_NAME, description="Only of this collection.")] = None,
    task: Annotated[str | None, Query(max_length=80, description="Only of this task.")] = None,
    last_event_id: Annotated[
        str | None, Header(pattern=r"^[0-9]{1,17}$", description="What ended since then is told again.")
    ] = None,
) -> Response:  # fmt: skip
    """Server-sent events. First `snapshot`: `tasks` that run and the first that wait, how many there are, the revision.

    Then `task` whenever one changes (its value, without a result), `collection` when what is searched changed,
    `reset` when more happened than was told: ask for the lists again, and at last `bye`: connect again.
    """
    scope = await run_in_threadpool(_scope, here, principal, collection, task)
    since = None if last_event_id is None else datetime(1970, 1, 1, tzinfo=UTC) + timedelta(
        microseconds=int(last_event_id)
    )  # fmt: skip
    subscription = here.events.subscribe(scope)
    try:
        opening = await subscription.opening(since)
    except BaseException:
        subscription.close()
        raise
    return StreamingResponse(
        _told(here, subscription, opening), media_type="text/event-stream",
        headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"},
    )  # fmt: skip


def _scope(here: Context, principal: Principal, collection: str | None, task: str | None) -> Scope:
    with here.database.read() as conn:
        opened = None if collection is None else open_collection(conn, principal, collection)
        if task is not None:
            visible_task(conn, principal, task)
    if opened is None:
        return Scope(principal.sees, principal.collection_id, principal.collection, task)
    return Scope(principal.sees, opened.id, opened.name, task)


async def _told(here: Context, subscription: Subscription, opening: list[Event]) -> AsyncIterator[bytes]:
    ends = time.monotonic() + here.settings.max_stream_seconds
    beaten = time.monotonic()
    try:
        for event in opening:
            yield event.encoded()
        while not here.stopping.is_set() and time.monotonic() < ends:
            event_or_none = await subscription.next(_TICK)
            if event_or_none is not None:
                yield event_or_none.encoded()
                beaten = time.monotonic()
            elif time.monotonic() - beaten > _BEAT:
                yield b": beat\n\n"
                beaten = time.monotonic()
        yield b"event: bye\ndata: {}\n\n"
    finally:
        subscription.close()
