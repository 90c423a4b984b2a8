"""`reebase` as a user runs it, but inside this process: arguments in, exit code and output out."""

from __future__ import annotations

import sys
from dataclasses import dataclass

import pytest

from reebase.cli import main


@dataclass(frozen=True)
class Ran:
    """What a command left behind. code: its exit code."""

    code: int
    out: str
    err: str


class Command:
    """Call it with arguments; they may be anything that has a text."""

    def __init__(self, capture: pytest.CaptureFixture[str], patch: pytest.MonkeyPatch) -> None:
        self._capture = capture
        self._patch = patch

    def __call__(self, *arguments: object) -> Ran:
        self._patch.setattr(sys, "argv", ["reebase", *map(str, arguments)])
        self._capture.readouterr()
        try:
            main()
            code = 0
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
        said = self._capture.readouterr()
        return Ran(code, said.out, said.err)
