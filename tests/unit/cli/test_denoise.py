"""`reebase denoise`: noise on, noise off, errors, a picture, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reebase.denoise import METHODS, add_noise, denoise
from reebase.mesh.read import read
from reebase.mesh.write import write
from tests.command import Command
from tests.shapes import cylinder, torus


@pytest.fixture
def truth(tmp_path: Path) -> Path:
    path = tmp_path / "truth.ply"
    write(torus(), path)
    return path


def test_noise_goes_on_by_seed_and_comes_off_again(command: Command, truth: Path, tmp_path: Path) -> None:
    noisy, smooth = tmp_path / "noisy.ply", tmp_path / "smooth.ply"
    ran = command("denoise", truth, noisy, "--method", "none", "--noise", 0.4, "--seed", 1)
    assert ran.code == 0, ran
    expected = add_noise(torus(), 0.4, seed=1)
    assert np.array_equal(read(noisy).vertices, expected.vertices)
    ran = command("denoise", noisy, smooth, "--method", "guided_normal", "--set", "sigma_s=0.4", "--iterations", 2)
    assert ran.code == 0, ran
    assert np.array_equal(read(smooth).vertices, denoise(expected, "guided_normal", 2, sigma_s=0.4).vertices)


@pytest.mark.parametrize(("method", "said"), [("auto", ["choosing", "denoising"]), ("l0", ["denoising"])])
def test_progress_is_told(command: Command, truth: Path, tmp_path: Path, method: str, said: list[str]) -> None:
    noisy = tmp_path / "noisy.ply"
    write(add_noise(torus(), 0.2, seed=1), noisy)
    ran = command("denoise", noisy, tmp_path / "out.ply", "--method", method)
    assert ran.code == 0, ran
    assert [line for line in ran.err.splitlines() if "100/100" in line] == [f"{one}: 100/100" for one in said]


def test_a_truth_gives_the_errors_before_and_after(command: Command, truth: Path, tmp_path: Path) -> None:
    noisy = tmp_path / "noisy.off"
    write(add_noise(torus(), 0.2, seed=3), noisy)
    ran = command("denoise", noisy, tmp_path / "out.off", "--method", "taubin", "--truth", truth)
    lines = ran.out.splitlines()
    assert [line.split(":")[0] for line in lines] == ["out.off", "before", "after"]
    angles = [float(line.split("angle ")[1].split()[0]) for line in lines[1:]]
    assert angles[1] < angles[0]
    for word in ("face normals", "squared mean edges", "displacement", "% of the diagonal", "volume"):
        assert word in lines[2]


def test_noise_makes_the_mesh_itself_the_truth(command: Command, tmp_path: Path) -> None:
    path = tmp_path / "open.obj"
    write(cylinder(), path)
    ran = command("denoise", path, tmp_path / "out.obj", "--noise", 0.1, "--kind", "isotropic")
    assert ran.code == 0, ran
    assert "\nbefore: angle" in ran.out
    assert "volume not enclosed" in ran.out


def test_auto_says_what_it_picks_in_words_that_repeat_it(command: Command, truth: Path, tmp_path: Path) -> None:
    """Each part by hand, and their mean; strong noise has one part."""
    first, second = tmp_path / "first.ply", tmp_path / "second.ply"
    noisy = add_noise(torus(), 0.2, seed=5)
    write(noisy, truth)
    *said, reason = command("denoise", truth, first).out.splitlines()[:-1]
    assert "of a mean edge" in reason
    moved = np.zeros_like(noisy.vertices)
    for line in said:
        share, _, options = line.removeprefix("auto: ").strip().partition(" of ")
        assert command("denoise", truth, second, *options.split()).code == 0
        moved += float(share.rstrip("%")) / 100 * (read(second).vertices - noisy.vertices)
    ways = read(first).vertices - noisy.vertices
    assert np.linalg.norm(ways - moved, axis=1).mean() < 0.3 * np.linalg.norm(ways, axis=1).mean()


def test_auto_leaves_a_clean_mesh(command: Command, truth: Path, tmp_path: Path) -> None:
    ran = command("denoise", truth, tmp_path / "out.ply")
    assert ran.out.startswith("auto: --method none\n")
    assert np.array_equal(read(tmp_path / "out.ply").vertices, torus().vertices)


def test_a_picture(command: Command, truth: Path, tmp_path: Path) -> None:
    picture = tmp_path / "both.png"
    ran = command("denoise", truth, tmp_path / "out.ply", "--noise", 0.3, "--picture", picture)
    assert ran.code == 0, ran
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_help_lists_the_methods(command: Command) -> None:
    said = command("denoise", "--help").out
    for name in METHODS:
        assert f"{name}:" in said


def test_refusals_write_nothing(command: Command, truth: Path, tmp_path: Path) -> None:
    target = tmp_path / "out.ply"
    other = tmp_path / "other.ply"
    write(cylinder(), other)
    for arguments, said in (
        ((truth, target, "--method", "sandpaper"), "[unknown_name]"),
        ((truth, target, "--method", "taubin", "--set", "steps=1"), "pass_band"),
        ((truth, target, "--method", "taubin", "--set", "step"), "NAME=VALUE"),
        ((truth, target, "--method", "taubin", "--set", "step=much"), "step must be a number"),
        ((truth, target, "--method", "none", "--set", "step=1"), "no parameters"),
        ((truth, target, "--boundary", "torn"), "[unknown_name]"),
        ((truth, target, "--truth", other), "same faces"),
        ((truth, target, "--kind", "pink", "--noise", "0.1"), "[unknown_name]"),
        ((truth, tmp_path / "out"), "suffix"),
        ((truth, tmp_path / "out.docx"), "[unknown_name]"),
        ((truth, tmp_path / "no" / "out.ply"), "no folder"),
    ):
        ran = command("denoise", *arguments)
        assert ran.code == 2, ran
        assert said in ran.err, ran
    assert not target.exists()


def test_a_format_that_is_not_written_is_refused_before_any_work(command: Command, tmp_path: Path) -> None:
    source = tmp_path / "in.ply"
    source.write_bytes(b"not even a mesh")
    ran = command("denoise", source, tmp_path / "out.xyz")
    assert ran.code == 2
    assert "'xyz'" in ran.err and "off, ply" in ran.err
