"""Runs a computation on an untrusted mesh in a guarded child process, and says in which way it failed.

The sandbox owns a zygote (``worker.zygote``). A job's input, its output files and the pipe on which it
reports are descriptors handed to the child, the files without a name: nothing is left behind when any of
the processes is killed.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, BinaryIO

from worker.exchange import Exchange, Progress, SandboxError, Tick, Zygote
from worker.guards import ChildLimits, Guard
from worker.verdict import ChildError, judge, kills_for_memory

__all__ = ["ChildError", "Finished", "Sandbox", "SandboxError"]


@dataclass(frozen=True)
class Finished:
    """A result: the computation's JSON answer, its files, rewound, and what it used."""

    answer: dict[str, Any]
    files: Mapping[str, BinaryIO]
    cpu_seconds: float
    peak_bytes: int


class Sandbox:
    """Runs one computation at a time; not thread-safe.

    limits: of each child. computations: the module of what can be run. The thread that starts it must live
    as long as it is used: the kernel ties the zygote's life to that thread.
    """

    def __init__(self, limits: ChildLimits | None = None, computations: str = "worker.computations") -> None:
        self.limits = limits or ChildLimits()
        self.guards: tuple[Guard, ...] = ()
        self._computations = computations
        self._zygote: Zygote | None = None

    def __enter__(self) -> Sandbox:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def zygote(self) -> int | None:
        """Process id of the zygote, None when there is none."""
        return self._zygote.process.pid if self._zygote else None

    @property
    def child(self) -> int | None:
        """Process id of the child at work, None when there is none."""
        return self._zygote.child if self._zygote else None

    def launch(self) -> Zygote:
        """Start the zygote unless it lives, without waiting until it is warm."""
        if self._zygote is None or self._zygote.process.poll() is not None:
            self.close()
            self._zygote = Zygote.launch(self._computations)
        return self._zygote

    def start(self, tick: Tick | None = None) -> Zygote:
        """Wait for a warm zygote, launching one unless it lives, and learn which guards are on.

        tick: called about ten times a second meanwhile; what it raises ends the wait. Raises SandboxError.
        """
        try:
            zygote = self.launch()
            if not zygote.settle():
                self.close()
                zygote = self.launch()
            zygote.await_warm(tick)
            if not self.guards:
                with self._run(zygote, "probe", {}, tick=tick) as finished:
                    self.guards = tuple(Guard(**guard) for guard in finished.answer["guards"])
        except BaseException:
            self.close()
            raise
        return zygote

    def close(self) -> None:
        """End the zygote and whatever child it has."""
        if self._zygote is not None:
            self._zygote.close()
            self._zygote = None

    @contextlib.contextmanager
    def run(
        self,
        computation: str,
        arguments: dict[str, Any],
        source: BinaryIO | bytes = b"",
        outputs: Sequence[str] = (),
        *,
        progress: Progress | None = None,
        tick: Tick | None = None,
    ) -> Iterator[Finished]:
        """Run a computation by its name in ``worker.computations``; the files live as long as the context.

        source: an open file at its start, or bytes. progress: called with stage and fraction. tick: called
        about ten times a second; what it raises kills the child and goes on to the caller.
        Raises ChildError, SandboxError.
        """
        zygote = self.start(tick)
        with self._run(zygote, computation, arguments, source, outputs, progress, tick) as finished:
            yield finished

    @contextlib.contextmanager
    def _run(
        self,
        zygote: Zygote,
        computation: str,
        arguments: dict[str, Any],
        source: BinaryIO | bytes = b"",
        outputs: Sequence[str] = (),
        progress: Progress | None = None,
        tick: Tick | None = None,
    ) -> Iterator[Finished]:
        with ExitStack() as stack:
            if isinstance(source, bytes):
                held: BinaryIO = stack.enter_context(tempfile.TemporaryFile())
                held.write(source)
                held.seek(0)
                source = held
            files: dict[str, BinaryIO] = {
                name: stack.enter_context(tempfile.TemporaryFile()) for name in outputs
            }
            limits = self.limits.to_json()
            job = {"job": computation, "arguments": arguments, "limits": limits, "outputs": [*files]}
            descriptors = [source.fileno(), *(file.fileno() for file in files.values())]
            kills = kills_for_memory()
            end = Exchange(zygote, self.limits, progress, tick).run(job, descriptors)
            answer = judge(end, self.limits, killed_for_memory=kills_for_memory() > kills)
            for file in files.values():
                file.seek(0)
            yield Finished(answer, files, end.cpu_seconds, end.peak_bytes)
