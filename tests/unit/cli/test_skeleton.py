"""`reebase skeleton`, and how the command line refuses."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from reebase.mesh.write import write
from reebase.pipeline import PROFILES
from tests.command import Command
from tests.shapes import capsule


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    path = tmp_path / "long [bold]one[.off"
    write(capsule(nu=12, along=16), path, "off")
    return path


def test_a_skeleton_as_table_json_and_picture(command: Command, mesh: Path, tmp_path: Path) -> None:
    picture, target = tmp_path / "out.png", tmp_path / "out.json"
    ran = command("skeleton", mesh, "--picture", picture, "--json", target, "--bands", 16)
    assert ran.code == 0, ran
    assert ran.out.startswith("long [bold]one[.off: ")
    assert ran.err == f"Written: {target}\nWritten: {picture}\n"
    assert "0 cycles" in ran.out
    assert picture.read_bytes().startswith(b"\x89PNG")
    found = json.loads(target.read_text())
    assert len(found["endpoints"]) == len(found["features"]) == 2
    assert found["profile"]["bands"] == 16


def test_the_profile_of_the_thesis_by_name(command: Command, mesh: Path) -> None:
    found = json.loads(command("skeleton", mesh, "--json", "-", "--profile", "thesis", "--bands", 32).out)["profile"]
    assert found == {**PROFILES["thesis"].to_json(), "bands": 32}
    refused = command("skeleton", mesh, "--profile", "ghost")
    assert (refused.code, refused.out) == (2, "") and "thesis" in refused.err


def test_json_on_standard_output_is_alone_there(command: Command, mesh: Path) -> None:
    ran = command("skeleton", mesh, "--json", "-")
    assert json.loads(ran.out)["root"] >= 0


def test_a_result_replaces_a_file_whole_and_keeps_its_mode(command: Command, mesh: Path, tmp_path: Path) -> None:
    target = tmp_path / "out.json"
    target.write_text("before")
    target.chmod(0o640)
    assert command("skeleton", mesh, "--json", target).code == 0
    assert json.loads(target.read_text())
    assert target.stat().st_mode & 0o777 == 0o640


def test_refusals_are_one_line_and_exit_code_2(command: Command, mesh: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.stl"
    broken.write_text("no mesh")
    for arguments, said in (
        (("skeleton", broken), "[malformed_file]"),
        (("skeleton", mesh, "--picture", tmp_path / "a.jpg"), "[unknown_name]"),
        (("skeleton", mesh, "--picture", tmp_path / "no" / "a.png"), "no folder"),
        (("skeleton", mesh, "--field", "magic"), "fiedler"),
        (("ingest", tmp_path / "absent", "--collection", "zoo"), "is not a folder"),
        (("ingest", tmp_path, "--collection", "zoo", "--url", "http://127.0.0.1:9"), "[service_unreachable]"),
        (("query", mesh, "--collection", "zoo", "--url", "localhost:8000"), "[invalid_parameter]"),
    ):
        ran = command(*arguments)
        assert (ran.code, ran.out) == (2, "")
        assert ran.err.count("\n") == 1
        assert said in ran.err


def test_exit_codes_are_in_the_help(command: Command) -> None:
    for name in ("ingest", "evaluate", "query", "skeleton"):
        assert "Exit code 0" in command(name, "--help").out


def test_a_reader_that_goes_away_is_not_told_about_it(mesh: Path) -> None:
    script = "import sys; from reebase.cli import main; sys.argv = ['reebase', *sys.argv[1:]]; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", script, "skeleton", str(mesh), "--json", "-"], stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )  # fmt: skip
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert process.stderr.read() == b""
    process.stderr.close()
    assert process.wait() == 1
