"""Computations that behave as hostile and broken meshes make a child behave."""

from __future__ import annotations

import ctypes
import json
import os
import signal
import socket
import stat
import sys
import threading
import time
from pathlib import Path

from reebase.errors import DegenerateMesh


def warm():
    return


def double(arguments, source, outputs, progress):
    progress("half", 0.5)
    data = source.read()
    for file in outputs.values():
        file.write(data + data)
    return {"length": len(data), "thread_ok": _thread()}


def _thread():
    done = []
    thread = threading.Thread(target=lambda: done.append(True))
    thread.start()
    thread.join()
    return done == [True]


def probe(arguments, source, outputs, progress):
    return {}


def environment(arguments, source, outputs, progress):
    return {"names": sorted(os.environ), "descriptors": len(list(Path("/proc/self/fd").iterdir()))}


def refuse(arguments, source, outputs, progress):
    raise DegenerateMesh("There is nothing left.", faces=0)


def bug(arguments, source, outputs, progress):
    return {"never": list(arguments)[1]}


def spin(arguments, source, outputs, progress):
    while True:
        pass


def sleep(arguments, source, outputs, progress):
    time.sleep(60)


def allocate(arguments, source, outputs, progress):
    held = []
    while True:
        held.append(bytearray(1 << 26))


def allocate_in_c(arguments, source, outputs, progress):
    """As C++ does when it is refused memory."""
    sys.stderr.write("terminate called after throwing an instance of 'std::bad_alloc'\n")
    sys.stderr.flush()
    os.abort()


def crash(arguments, source, outputs, progress):
    ctypes.string_at(0)


def kill(arguments, source, outputs, progress):
    os.kill(os.getpid(), signal.SIGKILL)


def linger(arguments, source, outputs, progress):
    """Reports by itself, on the pipe that a hostile child would find, and stays."""
    report = {"done": {"process": os.getpid()}, "cpu_seconds": 0.0, "peak_bytes": 1}
    pipe = next(number for number in range(3, 64) if _is_pipe(number))
    os.write(pipe, json.dumps(report).encode() + b"\n")
    time.sleep(60)


def _is_pipe(descriptor):
    try:
        return stat.S_ISFIFO(os.fstat(descriptor).st_mode)
    except OSError:
        return False


def leave(arguments, source, outputs, progress):
    os._exit(arguments["status"])


def flood_messages(arguments, source, outputs, progress):
    while True:
        progress("x" * 1000, 0.5)


def flood_errors(arguments, source, outputs, progress):
    block = b"x" * (1 << 16)
    for _ in range(1000):
        try:
            os.write(2, block)
        except BlockingIOError:
            continue
    return {}


def write_too_much(arguments, source, outputs, progress):
    for _ in range(64):
        outputs["result"].write(bytes(1 << 20))


def open_too_many(arguments, source, outputs, progress):
    held = []
    while True:
        held.append(os.dup(0))


def escape(arguments, source, outputs, progress):
    """What each attempt to leave the sandbox came to."""
    attempts = {
        "socket": socket.socket,
        "fork": os.fork,
        "signal": lambda: os.kill(os.getppid(), 0),
        "program": lambda: os.execv("/bin/true", ["true"]),  # noqa: S606 - it must be refused
    }
    found = {}
    for name, attempt in attempts.items():
        try:
            attempt()
        except OSError as error:
            found[name] = type(error).__name__
        else:
            found[name] = "allowed"
    return found


COMPUTATIONS = {
    work.__name__: work
    for work in (
        double, probe, environment, refuse, bug, spin, sleep, allocate, allocate_in_c, crash, kill, linger, leave,
        flood_messages, flood_errors, write_too_much, open_too_many, escape,
    )
}  # fmt: skip
