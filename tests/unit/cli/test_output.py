"""Tables for people and for pipes."""

import io

import pytest
from rich.console import Console

from reebase.cli.output import print_table
from reebase.words import counted, program

NAMES = ("file", "code", "why")
ROWS = [("a/folder/with/a_rather_long_name_of_a_mesh.ply", "malformed_file", "So it is. " * 12), ("b.ply", "x", "y")]


def printed(width: int, *, terminal: bool) -> str:
    out = io.StringIO()
    console = Console(file=out, width=width, force_terminal=terminal, color_system=None)
    print_table(console, NAMES, ROWS, [("all", "", "2")])
    return out.getvalue()


def test_on_a_pipe_each_row_is_a_line_without_frame_or_padding() -> None:
    lines = printed(10_000, terminal=False).splitlines()
    assert len(lines) == 4
    assert all(line == line.rstrip() and "│" not in line for line in lines)
    assert len({line.index(cell) for line, cell in zip(lines, ("code", "malformed_file", "x"), strict=False)}) == 1


def test_on_a_terminal_a_name_is_whole_while_there_is_room() -> None:
    said = printed(100, terminal=True)
    assert ROWS[0][0] in said
    assert max(map(len, said.splitlines())) <= 100
    narrow = printed(50, terminal=True)
    assert "…" not in narrow
    assert "_mesh.ply" in narrow or "mesh.ply" in narrow


def test_counted() -> None:
    assert [counted(n, "vertex") for n in (0, 1, 2000)] == ["0 vertices", "1 vertex", "2,000 vertices"]
    assert [counted(n, "face") for n in (1, 2)] == ["1 face", "2 faces"]


def test_the_name_of_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("REEBASE_COMMAND", raising=False)
    assert program() == "reebase"
    monkeypatch.setenv("REEBASE_COMMAND", "./run")
    assert program() == "./run"
