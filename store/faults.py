"""Named points at which a test may break the program from outside; nothing happens unless REEBASE_FAULT is
set.

``REEBASE_FAULT="NAME=ACTION[:ARGUMENT][@MARKER]"``, several separated by commas. With ``@MARKER`` (a path)
a fault strikes once: whoever creates that file first. Actions:

kill             SIGKILL to the process that passes the point
crash            a segmentation fault (SIGSEGV)
freeze:SECONDS   sleep in that thread
hold:PATH        write the process id to PATH, then wait until PATH is removed
spin             burn CPU time for ever
allocate         allocate memory until it is refused
raise            raise RuntimeError

The points: ``upload.blob_stored``, ``upload.row_committed`` (service); ``worker.claimed``,
``worker.child_done``, ``worker.blobs_stored``, ``worker.rows_committed`` (worker); ``child.start``,
``child.STAGE`` for each stage of the pipeline as it begins, ``child.end`` (the child that works on one
mesh).
"""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

__all__ = ["point"]


@dataclass(frozen=True)
class _Fault:
    action: str
    argument: str
    marker: str


def _parse(text: str) -> dict[str, _Fault]:
    faults = {}
    for entry in filter(None, text.split(",")):
        name, _, rest = entry.partition("=")
        rest, _, marker = rest.partition("@")
        action, _, argument = rest.partition(":")
        if action not in _ACTIONS:
            known = ", ".join(_ACTIONS)
            raise ValueError(f"REEBASE_FAULT names the action {action!r}; the choices are {known}.")
        faults[name.strip()] = _Fault(action, argument, marker)
    return faults


def point(name: str) -> None:
    """Pass the point ``name``; strike when a fault is set for it."""
    if not _FAULTS:
        return
    fault = _FAULTS.get(name)
    if fault is None:
        return
    if fault.marker:
        try:
            os.close(os.open(fault.marker, os.O_CREAT | os.O_EXCL, 0o600))
        except FileExistsError:
            return
    _ACTIONS[fault.action](fault.argument)


def _kill(_: str) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def _crash(_: str) -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def _freeze(seconds: str) -> None:
    time.sleep(float(seconds))


def _hold(path: str) -> None:
    # Renamed into place, so that whoever sees the file also sees the number in it.
    temporary = Path(f"{path}.{os.getpid()}")
    temporary.write_text(str(os.getpid()))
    temporary.rename(path)
    while Path(path).exists():
        time.sleep(0.01)


def _spin(_: str) -> None:
    while True:
        pass


def _allocate(_: str) -> None:
    held = []
    while True:
        held.append(bytearray(1 << 28))


def _raise(_: str) -> None:
    raise RuntimeError("REEBASE_FAULT asked for this error.")


_ACTIONS = {
    "kill": _kill, "crash": _crash, "freeze": _freeze, "hold": _hold, "spin": _spin, "allocate": _allocate,
    "raise": _raise,
}  # fmt: skip

_FAULTS = _parse(os.environ.get("REEBASE_FAULT", ""))
