"""ETag on every JSON read, and 304 when the client has it already (RFC 9110 §13)."""

from __future__ import annotations

import hashlib
from collections.abc import Callable

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.responses import Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = ["ConditionalReads", "matches", "unless_unchanged"]


def matches(if_none_match: str | None, etag: str) -> bool:
    """Whether an If-None-Match header holds this entity tag (weak comparison)."""
    if if_none_match is None:
        return False
    tags = [tag.strip().removeprefix("W/") for tag in if_none_match.split(",")]
    return "*" in tags or etag.removeprefix("W/") in tags


def unless_unchanged(request: Request, etag: str, make: Callable[[], Response]) -> Response:
    """304 when the client has what ``etag`` names, which then is not even made; else the response, tagged."""
    tag = f'"{etag}"'
    if matches(request.headers.get("if-none-match"), tag):
        return Response(status_code=304, headers={"ETag": tag})
    response = make()
    response.headers["ETag"] = tag
    return response


class ConditionalReads:
    """Tags answers to GET under ``prefix`` that come in one piece; streams carry the tag of their route."""

    def __init__(self, app: ASGIApp, prefix: str = "/v1/") -> None:
        self.app = app
        self.prefix = prefix

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "GET" or not scope["path"].startswith(self.prefix):
            await self.app(scope, receive, send)
            return
        asked = Headers(scope=scope).get("if-none-match")
        held: Message | None = None
        done = False

        async def sending(message: Message) -> None:
            nonlocal held, done
            if message["type"] == "http.response.start" and message["status"] == 200:
                held = message
                return
            if held is None or done:
                if not done:
                    await send(message)
                return
            start, held = held, None
            headers = MutableHeaders(scope=start)
            if not message.get("more_body", False) and "etag" not in headers:
                digest = hashlib.blake2b(message.get("body", b""), digest_size=16).hexdigest()
                headers["ETag"] = f'"{digest}"'
            if "etag" in headers and matches(asked, headers["etag"]):
                done = True
                for name in ("content-length", "content-type"):
                    del headers[name]
                await send({**start, "status": 304})
                await send({"type": "http.response.body", "body": b"", "more_body": False})
                return
            await send(start)
            await send(message)

        await self.app(scope, receive, sending)
