"""The worker processes beside the API: started, watched, started again when they die, stopped with it."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import structlog

__all__ = ["WORKER", "Supervisor", "worker_environment"]

FIRST_BACKOFF = 0.5
LAST_BACKOFF = 15.0
HEALTHY_AFTER = 30.0
GRACE_SECONDS = 20.0

WORKER = [sys.executable, "-m", "worker"]

_CHECKOUT = Path(__file__).resolve().parent.parent

_log = structlog.get_logger("service.supervisor")


def worker_environment() -> dict[str, str]:
    """Our own, and the checkout on the path: the worker must be found from any directory."""
    path = [str(_CHECKOUT), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(path)}


@dataclass
class _Slot:
    """One place for a worker. ``next_start``: monotonic time before which it is not started again."""

    process: subprocess.Popen[bytes] | None = None
    started: float = 0.0
    backoff: float = FIRST_BACKOFF
    next_start: float = 0.0


@dataclass
class Supervisor:
    """Keeps ``count`` processes of ``python -m worker`` alive until ``stop``. log_level: theirs."""

    count: int
    log_level: str = "info"

    def __post_init__(self) -> None:
        self._slots = [_Slot() for _ in range(self.count)]
        self._stop = threading.Event()
        # Nothing is ever written to this pipe: however the API dies, it closes, and the workers stop.
        self._lifeline, self._held = os.pipe()
        self._thread = threading.Thread(target=self._watch, name="supervisor", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """SIGTERM to every worker, which releases what it holds; after a grace period SIGKILL."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()
        running = [
            slot.process for slot in self._slots if slot.process is not None and slot.process.poll() is None
        ]
        for process in running:
            process.terminate()
        end = time.monotonic() + GRACE_SECONDS
        for process in running:
            try:
                process.wait(max(0.0, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                _log.warning("worker_killed", pid=process.pid, after_seconds=GRACE_SECONDS)
                process.kill()
                process.wait()
        os.close(self._held)
        os.close(self._lifeline)

    def _watch(self) -> None:
        while not self._stop.is_set():
            for slot in self._slots:
                self._tend(slot)
            self._stop.wait(0.1)

    def _tend(self, slot: _Slot) -> None:
        now = time.monotonic()
        if slot.process is not None:
            code = slot.process.poll()
            if code is None:
                return
            slot.backoff = (
                FIRST_BACKOFF if now - slot.started > HEALTHY_AFTER else min(slot.backoff * 2, LAST_BACKOFF)
            )
            slot.next_start = now + slot.backoff
            slot.process = None
            _log.warning("worker_died", exit_code=code, restart_in_seconds=slot.backoff)
        if now < slot.next_start:
            return
        try:
            slot.process = subprocess.Popen(  # noqa: S603 - our own worker
                [*WORKER, "--log-level", self.log_level], stdin=self._lifeline,
                env={**worker_environment(), "REEBASE_LIFELINE": "1"},
                # A session of its own: Ctrl-C in the terminal must reach the API alone, which stops all in order.
                start_new_session=True,
            )  # fmt: skip
        except OSError as error:  # no memory, no process, no descriptor: that passes, and nobody else starts one
            slot.backoff = min(slot.backoff * 2, LAST_BACKOFF)
            slot.next_start = now + slot.backoff
            _log.error("worker_not_started", error=str(error), again_in_seconds=slot.backoff)
            return
        slot.started = now
        _log.info("worker_started", pid=slot.process.pid)
