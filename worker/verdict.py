"""How a child ended, and what is said of that to the owner of the mesh."""

from __future__ import annotations

import contextlib
import signal
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from store.errors import StorageFull
from worker.guards import ChildLimits

__all__ = ["ChildError", "End", "judge", "kills_for_memory"]

_MOST_ERRORS_SHOWN = 2000  # characters


class ChildError(Exception):
    """The child did not bring a result.

    code: of the ReebaseError that it met, or ``out_of_memory``, ``timed_out``, ``child_crashed``,
    ``internal_error``. detail: JSON-serialisable, with ``message``. lasting: the same input would fail
    again; False when the cause lay outside, such as a signal from somebody else, so that another attempt
    makes sense.
    """

    def __init__(self, code: str, message: str, lasting: bool, detail: dict[str, Any]) -> None:
        super().__init__(f"{code}: {message}")
        self.code = code
        self.detail: dict[str, Any] = {"message": message, **detail}
        self.lasting = lasting


@dataclass
class End:
    """How a child ended, and what it said."""

    code: int | None = None  # exit status, or minus the signal; None when the zygote was lost with it
    cpu_seconds: float = 0.0
    peak_bytes: int = 0
    out_of_time: bool = False
    said_too_much: bool = False
    done: dict[str, Any] | None = None
    error: str | None = None
    detail: dict[str, Any] = field(default_factory=dict)
    errors: str = ""  # its error stream


def judge(end: End, limits: ChildLimits, *, killed_for_memory: bool) -> dict[str, Any]:
    """The answer of a child that brought one; else raises ChildError with the most telling cause."""
    if end.code == 0 and end.done is not None and not end.said_too_much:
        return end.done
    raise ChildError(*_verdict(end, limits, killed_for_memory=killed_for_memory))


def _verdict(  # noqa: PLR0911 - one line a cause, the most telling first
    end: End, limits: ChildLimits, *, killed_for_memory: bool
) -> tuple[str, str, bool, dict[str, Any]]:
    used = {"cpu_seconds": round(end.cpu_seconds, 3), "peak_bytes": end.peak_bytes}
    memory = f"The computation needs more than the {limits.memory_bytes >> 20} MiB that one mesh may use."
    if end.out_of_time:
        return "timed_out", f"The computation was stopped after {limits.wall_seconds:g} s.", True, used
    if end.code is None:
        return "child_crashed", "The process that computed was lost with its parent.", False, {}
    if end.said_too_much:
        return "child_crashed", "The process that computed reported without end.", True, used
    if end.error == "out_of_memory":
        return "out_of_memory", memory, True, used
    if end.error is not None:
        rest = {name: value for name, value in end.detail.items() if name != "message"}
        lasting = end.error != StorageFull.code
        return end.error, str(end.detail.get("message", end.error)), lasting, rest
    killed = end.code == -signal.SIGKILL
    if end.code == -signal.SIGXCPU or (killed and end.cpu_seconds >= limits.cpu_seconds):
        allowed = f"the {limits.cpu_seconds} s of processor time that one mesh may use"
        return "timed_out", f"The computation used up {allowed}.", True, used
    if killed and killed_for_memory:
        return "out_of_memory", "The system ran out of memory and ended the computation.", True, used
    if killed:
        return "child_crashed", "The process that computed was killed from outside.", False, used
    # A C library that is refused memory throws std::bad_alloc or follows a null pointer.
    if "bad_alloc" in end.errors or end.peak_bytes > 0.9 * limits.memory_bytes:
        return "out_of_memory", memory, True, used
    how = f"by signal {signal.Signals(-end.code).name}" if end.code < 0 else f"with status {end.code}"
    rest = {**used, "errors": end.errors[-_MOST_ERRORS_SHOWN:]}
    return "child_crashed", f"The process that computed ended {how}.", True, rest


def kills_for_memory() -> int:
    """Processes that the kernel has killed for want of memory since it started; 0 where it is silent."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/vmstat").read_text().splitlines():
            if line.startswith("oom_kill "):
                return int(line.split()[1])
    return 0
