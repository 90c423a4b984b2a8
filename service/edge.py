"""The outermost layer: request ids, headers on every answer, log, metrics, and the last resort.

Pure ASGI, so that a streamed upload or download passes through untouched and without a copy.
"""

from __future__ import annotations

import asyncio
import re
import time
from typing import Any

import structlog
import uuid_utils
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.metrics import Metrics
from service.problems import internal_error

__all__ = ["Edge", "Heads", "Linger"]

_REQUEST_ID = re.compile(r"[A-Za-z0-9._-]{1,64}")

CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)

_ALWAYS = {
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Content-Security-Policy": CONTENT_SECURITY_POLICY,
}

_log = structlog.get_logger("service")


class Edge:
    """Gives each request an id, adds the security headers, measures, logs, and answers what nobody caught."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self.app = app
        self.metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        given = Headers(scope=scope).get("x-request-id", "")
        request_id = given if _REQUEST_ID.fullmatch(given) else str(uuid_utils.uuid7())
        scope.setdefault("state", {})["request_id"] = request_id
        began = time.perf_counter()
        status = 0

        async def sending(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = int(message["status"])
                headers = MutableHeaders(scope=message)
                headers["X-Request-ID"] = request_id
                for name, value in _ALWAYS.items():
                    headers.setdefault(name, value)
                if scope["path"].startswith("/v1"):
                    headers.setdefault("Cache-Control", "private, no-cache")
            await send(message)

        try:
            await self.app(scope, receive, sending)
        except Exception:
            _log.exception("request_failed", request_id=request_id, path=scope["path"])
            if status == 0:
                await internal_error(Request(scope))(scope, receive, sending)
        finally:
            self._record(scope, status, time.perf_counter() - began, request_id)

    def _record(self, scope: Scope, status: int, seconds: float, request_id: str) -> None:
        route = getattr(scope.get("route"), "path", "unknown")
        self.metrics.observe(scope["method"], route, status, seconds)
        if not route.startswith(("/livez", "/readyz", "/metrics")):
            principal: Any = scope.get("state", {}).get("principal")
            _log.info(
                "request", method=scope["method"], path=scope["path"], status=status,
                milliseconds=round(seconds * 1000, 1), request_id=request_id,
                key=getattr(principal, "key_id", None),
            )  # fmt: skip


class Heads:
    """Answers HEAD as GET; the server leaves the body out (RFC 9110 §9.3.2)."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and scope["method"] == "HEAD":
            scope = {**scope, "method": "GET"}
        await self.app(scope, receive, send)


class Linger:
    """Lets a client that is still sending read our refusal.

    When a body is refused before it is read, closing the connection at once makes the kernel reset it, and
    the client loses the answer. So the answer goes out whole, and what the client still sends is read and
    dropped for a moment, within bounds, before the connection is closed.
    """

    def __init__(self, app: ASGIApp, byte_limit: int = 32 * 2**20, seconds: float = 3.0) -> None:
        self.app = app
        self.byte_limit = byte_limit
        self.seconds = seconds

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        unread = "transfer-encoding" in headers or headers.get("content-length", "0") != "0"
        if not unread or "expect" in headers:
            await self.app(scope, receive, send)
            return

        async def receiving() -> Message:
            nonlocal unread
            message = await receive()
            if message["type"] == "http.disconnect" or not message.get("more_body", False):
                unread = False
            return message

        async def sending(message: Message) -> None:
            last = message["type"] == "http.response.body" and not message.get("more_body", False)
            if not (last and unread):
                await send(message)
                return
            await send({**message, "more_body": True})
            await self._drain(receiving, lambda: unread)
            await send({"type": "http.response.body", "body": b"", "more_body": False})

        await self.app(scope, receiving, sending)

    async def _drain(self, receive: Receive, unread: Any) -> None:
        left = self.byte_limit
        try:
            async with asyncio.timeout(self.seconds):
                while unread() and left > 0:
                    left -= len((await receive()).get("body", b""))
        except TimeoutError:
            return
