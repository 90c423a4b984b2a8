"""A request's body as it arrives, from clients that may be slow, but not dead."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

from starlette.requests import Request

from service.errors import UploadStalled

__all__ = ["chunks"]

IDLE_SECONDS = 60.0
"""A client that sends nothing for so long is given up."""


async def chunks(request: Request) -> AsyncIterator[bytes]:
    """The pieces in which the body comes. Raises UploadStalled when the client stops sending."""
    pieces = request.stream().__aiter__()
    while True:
        try:
            async with asyncio.timeout(IDLE_SECONDS):
                piece = await anext(pieces, None)
        except TimeoutError:
            raise UploadStalled() from None
        if piece is None:
            return
        yield piece
