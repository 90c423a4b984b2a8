"""Who asks, and what that allows: API keys, scopes, collections, rate limits.

Authentication happens before routing and before a byte of the body is read; authorisation in the routes.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Annotated

from fastapi import Depends
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from reebase.errors import ReebaseError
from service.context import Context
from service.errors import ForbiddenScope, InvalidKey, MissingKey, RateLimited
from service.problems import problem_response
from store import keys
from store.errors import StorageFull, StoreBusy
from store.records import ApiKey

__all__ = ["ANONYMOUS", "Admin", "Authentication", "Principal", "Reader", "Writer"]

_RANK = {"read": 0, "write": 1, "admin": 2}


@dataclass(frozen=True)
class Principal:
    """Who sends a request: an API key, or anyone where keys are not asked for."""

    scope: str
    key: ApiKey | None = None

    @property
    def key_id(self) -> str | None:
        return None if self.key is None else self.key.id

    @property
    def collection(self) -> str | None:
        """Name of the one collection that the key opens, None for all."""
        return None if self.key is None else self.key.collection

    @property
    def collection_id(self) -> str | None:
        return None if self.key is None else self.key.collection_id

    @property
    def name(self) -> str:
        """For idempotency records: keys are apart from one another."""
        return self.key_id or "anonymous"

    def need(self, scope: str) -> None:
        """Raises ForbiddenScope when the key allows less than ``scope``."""
        if _RANK[self.scope] < _RANK[scope]:
            raise ForbiddenScope(
                f"This needs an API key with the scope {scope}; this key has {self.scope}.",
                needed=scope, found=self.scope,
            )  # fmt: skip

    def need_collection(self, name: str) -> None:
        """Raises ForbiddenScope when the key is for another collection."""
        if self.collection is not None and self.collection != name:
            raise ForbiddenScope(f"This API key is for the collection {self.collection} alone.")

    def need_everywhere(self) -> None:
        """Raises ForbiddenScope when the key is for one collection."""
        if self.collection is not None:
            raise ForbiddenScope(f"This API key is for the collection {self.collection} alone.")

    def sees(self, collection_id: str | None) -> bool:
        """Whether things of this collection may be shown."""
        return self.collection_id is None or self.collection_id == collection_id


ANONYMOUS = Principal("admin")


USE_NOTED_EVERY = timedelta(minutes=5)
"""How exact ``last_used_at`` is: a write for every request would make every reader a writer."""


def _verify(context: Context, secret: str) -> ApiKey | None:
    with context.database.read() as conn:
        key = keys.verify(conn, secret)
    if key is not None:
        used = key.last_used_at
        if used is None or datetime.now(UTC) - used > USE_NOTED_EVERY:
            # A note for people: a database that cannot be written now must not turn a reader away.
            with suppress(StoreBusy, StorageFull), context.database.write() as conn:
                keys.used(conn, key.id)
    return key


class Authentication:
    """Finds the principal of each request to the API; answers 401 and 429 itself."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        path = scope.get("path", "")
        if scope["type"] != "http" or not (path.startswith("/v1") or path == "/metrics"):
            await self.app(scope, receive, send)
            return
        try:
            scope["state"]["principal"] = await self._principal(scope)
        except ReebaseError as refusal:
            await problem_response(Request(scope), refusal)(scope, receive, send)
            return
        await self.app(scope, receive, send)

    async def _principal(self, scope: Scope) -> Principal:
        context: Context = scope["app"].state.context
        header = Headers(scope=scope).get("authorization")
        if header is None:
            if context.settings.anonymous:
                return ANONYMOUS
            raise MissingKey()
        kind, _, secret = header.partition(" ")
        if kind.lower() != "bearer" or not secret.strip():
            raise InvalidKey("The Authorization header is not `Bearer KEY`.")
        key = await run_in_threadpool(_verify, context, secret.strip())
        if key is None:
            raise InvalidKey()
        allowed = key.requests_per_minute or context.settings.requests_per_minute
        if seconds := context.limiter.wait(key.id, allowed):
            raise RateLimited(
                f"This API key allows {allowed} requests a minute; try again in {seconds} s.",
                retry_after=seconds,
            )
        return Principal(key.scope, key)


def _needing(scope: str) -> Callable[[Request], Principal]:
    def principal(request: Request) -> Principal:
        found: Principal = request.state.principal
        found.need(scope)
        return found

    return principal


Reader = Annotated[Principal, Depends(_needing("read"))]
Writer = Annotated[Principal, Depends(_needing("write"))]
Admin = Annotated[Principal, Depends(_needing("admin"))]
