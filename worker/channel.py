"""Messages between the worker and its zygote: JSON with open file descriptors beside it, on a Unix stream
socket.

A frame is four bytes of length and that many bytes of JSON. Nothing is ever unpickled.
"""

from __future__ import annotations

import json
import socket
from collections.abc import Sequence
from typing import Any

__all__ = ["ClosedError", "receive", "send"]

_MOST_DESCRIPTORS = 16
_MOST_BYTES = 1 << 20


class ClosedError(Exception):
    """The other end of the channel is gone."""


def send(channel: socket.socket, message: dict[str, Any], descriptors: Sequence[int] = ()) -> None:
    """Send one message; the receiver gets duplicates of the descriptors. Raises ClosedError."""
    body = json.dumps(message).encode()
    frame = len(body).to_bytes(4, "big") + body
    try:
        sent = socket.send_fds(channel, [frame], descriptors) if descriptors else 0
        channel.sendall(frame[sent:])
    except (BrokenPipeError, ConnectionResetError) as error:
        raise ClosedError from error


def receive(channel: socket.socket) -> tuple[dict[str, Any], list[int]]:
    """Wait for one message and take over the descriptors that came with it. Raises ClosedError."""
    try:
        # Descriptors travel with the first byte of the frame that they were sent with.
        header, descriptors, _, _ = socket.recv_fds(channel, 4, _MOST_DESCRIPTORS)
        header += _exactly(channel, 4 - len(header)) if header else b""
        if not header:
            raise ClosedError
        length = int.from_bytes(header, "big")
        if length > _MOST_BYTES:
            raise ClosedError
        return json.loads(_exactly(channel, length)), list(descriptors)
    except ConnectionResetError as error:
        raise ClosedError from error


def _exactly(channel: socket.socket, count: int) -> bytes:
    parts = []
    while count:
        part = channel.recv(count)
        if not part:
            raise ClosedError
        parts.append(part)
        count -= len(part)
    return b"".join(parts)
