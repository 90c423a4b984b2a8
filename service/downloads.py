"""Files on their way out: names that no browser misreads, types that none executes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from urllib.parse import quote

from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from service.conditional import unless_unchanged

__all__ = ["attachment", "file_response"]


def attachment(filename: str) -> str:
    """A Content-Disposition header (RFC 6266): an ASCII name for old clients, the true one for the others."""
    plain = re.sub(r"[^A-Za-z0-9._ -]", "_", filename).strip(". ") or "shape"
    header = f'attachment; filename="{plain}"'
    return header if plain == filename else f"{header}; filename*=UTF-8''{quote(filename, safe='')}"


def file_response(
    request: Request,
    content: Callable[[], bytes] | Callable[[], Iterator[bytes]],
    *,
    etag: str,
    media_type: str,
    filename: str,
    size: int | None = None,
) -> Response:
    """The bytes as a download, or 304 without making them. ``etag`` names exactly these bytes.

    size: of a stream, in bytes.
    """

    def make() -> Response:
        headers = {
            "Cache-Control": "private, no-cache", "X-Content-Type-Options": "nosniff",
            "Content-Security-Policy": "default-src 'none'; sandbox",
            "Content-Disposition": attachment(filename), "Content-Type": media_type,
        }  # fmt: skip
        made = content()
        if isinstance(made, bytes):
            return Response(made, headers=headers)
        return StreamingResponse(made, headers={**headers, "Content-Length": str(size)})

    return unless_unchanged(request, etag, make)
