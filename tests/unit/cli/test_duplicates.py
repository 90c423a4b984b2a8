"""`reebase duplicates`: a folder in, findings out, and nothing in the folder touched."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from reebase.mesh import Mesh
from reebase.mesh.write import write
from tests.command import Command
from tests.shapes import capsule, moved, torus


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A capsule, itself byte for byte, as an STL in metres, and a torus."""
    place = tmp_path / "models"
    (place / "old").mkdir(parents=True)
    mesh = capsule(3, nu=12, nv=4, along=12)
    write(mesh, place / "capsule.ply")
    write(mesh, place / "old" / "capsule.ply")
    write(Mesh(mesh.vertices / 1000, mesh.faces), place / "metres.stl")
    write(moved(torus(nu=20, nv=10), (1, 2, 3)), place / "ring.off")
    return place


def test_findings_name_what_was_done_and_files_stay(command: Command, folder: Path) -> None:
    before = {path: path.read_bytes() for path in folder.rglob("*.*")}
    ran = command("duplicates", folder, "--json", "-")
    assert ran.code == 0, ran
    record = json.loads(ran.out)
    assert record["shapes"] == 4
    found = {frozenset((one["first"], one["second"])): one for one in record["findings"]}
    assert set(found) == {
        frozenset(("capsule.ply", "old/capsule.ply")), frozenset(("capsule.ply", "metres.stl")),
        frozenset(("old/capsule.ply", "metres.stl")),
    }  # fmt: skip
    assert found[frozenset(("capsule.ply", "old/capsule.ply"))]["classes"] == ["same_bytes"]
    scaled = found[frozenset(("capsule.ply", "metres.stl"))]
    assert scaled["classes"] == ["same_mesh", "rescaled"]
    assert scaled["units"] == "millimetres and metres"
    assert {path: path.read_bytes() for path in folder.rglob("*.*")} == before


def test_a_table_on_a_pipe_has_one_finding_a_line_and_broken_files_are_told(command: Command, folder: Path) -> None:
    (folder / "broken.stl").write_text("no mesh")
    ran = command("duplicates", folder)
    assert ran.code == 1
    assert sum("byte for byte" in line for line in ran.out.splitlines()) == 1
    assert any("broken.stl" in line and "malformed_file" in line for line in ran.out.splitlines())


def test_a_folder_without_any_says_so(command: Command, folder: Path) -> None:
    for name in ("old/capsule.ply", "metres.stl"):
        (folder / name).unlink()
    ran = command("duplicates", folder)
    assert (ran.code, ran.out.strip()) == (0, "No duplicates among 2 shapes.")
    (folder / "capsule.ply").write_text("no mesh")
    (folder / "ring.off").unlink()
    ran = command("duplicates", folder)
    assert ran.code == 2
    assert "No mesh could be read" in ran.err
