"""Files on their way out: names that no browser misreads, types that none executes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from urllib.parse import quote

from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from service.conditional import matches

__all__ = ["attachment", "file_response"]


def attachment(filename: str) -> str:
    """A Content-Disposition header (RFC 6266): an ASCII name for old clients, the true one for the others."""
    plain = re.sub(r"[^A-Za-z0-9._ -]", "_", filename).strip(". ") or "shape"
    header = f'attachment; filename="{plain}"'
    return header if plain == filename else f"{header}; filename*=UTF-8''{quote(filename, safe='')}"


def file_response(
    request: Request,
    content: bytes | Callable[[], Iterator[bytes]],
    *,
    size: int,
    etag: str,
    media_type: str,
    filename: str,
) -> Response:
    """The bytes as a download, or 304. ``etag`` names exactly these bytes; a stream opens when it is sent."""
    tag = f'"{etag}"'
    headers = {
        "ETag": tag, "Cache-Control": "private, no-cache", "X-Content-Type-Options": "nosniff",
        "Content-Security-Policy": "default-src 'none'; sandbox",
    }  # fmt: skip
    if matches(request.headers.get("if-none-match"), tag):
        return Response(status_code=304, headers=headers)
    headers |= {
        "Content-Disposition": attachment(filename), "Content-Length": str(size), "Content-Type": media_type,
    }  # fmt: skip
    if isinstance(content, bytes):
        return Response(content, headers=headers)
    return StreamingResponse(content(), headers=headers)
