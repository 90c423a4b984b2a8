"""Messages and descriptors arrive as they were sent, in order, and an end is an end."""

from __future__ import annotations

import os
import socket

import pytest

from worker import channel


@pytest.fixture
def ends():
    first, second = socket.socketpair()
    with first, second:
        yield first, second


def test_messages_keep_their_order_and_their_descriptors(ends):
    first, second = ends
    reader, writer = os.pipe()
    channel.send(first, {"n": 1})
    channel.send(first, {"n": 2, "text": "Ω" * 10_000}, [writer])
    channel.send(first, {"n": 3})
    os.close(writer)
    assert channel.receive(second) == ({"n": 1}, [])
    message, (received,) = channel.receive(second)
    assert message["text"] == "Ω" * 10_000
    os.write(received, b"through")
    os.close(received)
    assert os.read(reader, 100) == b"through"
    os.close(reader)
    assert channel.receive(second) == ({"n": 3}, [])


def test_an_end_is_an_error_on_both_sides(ends):
    first, second = ends
    first.sendall(b"\0\0\0\x09{")
    first.close()
    with pytest.raises(channel.ClosedError):
        channel.receive(second)
    with pytest.raises(channel.ClosedError):
        for _ in range(2):
            channel.send(second, {})


def test_a_frame_without_bound_is_refused(ends):
    first, second = ends
    first.sendall(b"\xff\xff\xff\xff")
    with pytest.raises(channel.ClosedError):
        channel.receive(second)
