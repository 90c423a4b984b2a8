"""What the commands say and write: results on standard output, all else on standard error."""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
import unicodedata
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from rich.cells import cell_len, set_cell_size
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Column, Table

from reebase.errors import ParameterError

__all__ = [
    "STDOUT", "Step", "Steps", "check_picture", "check_target", "notices", "print_table", "progress", "results",
    "shown", "write_bytes", "write_json",
]  # fmt: skip

STDOUT = Path("-")
"""The target that stands for standard output."""

_UNBOUNDED = 10_000
_LONG_WORD = 16
_LINE_EVERY_SECONDS = 5.0


def results() -> Console:
    """For results. Names of files are never taken for markup, and a pipe gets each row on one line."""
    return _console(sys.stdout.isatty(), stderr=False)


def notices() -> Console:
    """For progress, warnings and errors."""
    return _console(sys.stderr.isatty(), stderr=True)


def _console(terminal: bool, *, stderr: bool) -> Console:
    width = None if terminal else _UNBOUNDED
    return Console(stderr=stderr, width=width, markup=False, emoji=False, highlight=False)


def shown(name: str) -> str:
    """A file name as text that can be printed and sent: what is no character becomes U+FFFD."""
    return "".join("\ufffd" if unicodedata.category(char) in {"Cc", "Cs", "Zl", "Zp"} else char for char in name)


def print_table(
    out: Console, names: Sequence[str], rows: Sequence[Sequence[str]], totals: Sequence[Sequence[str]] = (),
    widest: int = 0,
) -> None:  # fmt: skip
    """Rows, and below them totals. Elsewhere than on a terminal each row is one line without a frame.

    widest: the column that names things; on a terminal it has what room the longest words of the others leave.
    """
    columns = list(zip(*([names, *rows, *totals]), strict=True))
    if not out.is_terminal:
        widths = [max(map(cell_len, column)) for column in columns]
        for row in (names, *rows, *totals):
            line = "  ".join(map(set_cell_size, row, widths)).rstrip()
            out.print(line, soft_wrap=True)
        return
    words = [max(cell_len(word) for cell in column for word in [*cell.split(), ""]) for column in columns]
    room = out.width - 4 - sum(min(word, _LONG_WORD) + 3 for at, word in enumerate(words) if at != widest)
    table = Table(*(Column(name, overflow="fold") for name in names))
    table.columns[widest].width = min(max(map(cell_len, columns[widest])), max(room, _LONG_WORD))
    for row in rows:
        table.add_row(*row)
    table.add_section()
    for row in totals:
        table.add_row(*row)
    out.print(table)


class Step(Protocol):
    """A piece of work whose progress is shown."""

    def update(self, done: int) -> None: ...


class _Bar:
    def __init__(self, bars: Progress, name: str, total: int) -> None:
        self._bars = bars
        self._task = bars.add_task(name, total=total)

    def update(self, done: int) -> None:
        self._bars.update(self._task, completed=done)


class _Lines:
    """Where nobody watches a bar: a line now and then, and one at the end."""

    def __init__(self, name: str, total: int) -> None:
        self._name = name
        self._total = total
        self._said = time.monotonic()
        self._ended = False

    def update(self, done: int) -> None:
        now = time.monotonic()
        last = done >= self._total
        if self._ended or not (last or now - self._said >= _LINE_EVERY_SECONDS):
            return
        self._said, self._ended = now, last
        print(f"{self._name}: {done}/{self._total}", file=sys.stderr, flush=True)  # noqa: T201 - for a log


class Steps(Protocol):
    """Makes a step."""

    def __call__(self, name: str, total: int) -> Step: ...


@contextmanager
def progress() -> Iterator[Steps]:
    """Bars on a terminal, a few plain lines elsewhere; ``begin(name, total)`` makes a step."""
    if not sys.stderr.isatty():
        yield _Lines
        return
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=notices()) as bars:
        yield lambda name, total: _Bar(bars, name, total)


def check_target(target: Path | None) -> None:
    """Whether a file can be written there, asked before minutes of work. Raises ParameterError."""
    if target is None or target == STDOUT:
        return
    if target.is_dir():
        raise ParameterError(f"{target} is a folder; name a file in it.")
    if not target.parent.is_dir():
        raise ParameterError(f"{target} cannot be written: there is no folder {target.parent}.")
    try:
        if target.exists():
            with target.open("ab"):
                pass
        else:
            with tempfile.TemporaryFile(dir=target.parent):
                pass
    except OSError as failure:
        raise ParameterError(f"{target} cannot be written: {failure.strerror}.") from failure


def check_picture(target: Path | None, default: str = "png") -> str:
    """The format of a picture, by its suffix, once it is sure that it can be drawn and written.

    Raises ParameterError, UnknownName, MissingPackage.
    """
    kind = default if target is None else target.suffix[1:].lower() or default
    if target is not None:
        from reebase.errors import unknown_name
        from reebase.pictures.canvas import FORMATS, blank

        check_target(target)
        if kind not in FORMATS:
            raise unknown_name("picture format", kind, FORMATS)
        blank(1, 1)
    return kind


def write_bytes(target: Path, data: bytes, *, tell: bool = True) -> None:
    """Write a file whole or not at all, and say so; ``-`` is standard output. Raises OSError."""
    if target == STDOUT:
        sys.stdout.buffer.write(data)
        sys.stdout.flush()
    elif target.exists() and not target.is_file():
        target.write_bytes(data)  # a device or a pipe
    else:
        _replace(target.resolve(), data)
    if tell and target != STDOUT:
        notices().print(f"Written: {shown(str(target))}", soft_wrap=True)


def _replace(target: Path, data: bytes) -> None:
    descriptor, name = tempfile.mkstemp(prefix=f".{target.name[:100]}.", dir=target.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(data)
        umask = os.umask(0)
        os.umask(umask)
        Path(name).chmod(target.stat().st_mode & 0o777 if target.exists() else 0o666 & ~umask)
        Path(name).replace(target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def write_json(target: Path, value: Any) -> None:
    """Write a JSON value and a line's end; ``-`` is standard output. Raises OSError."""
    write_bytes(target, (json.dumps(value, ensure_ascii=False, allow_nan=False) + "\n").encode())
