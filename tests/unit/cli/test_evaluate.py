"""`reebase evaluate`: a folder in, a report out, and what happens when something is wrong with either."""

from __future__ import annotations

import json
import os
import signal
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reebase.cli import describing
from reebase.cli.describing import Refusal, descriptions
from reebase.cli.evaluate import _chosen
from reebase.matching import MEASURES
from reebase.mesh.write import write
from reebase.pipeline import Profile, describe
from reebase.ranking import RANKINGS
from tests.command import Command
from tests.shapes import capsule, torus

SCORES = {"nn", "first_tier", "second_tier", "e_measure", "dcg", "map"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three capsules and three tori, in sub-folders by class."""
    for label in ("capsules", "tori"):
        (tmp_path / "set" / label).mkdir(parents=True)
    for number in range(3):
        write(capsule(3 + 0.2 * number, nu=10, along=14, nv=4), tmp_path / f"set/capsules/{number}.off")
        write(torus(1, 0.3 + 0.02 * number, 24, 10), tmp_path / f"set/tori/{number}.ply")
    return tmp_path / "set"


def report_of(command: Command, folder: Path, *options: object, code: int = 0) -> dict[str, Any]:
    ran = command("evaluate", folder, "--bands", 24, "--bootstrap", 10, "--json", "-", *options)
    assert ran.code == code, ran
    report: dict[str, Any] = json.loads(ran.out)
    return report


def test_the_report_holds_what_is_promised(command: Command, folder: Path) -> None:
    report = report_of(command, folder, "--jobs", 1, "--measure", "matching")
    assert set(report["overall"]) == SCORES
    assert set(report["per_class"]) == {"capsules", "tori"}
    assert set(report["per_class"]["tori"]) > SCORES
    assert {"recall", "precision", "eleven_point"} == set(report["precision_recall"])
    assert report["overall"]["nn"] == 1.0
    assert (report["descriptor"], report["measure"], report["shapes"], report["failed"]) == ("srg", "matching", 6, {})
    assert report["profile"]["bands"] == 24
    assert "matrix" not in report


def test_what_ranks_queries_is_evaluated_by_default(command: Command, folder: Path) -> None:
    report = report_of(command, folder, "--jobs", 1)
    assert (report["descriptor"], report["measure"]) == ("fused, re-ranked", None)
    assert report["overall"]["nn"] == 1.0


def test_the_profile_of_the_thesis_ranks_as_the_thesis_does(command: Command, folder: Path) -> None:
    report = report_of(command, folder, "--jobs", 1, "--profile", "thesis")
    assert (report["descriptor"], report["measure"]) == ("srg", "matching")
    assert (report["profile"]["levels"], report["profile"]["bands"]) == ("width", 24)
    named = report_of(command, folder, "--jobs", 1, "--profile", "thesis", "--descriptor", "views")
    assert named["descriptor"] == "views"


def test_the_matrix_is_there_when_asked_for_and_jobs_change_nothing(command: Command, folder: Path) -> None:
    one = report_of(command, folder, "--matrix", "--measure", "matching", "--jobs", 1)
    two = report_of(command, folder, "--matrix", "--measure", "matching", "--jobs", 2)
    assert one == two
    # Further descriptors go through linear algebra whose sums depend on its threads, and are kept in 24 bits.
    fused = [report_of(command, folder, "--matrix", "--jobs", jobs) for jobs in (1, 2)]
    values = [np.array(report["matrix"].pop("values")) for report in fused]
    assert values[0] == pytest.approx(values[1], rel=1e-5)
    assert fused[0] == fused[1]
    ids = [f"{label}/{n}.{kind}" for label, kind in (("capsules", "off"), ("tori", "ply")) for n in range(3)]
    assert one["matrix"]["ids"] == ids
    assert [len(row) for row in one["matrix"]["values"]] == [6] * 6


@pytest.mark.parametrize("measure", sorted(MEASURES))
def test_each_measure_is_known(command: Command, folder: Path, measure: str) -> None:
    assert report_of(command, folder, "--jobs", 1, "--measure", measure)["measure"] == measure


def test_the_table_goes_to_a_pipe_one_row_a_line(command: Command, folder: Path, tmp_path: Path) -> None:
    target, plot = tmp_path / "out.json", tmp_path / "curve.svg"
    ran = command("evaluate", folder, "--bands", 24, "--jobs", 1, "--json", target, "--plot", plot)
    assert ran.code == 0, ran
    assert sum("capsules" in line for line in ran.out.splitlines()) == 1
    assert "\x1b" not in ran.out + ran.err
    assert set(json.loads(target.read_text())["overall"]) == SCORES
    assert plot.read_text().startswith("<?xml")
    assert "describing: 6/6" in ran.err
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_meshes_that_fail_are_told_and_the_others_evaluated(command: Command, folder: Path) -> None:
    (folder / "tori" / "broken[red].stl").write_text("this is no mesh")
    (folder / "tori" / "dead.off").symlink_to("nowhere")
    (folder / "tori" / "empty.obj").touch()
    report = report_of(command, folder, code=1)
    assert {name: failure["code"] for name, failure in report["failed"].items()} == {
        "tori/broken[red].stl": "malformed_file", "tori/dead.off": "unreadable", "tori/empty.obj": "empty_file",
    }  # fmt: skip
    assert report["shapes"] == 6
    ran = command("evaluate", folder, "--bands", 24, "--jobs", 1)
    row = next(line for line in ran.out.splitlines() if "broken[red]" in line)
    assert "malformed_file" in row


def test_files_of_the_table_that_are_absent_are_told_and_files_without_label_take_no_part(
    command: Command, folder: Path
) -> None:
    rows = [f"capsules/{n}.off,long" for n in range(3)] + ["tori/0.ply,round", "tori/1.ply,round", "gone.ply,round"]
    (folder / "labels.csv").write_text("\r\n".join(["file,label", *rows]))
    report = report_of(command, folder, "--jobs", 1, code=1)
    assert report["failed"]["gone.ply"]["code"] == "file_not_found"
    assert (report["shapes"], report["without_label"]) == (5, 1)


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (("--measure", "best"), "matching_mean"),
        (("--descriptor", "dna"), "srg"),
        (("--denoise", "magic"), "finite_volume"),
        (("--field", "colour"), "fiedler"),
        (("--json", "/nowhere/out.json"), "no folder /nowhere"),
        (("--json", "/"), "is a folder"),
        (("--plot", "curve.pdf"), "svg"),
        (("--report", "/nowhere/report"), "no folder /nowhere"),
        (("--report", "/dev/null"), "is a file"),
        (("--descriptor", "srg", "--rerank"), "fused"),
        (("--labels", "/nowhere/labels.csv"), "could not be read"),
    ],
)
def test_what_cannot_work_is_refused_before_any_mesh_is_read(
    command: Command, folder: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], complaint: str
) -> None:
    def early(*_: object) -> None:
        raise AssertionError("a mesh was read")

    monkeypatch.setattr(import_module("reebase.cli.evaluate"), "descriptions", early)
    ran = command("evaluate", folder, *options)
    assert (ran.code, ran.out) == (2, "")
    assert complaint in ran.err
    assert ran.err.startswith("reebase: ")


def test_labels_that_never_occur_twice_are_refused_early(command: Command, tmp_path: Path) -> None:
    write(capsule(), tmp_path / "a.off")
    ran = command("evaluate", tmp_path)
    assert ran.code == 2
    assert "no two meshes have the same label" in ran.err


def deadly(path: Path, profile: Profile) -> Any:
    if path.name == "1.off":
        os.kill(os.getpid(), signal.SIGKILL)
    return describe(path, profile)


def prepare_deadly() -> None:
    describing.describe = deadly  # type: ignore[assignment]


def test_a_mesh_that_kills_its_process_fails_alone(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(describing, "_prepare", prepare_deadly)
    files = sorted(folder.rglob("*.*"))
    found = dict(descriptions(files, Profile(bands=24), ["srg"], 2))
    assert sorted(found) == files
    dead = [path.name for path, outcome in found.items() if isinstance(outcome, Refusal)]
    assert dead == ["1.off"]
    refusal = found[folder / "capsules" / "1.off"]
    assert isinstance(refusal, Refusal)
    assert refusal.code == "worker_died"


@pytest.mark.parametrize(
    ("descriptor", "measure"),
    [("extended", "matching"), ("shape_dna", "l2"), ("hks", "l1"), ("wks", "l1"), ("gps", "l1"), ("d2", "l1")],
)
def test_each_descriptor_is_known(command: Command, folder: Path, descriptor: str, measure: str) -> None:
    report = report_of(command, folder, "--jobs", 1, "--descriptor", descriptor, "--matrix")
    assert (report["descriptor"], report["measure"], report["overall"]["nn"]) == (descriptor, measure, 1.0)
    D = report["matrix"]["values"]
    assert all(D[i][i] == 0.0 and D[i][j] == D[j][i] for i in range(6) for j in range(i))


def test_a_measure_of_another_descriptor_is_refused(command: Command, folder: Path) -> None:
    ran = command("evaluate", folder, "--descriptor", "hks", "--measure", "greedy")
    assert ran.code == 2
    assert "measure of hks" in ran.err
    assert "l1" in ran.err


def test_several_descriptors_are_compared_in_one_report(command: Command, folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "report"
    options = ("--descriptor", "srg", "--descriptor", "fused", "--no-rerank", "--descriptor", "hks", "--report", out)
    record = report_of(command, folder, "--jobs", 1, *options)
    assert list(record["descriptors"]) == ["srg", "fused", "hks"]
    written = json.loads((out / "report.json").read_text())
    for name, one in record["descriptors"].items():
        assert one["overall"] == written["descriptors"][name]["overall"]
        assert written["descriptors"][name]["cost"]["bytes"] > 0
    assert written["descriptors"]["hks"]["cost"]["bytes"] == 4 * 160
    text = (out / "index.html").read_text()
    assert text.count('<image id="t') == 6
    assert (out / "matrix-hks.svg").exists()


def test_a_descriptor_that_is_named_twice_counts_once(command: Command, folder: Path) -> None:
    record = report_of(command, folder, "--jobs", 1, "--descriptor", "srg", "--descriptor", "srg")
    assert record["descriptor"] == "srg"


def test_all_is_every_ranking_of_whole_shapes() -> None:
    chosen = _chosen(["srg", "all"], None, None)
    assert [(one.name, one.rerank) for one in chosen][:3] == [("srg", False), ("fused", True), ("fused", False)]
    assert {one.name for one in chosen} == set(RANKINGS) - {"patches"}
    assert len(chosen) == len(set(chosen))
