"""The zygote as the worker sees it, and the exchange of one job with it."""

from __future__ import annotations

import contextlib
import json
import os
import re
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from worker import channel
from worker.guards import ChildLimits
from worker.verdict import End

__all__ = ["Exchange", "Progress", "SandboxError", "Tick", "Zygote"]

Progress = Callable[[str, float], None]
Tick = Callable[[], None]

_ROOT = Path(__file__).resolve().parent.parent
_WARM_SECONDS = 300.0  # on a machine that has never compiled the kernels
_DEATH_SECONDS = 5.0  # from the order to kill a child to the news that it is gone
_TICK_SECONDS = 0.1
_MOST_REPORT = 1 << 20  # bytes that a child may report
_MOST_ERRORS = 1 << 16  # bytes of its error stream that are kept

_CODE = re.compile(r"[a-z][a-z0-9_]{0,63}")

# The child gets no secret of the service; these are what Python, its libraries and its temporary files need.
_KEPT = (
    "PATH", "HOME", "TMPDIR", "LANG", "LC_ALL", "VIRTUAL_ENV", "LD_LIBRARY_PATH", "GLIBC_TUNABLES", "REEBASE_FAULT",
)  # fmt: skip
_KEPT_PREFIXES = ("PYTHON", "NUMBA_", "DYLD_")
_SINGLE_THREADED = (
    "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS", "NUMEXPR_NUM_THREADS", "NUMBA_NUM_THREADS",
)  # fmt: skip


class SandboxError(Exception):
    """The zygote does not start; the message says why."""


@dataclass
class Zygote:
    """A zygote, the channel to it, whether it is warm, and the child that it says is at work."""

    process: subprocess.Popen[bytes]
    control: socket.socket
    warm: bool = False
    child: int | None = None
    dismissed: bool = False

    @classmethod
    def launch(cls, module: str) -> Zygote:
        """Start one, which is not warm yet."""
        ours, theirs = socket.socketpair()
        with theirs:
            process = subprocess.Popen(  # noqa: S603 - our own interpreter, modules and numbers
                [sys.executable, "-P", "-m", "worker.zygote", str(theirs.fileno()), str(os.getpid()), module],
                pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL, env=_environment(),
            )  # fmt: skip
        return cls(process, ours)

    def await_warm(self, tick: Tick | None) -> None:
        """Wait until it can serve. Raises SandboxError, and what tick raises."""
        if self.warm:
            return
        deadline = time.monotonic() + _WARM_SECONDS
        while not select.select([self.control], [], [], _TICK_SECONDS)[0]:
            if time.monotonic() > deadline:
                raise SandboxError(f"The zygote was not warm within {_WARM_SECONDS:.0f} s.")
            if tick:
                tick()
        try:
            hello, _ = channel.receive(self.control)
        except channel.ClosedError:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self.process.wait(_DEATH_SECONDS)  # for it to finish its traceback
            raise SandboxError("The zygote died while it warmed up; its error stands above.") from None
        if "refused" in hello:
            raise SandboxError(f"The zygote refuses to serve: {hello['refused']}.")
        self.warm = True

    def dismiss(self) -> None:
        """Have a child that has reported killed, without waiting for its end: taking it down takes its time."""
        self.dismissed = True
        channel.send(self.control, {"kill": True})

    def settle(self) -> bool:
        """Wait for the end of a dismissed child; False when the zygote does not bring news of it."""
        try:
            while self.dismissed:
                if not select.select([self.control], [], [], _DEATH_SECONDS)[0]:
                    return False
                news, _ = channel.receive(self.control)
                self.dismissed = "exit" not in news
        except channel.ClosedError:
            return False
        self.child = None
        return True

    def close(self) -> None:
        """End it and its child, also where the kernel does not tie the child's life to it."""
        self.control.close()
        child, self.child = self.child, None
        self.process.kill()
        self.process.wait()
        if child is not None and not sys.platform.startswith("linux"):
            with contextlib.suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)


class Exchange:
    """One job from its start to its child's end. What the child says is bounded and checked."""

    def __init__(
        self, zygote: Zygote, limits: ChildLimits, progress: Progress | None, tick: Tick | None
    ) -> None:
        self._zygote = zygote
        self._deadline = time.monotonic() + limits.wall_seconds
        self._progress = progress
        self._tick = tick
        self._end = End()
        self._ended = False
        self._reported = False
        self._open: list[int] = []
        self._line = b""
        self._received = 0
        self._errors = b""

    def run(self, job: dict[str, Any], descriptors: Sequence[int]) -> End:
        with ExitStack() as stack:
            pipes = [os.pipe(), os.pipe()]
            self._messages, errors = self._open = [reader for reader, _ in pipes]
            for reader, _ in pipes:
                os.set_blocking(reader, False)
                stack.callback(os.close, reader)
            writers = [writer for _, writer in pipes]
            os.set_blocking(writers[1], False)  # a child that floods its error stream must not wait for us
            try:
                try:
                    channel.send(self._zygote.control, job, [*writers, *descriptors])
                finally:
                    for writer in writers:
                        os.close(writer)
                self._follow()
                for reader in (self._messages, errors):
                    self._drain(reader)
                if self._reported and not self._ended:
                    self._zygote.dismiss()
            except channel.ClosedError:
                self._zygote.close()
            except BaseException:
                self._kill()
                raise
        self._end.errors = self._errors.decode(errors="replace")
        return self._end

    def _follow(self) -> None:
        while True:
            self._wait()
            if self._ended or self._reported:
                return
            self._end.out_of_time = time.monotonic() > self._deadline
            self._end.said_too_much = self._received > _MOST_REPORT
            if self._end.out_of_time or self._end.said_too_much:
                self._kill()
                return
            if self._tick:
                self._tick()

    def _wait(self) -> None:
        control = self._zygote.control
        readable, _, _ = select.select([control.fileno(), *self._open], [], [], _TICK_SECONDS)
        for reader in readable:
            if reader == control.fileno():
                news, _ = channel.receive(control)
                if "started" in news:
                    self._zygote.child = int(news["started"])
                else:
                    self._ended = True
                    self._zygote.child = None
                    self._end.code = int(news["exit"])
                    self._end.cpu_seconds = float(news["cpu_seconds"])
                    self._end.peak_bytes = int(news["peak_bytes"])
            else:
                self._drain(reader)

    def _kill(self) -> None:
        """Kill the child; a zygote that does not bring the news of its death in time goes too."""
        self._progress = None
        deadline = time.monotonic() + _DEATH_SECONDS
        try:
            channel.send(self._zygote.control, {"kill": True})
            while not self._ended and time.monotonic() < deadline:
                self._wait()
        except channel.ClosedError:
            self._ended = False
        if not self._ended:
            self._zygote.close()

    def _drain(self, reader: int) -> None:
        while reader in self._open:
            try:
                data = os.read(reader, 1 << 16)
            except BlockingIOError:
                return
            if not data:
                self._open.remove(reader)
            elif reader != self._messages:
                self._errors = (self._errors + data)[-_MOST_ERRORS:]
            else:
                self._received += len(data)
                if self._received > _MOST_REPORT:
                    return
                *lines, self._line = (self._line + data).split(b"\n")
                for line in lines:
                    self._hear(line)

    def _hear(self, line: bytes) -> None:
        try:
            said = json.loads(line)
        except ValueError:
            return
        match said:
            case {"stage": str(stage), "fraction": int() | float() as fraction}:
                if self._progress:
                    self._progress(stage[:64], min(max(float(fraction), 0.0), 1.0))
            case {"done": dict(answer)}:
                self._end.done = answer
                self._report(said)
            case {"error": str(code), "detail": dict(detail)} if _CODE.fullmatch(code):
                self._end.error, self._end.detail = code, detail
                self._report(said)
            case _:
                return

    def _report(self, said: dict[str, Any]) -> None:
        """The child's last words: it has written all that it will."""
        match said:
            case {"cpu_seconds": int() | float() as cpu_seconds, "peak_bytes": int(peak_bytes)}:
                self._reported = True
                self._end.code = 0
                self._end.cpu_seconds, self._end.peak_bytes = float(cpu_seconds), peak_bytes
            case _:
                return



def _environment() -> dict[str, str]:
    kept = {
        name: value
        for name, value in os.environ.items()
        if name in _KEPT or name.startswith(_KEPT_PREFIXES)
    }
    path = [str(_ROOT), *filter(None, [kept.get("PYTHONPATH")])]
    # A process on huge pages has a smaller page table: forking it and its end take half the time.
    kept.setdefault("GLIBC_TUNABLES", "glibc.malloc.hugetlb=1")
    return {**kept, **dict.fromkeys(_SINGLE_THREADED, "1"), "PYTHONPATH": os.pathsep.join(path)}
