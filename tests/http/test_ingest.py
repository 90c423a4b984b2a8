"""`reebase ingest` and `reebase query` against the real service, on good days and bad ones."""

from __future__ import annotations

import itertools
import json
import os
import re
import shutil
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from reebase.cli.ingest import _print
from reebase.client import Client, Upload
from reebase.mesh.write import write
from tests.command import Command, Ran
from tests.http.serving import Served, whole_service
from tests.shapes import capsule

_numbers = itertools.count()


@pytest.fixture
def command(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Command:
    return Command(capfd, monkeypatch)


@pytest.fixture
def name() -> str:
    """Of a collection that is not there yet."""
    return f"ingest-{next(_numbers)}"


def filled(folder: Path, count: int = 6) -> Path:
    """Small meshes in two sub-folders."""
    for number in range(count):
        path = folder / ("even" if number % 2 == 0 else "odd") / f"{number:02d}.ply"
        path.parent.mkdir(parents=True, exist_ok=True)
        write(capsule(2 + 0.1 * number, nu=6, along=6, nv=3), path)
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return filled(tmp_path / "meshes")


@pytest.fixture
def ingest(command: Command, service: Served, folder: Path, name: str) -> Callable[..., Ran]:
    def run(*options: object) -> Ran:
        return command("ingest", folder, "--collection", name, "--url", service.url, *options)

    return run


@pytest.fixture
def client(service: Served) -> Iterator[Client]:
    with Client(service.url) as opened:
        yield opened


def after(uploads: int, act: Callable[[], None], patch: pytest.MonkeyPatch) -> None:
    """Do something once so many uploads are done."""
    upload, counter, lock = Client.upload, itertools.count(1), threading.Lock()

    def counted(self: Client, *given: Any, **named: Any) -> Upload:
        done = upload(self, *given, **named)
        with lock:
            if next(counter) == uploads:
                act()
        return done

    patch.setattr(Client, "upload", counted)


def test_everything_is_indexed_and_a_second_run_skips_it(
    ingest: Callable[..., Ran], client: Client, name: str
) -> None:
    first = ingest()
    assert first.code == 0, first
    assert "6 files, 6 shapes: 6 uploaded, 0 there already; 6 indexed, 0 failed." in first.out
    assert "uploading: 6/6" in first.err
    assert "\x1b" not in first.out + first.err
    shapes = list(client.shapes(name))
    assert {shape.name: shape.label for shape in shapes} == {
        f"{label}/{n:02d}.ply": label for n in range(6) for label in [("even", "odd")[n % 2]]
    }
    assert {shape.state for shape in shapes} == {"indexed"}
    second = ingest()
    assert second.code == 0
    assert "0 uploaded, 6 there already; 6 indexed" in second.out
    assert list(client.shapes(name)) == shapes


def test_a_folder_with_broken_files(
    ingest: Callable[..., Ran], folder: Path, monkeypatch: pytest.MonkeyPatch, client: Client, name: str
) -> None:
    (folder / "empty.obj").touch()
    (folder / "text.stl").write_text("not a mesh at all, but long enough to be one perhaps")
    (folder / "flat.off").write_text("OFF\n3 1 0\n0 0 0\n0 0 0\n0 0 0\n3 0 1 2\n")
    (folder / "dead link.ply").symlink_to("nowhere")
    (folder / "odd [bold]\nname.off").write_text("OFF\n")
    shutil.copy(folder / "even/00.ply", folder / "copy.ply")
    ran = ingest()
    assert ran.code == 1, ran
    lines = ran.out.splitlines()
    head = next(at for at, line in enumerate(lines) if " code " in line)
    rows = [re.split(r" {2,}", line) for line in lines[head + 1 :]]
    found = {row[0]: row[1] for row in rows}
    assert found == {
        "dead link.ply": "unreadable", "empty.obj": "empty_file", "flat.off": "degenerate_mesh",
        "odd [bold]\ufffdname.off": "truncated_file", "text.stl": found["text.stl"],
    }  # fmt: skip
    assert found["text.stl"] in ("malformed_file", "unknown_format")
    assert all(row[2] for row in rows)
    assert "even/00.ply has the same bytes as copy.ply: one shape" in ran.out
    assert client.collection(name).counts.states["indexed"] == 6
    # What failed is told again, and tried again when asked for.
    before = {shape.name: shape.updated_at for shape in client.shapes(name, state="failed")}
    again = ingest()
    assert again.code == 1
    # None of these causes passes, so nothing advises to try again.
    assert "--retry-failed" not in again.out
    assert "5 failed" in again.out
    assert {shape.name: shape.updated_at for shape in client.shapes(name, state="failed")} == before
    assert ingest("--retry-failed").code == 1
    retried = {shape.name: shape.updated_at for shape in client.shapes(name, state="failed")}
    assert retried.keys() == before.keys()
    assert all(retried[one] > before[one] for one in before)


def test_the_summary_as_json(ingest: Callable[..., Ran], folder: Path, name: str) -> None:
    shutil.copy(folder / "even/00.ply", folder / "odd/copy.ply")
    (folder / "none.obj").touch()
    ran = ingest("--json", "-")
    assert ran.code == 1
    summary = json.loads(ran.out)
    assert summary["collection"] == name
    numbers = {key: summary[key] for key in ("files", "shapes", "uploaded", "skipped", "indexed")}
    assert numbers == {"files": 8, "shapes": 7, "uploaded": 6, "skipped": 0, "indexed": 6}
    assert [(one["file"], one["code"]) for one in summary["failed"]] == [("none.obj", "empty_file")]
    assert summary["copies"] == [{"file": "odd/copy.ply", "same_as": "even/00.ply"}]
    assert summary["label_conflicts"] == [{"file": "even/00.ply", "labels": ["even", "odd"]}]


def test_labels_of_a_table_reach_shapes_that_are_there(
    ingest: Callable[..., Ran], folder: Path, client: Client, name: str
) -> None:
    assert ingest("--no-wait").code == 0
    rows = ["\ufefffile,label", "even/00.ply, zero ", "odd/01.ply,one", "gone.ply,two"]
    (folder / "labels.csv").write_text("\r\n".join(rows), encoding="utf-8")
    ran = ingest()
    assert ran.code == 1
    assert "6 uploaded" not in ran.out
    assert "6 there already (2 relabelled); 6 indexed, 0 failed." in ran.out
    assert "4 files have no label" in ran.out
    assert "1 label names no file: gone.ply" in ran.out
    assert "file_not_found" not in ran.out
    again = json.loads(ingest("--json", "-").out)
    assert (again["relabelled"], again["without_label"]) == (0, 4)
    assert (again["labels_without_file"], again["failed"]) == (["gone.ply"], [])
    labels = {shape.name: shape.label for shape in client.shapes(name)}
    assert (labels["even/00.ply"], labels["odd/01.ply"], labels["even/02.ply"]) == ("zero", "one", "even")


def test_what_may_have_passed_is_advised_once(capsys: pytest.CaptureFixture[str]) -> None:
    codes = ("timed_out", "malformed_file", "timed_out", "worker_died")
    summary = {
        "files": 4, "shapes": 4, "uploaded": 0, "skipped": 4, "relabelled": 0, "without_label": 1, "indexed": 0,
        "waited": True, "copies": [], "label_conflicts": [], "labels_without_file": [],
        "failed": [{"file": f"{n}.ply", "code": code, "detail": "Why."} for n, code in enumerate(codes)],
    }  # fmt: skip
    _print(summary, retried=False)
    out = capsys.readouterr().out
    assert out.endswith("timed_out and worker_died may have passed: --retry-failed tries again.\n")
    assert out.count("--retry-failed") == 1
    assert "1 file has no label" in out
    _print(summary, retried=True)
    assert "--retry-failed" not in capsys.readouterr().out


def test_a_file_that_vanishes_or_changes_meanwhile_fails_alone(
    ingest: Callable[..., Ran], folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def meddle() -> None:
        (folder / "odd/05.ply").unlink()
        write(capsule(9, nu=6, along=6, nv=3), folder / "odd/03.ply")

    after(1, meddle, monkeypatch)
    ran = ingest("--parallel", 1, "--json", "-")
    assert ran.code == 1
    codes = {one["file"]: one["code"] for one in json.loads(ran.out)["failed"]}
    assert codes == {"odd/05.ply": "unreadable", "odd/03.ply": "request_broken"}


def test_a_collection_that_is_deleted_meanwhile_ends_it(
    ingest: Callable[..., Ran], client: Client, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    after(2, lambda: client.delete_collection(name), monkeypatch)
    ran = ingest("--parallel", 1)
    assert (ran.code, ran.out) == (2, "")
    assert "The service refuses to go on: at least 2 of 6" in ran.err
    assert "[collection_not_found]" in ran.err


def test_a_shape_that_is_deleted_meanwhile_is_told(
    ingest: Callable[..., Ran], client: Client, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    after(6, lambda: client.delete_shape(name, next(client.shapes(name)).id), monkeypatch)
    ran = ingest("--parallel", 1, "--json", "-")
    assert ran.code == 1
    assert [one["code"] for one in json.loads(ran.out)["failed"]] == ["deleted"]


def test_ctrl_c_ends_it_at_once_and_a_second_run_goes_on(
    ingest: Callable[..., Ran], monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patch:
        after(2, lambda: os.kill(os.getpid(), signal.SIGINT), patch)
        ran = ingest("--parallel", 1)
    assert (ran.code, ran.out) == (130, "")
    assert "Stopped: at least " in ran.err
    assert "Run the same command again to go on." in ran.err
    assert "Traceback" not in ran.err
    ran = ingest("--json", "-")
    assert ran.code == 0
    summary = json.loads(ran.out)
    assert summary["skipped"] >= 2
    assert summary["indexed"] == 6


def test_a_service_that_is_killed_is_told_and_a_second_run_goes_on(
    command: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    meshes, home = filled(tmp_path / "meshes", 12), tmp_path / "home"
    arguments = ("ingest", meshes, "--collection", "zoo", "--patience", 1)
    with whole_service(home, REEBASE_LEASE_SECONDS="2") as served, monkeypatch.context() as patch:
        process = served.process
        assert process is not None

        def kill() -> None:
            process.kill()
            process.wait()

        after(5, kill, patch)
        ran = command(*arguments, "--url", served.url)
        assert (ran.code, ran.out) == (2, "")
        assert "The service was lost" in ran.err
        assert "[service_unreachable]" in ran.err
    with whole_service(home, REEBASE_LEASE_SECONDS="2") as served:
        ran = command(*arguments, "--url", served.url, "--json", "-")
        assert ran.code == 0, ran
        summary = json.loads(ran.out)
        assert summary["skipped"] >= 5
        assert (summary["uploaded"] + summary["skipped"], summary["indexed"]) == (12, 12)


def test_a_file_over_the_limit_is_not_sent(
    command: Command, alone: Served, folder: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (folder / "large.ply").open("wb") as file:
        file.truncate(300_000)
    ran = command("ingest", folder, "--collection", name, "--url", alone.url, "--no-wait", "--json", "-")
    assert ran.code == 1
    summary = json.loads(ran.out)
    assert [(one["file"], one["code"]) for one in summary["failed"]] == [("large.ply", "too_many_bytes")]
    assert (summary["uploaded"], summary["waited"]) == (6, False)


def test_a_collection_name_that_is_none_is_refused_with_the_reason(
    command: Command, service: Served, folder: Path
) -> None:
    ran = command("ingest", folder, "--collection", "No Good", "--url", service.url)
    assert (ran.code, ran.out) == (2, "")
    assert "name" in ran.err


def test_query_by_a_mesh(
    command: Command, ingest: Callable[..., Ran], service: Served, folder: Path, name: str
) -> None:
    ingest()
    asked = ("query", folder / "odd/03.ply", "--collection", name, "--url", service.url)
    ran = command(*asked, "-k", 3)
    assert ran.code == 0, ran
    best = next(line for line in ran.out.splitlines() if line.startswith("1 "))
    assert "odd/03.ply" in best
    assert "0.0000" in best
    answer = json.loads(command(*asked, "--json", "-").out)
    assert answer["hits"][0]["shape"]["name"] == "odd/03.ply"
    assert answer["query"]["descriptor"] == "fused" and answer["query"]["rerank"]
    assert "by fused, re-ranked" in ran.out and "extended 0.000" in best
    by_d = command(*asked, "--descriptor", "srg", "--measure", "greedy").out
    assert "by srg, greedy" in by_d and "matched pairs" in by_d and "D(G, G~)" in by_d
    plain = json.loads(command(*asked, "--no-rerank", "--json", "-").out)
    assert plain["query"]["rerank"] is False and plain["hits"][0]["parts"][0]["matched"]["pairs"]
    assert "rerank" in command(*asked, "--descriptor", "hks", "--rerank").err
    assert "No hits" in command(*asked, "--label", "nobody").out
    answer = json.loads(command(*asked, "--tolerance", "any", "--json", "-").out)
    assert answer["query"]["tolerance"] is None
    assert "neither a whole number nor any" in command(*asked, "--tolerance", "some").err
    ran = command(*asked, "--measure", "best")
    assert ran.code == 2
    assert "[unknown_name]" in ran.err
