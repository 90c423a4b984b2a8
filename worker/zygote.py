"""A warmed, single-threaded process that forks one guarded child for each job.

It has imported everything and loaded every kernel, so a fork is all that a job costs; and it has no
threads, so a fork is safe. It holds no secret and no connection: its environment is picked by the sandbox
that starts it, and all that it and its children can write to are the descriptors that come with a job.

On the channel: it says ``ready`` once, then for each ``job`` answers ``started`` and, when the child is
gone, ``exit``. ``kill`` kills the child at work. When the channel closes, it kills the child and leaves.
"""

from __future__ import annotations

import errno
import faulthandler
import gc
import importlib
import json
import os
import resource
import select
import signal
import socket
import sys
import threading
import time
import traceback
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import asdict
from typing import Any, NoReturn

from reebase.errors import LimitError, ReebaseError
from store import faults
from store.errors import StorageFull
from worker import channel, guards
from worker.computations import Computation

__all__ = ["main"]

_MOST_DETAIL = 4000  # characters of an unexpected error that are worth keeping


def main(descriptor: int, parent: int, module: str) -> None:
    """Serve jobs from the channel with this descriptor until it closes.

    parent: the process id of the sandbox. module: that of the computations, with COMPUTATIONS and ``warm()``.
    """
    guards.die_with_parent(parent)
    # A Ctrl-C or a service manager signals the whole group; when to stop is the worker's decision.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    with socket.socket(fileno=descriptor) as control:
        began = time.monotonic()
        with suppress(ImportError, RuntimeError, OSError):
            guards.prepare()
        computations = importlib.import_module(module)
        computations.warm()
        threads = max(threading.active_count(), guards.native_threads() or 1)
        if threads > 1:
            channel.send(control, {"refused": f"{threads} threads run; a fork would not be safe"})
            return
        # What lives now lives for ever: children need neither look at it nor copy its pages.
        gc.collect()
        gc.freeze()
        channel.send(control, {"ready": os.getpid(), "warm_seconds": time.monotonic() - began})
        try:
            _serve(control, computations.COMPUTATIONS)
        except channel.ClosedError:
            return


def _serve(control: socket.socket, computations: Mapping[str, Computation]) -> None:
    woken, waker = os.pipe()
    os.set_blocking(woken, False)
    os.set_blocking(waker, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(waker, warn_on_full_buffer=False)
    while True:
        message, descriptors = channel.receive(control)
        if "job" not in message:
            continue  # a kill that crossed the end of its child
        own = os.getpid()
        child = os.fork()
        if child == 0:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            for inherited in (woken, waker):
                os.close(inherited)
            control.close()
            _work(message, descriptors, own, computations)
        for descriptor in descriptors:
            os.close(descriptor)
        try:
            channel.send(control, {"started": child})
            _attend(control, woken, child)
        except channel.ClosedError:
            os.kill(child, signal.SIGKILL)
            raise


def _attend(control: socket.socket, woken: int, child: int) -> None:
    """Wait for the end of the child, killing it when told so, and report how it ended."""
    while True:
        ended, status, usage = os.wait4(child, os.WNOHANG)
        if ended:
            channel.send(control, {"exit": os.waitstatus_to_exitcode(status), **_usage(usage)})
            return
        readable, _, _ = select.select([control.fileno(), woken], [], [])
        if woken in readable:
            os.read(woken, 4096)
        if control.fileno() in readable:
            channel.receive(control)  # while a child works the only message is "kill"
            os.kill(child, signal.SIGKILL)


def _usage(usage: resource.struct_rusage) -> dict[str, float]:
    peak = usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return {"cpu_seconds": usage.ru_utime + usage.ru_stime, "peak_bytes": peak}


def _work(
    message: dict[str, Any], descriptors: list[int], parent: int, computations: Mapping[str, Computation]
) -> NoReturn:
    """The child: guard itself, run the computation, report on the message pipe, leave without any
    clean-up."""
    code = 1
    try:
        messages, errors, source, *results = descriptors
        os.dup2(errors, 1)
        os.dup2(errors, 2)
        faulthandler.enable(file=2)
        limits = guards.ChildLimits(**message["limits"])
        applied = guards.apply(limits, parent)
        pipe = _Messages(messages)
        report = _run(message, source, results, pipe, computations, applied)
        pipe.send({**report, **_usage(resource.getrusage(resource.RUSAGE_SELF))})
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


class _Messages:
    """The writing end of the pipe on which a child reports: one JSON object a line."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor

    def send(self, message: dict[str, Any]) -> None:
        line = json.dumps(message).encode() + b"\n"
        while line:
            line = line[os.write(self._descriptor, line) :]

    def progress(self, stage: str, fraction: float) -> None:
        self.send({"stage": stage, "fraction": round(float(fraction), 4)})
        faults.point(f"child.{stage}")


def _run(  # noqa: PLR0911 - one line a way to end
    message: dict[str, Any],
    source: int,
    results: list[int],
    messages: _Messages,
    computations: Mapping[str, Computation],
    applied: Sequence[guards.Guard],
) -> dict[str, Any]:
    try:
        if message["job"] != "probe":
            faults.point("child.start")
        with ExitStack() as stack:
            data = stack.enter_context(os.fdopen(source, "rb"))
            files = {
                name: stack.enter_context(os.fdopen(descriptor, "wb"))
                for name, descriptor in zip(message["outputs"], results, strict=True)
            }
            answer = computations[message["job"]](message["arguments"], data, files, messages.progress)
        if message["job"] == "probe":
            return {"done": {**answer, "guards": [asdict(guard) for guard in applied]}}
        faults.point("child.end")
        return {"done": answer}
    except ReebaseError as error:
        return {"error": error.code, "detail": {"message": error.message, **error.details}}
    except MemoryError:
        guards.release_reserve()
        return {"error": "out_of_memory", "detail": {}}
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            text = "There was no space left for temporary files; free some, or set TMPDIR, and try again."
            return {"error": StorageFull.code, "detail": {"message": text}}
        if error.errno != errno.EFBIG:
            return _unexpected(error)
        most = message["limits"]["file_bytes"] >> 20
        text = f"A result is larger than the {most} MiB that one file may have."
        return {"error": LimitError.code, "detail": {"message": text}}
    except Exception as error:
        return _unexpected(error)


def _unexpected(error: Exception) -> dict[str, Any]:
    traceback.print_exc()
    text = "".join(traceback.format_exception_only(error)).strip()
    return {"error": "internal_error", "detail": {"message": text[:_MOST_DETAIL]}}


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
