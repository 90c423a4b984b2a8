"""The choice that ``auto`` makes: what it rests on, what it says, what it leaves alone."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.denoise import Choice, add_noise, apply_choice, choose, denoise, mean_angle, volume_change
from reebase.denoise.filter import Surface
from reebase.denoise.filters import framed
from reebase.denoise.fitting import noise_levels
from reebase.evaluation.synthetic import synthetic_shape
from reebase.mesh.geometry import mean_edge_length, vertex_normals
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import rings
from tests.shapes import cube, icosphere, joined, moved, permuted, torus, voxels


def stairs() -> Mesh:
    """A solid of right angles: five steps of four cubes' width."""
    height = np.repeat(np.arange(4, 24, 4), 4)
    return voxels(np.arange(20)[None, None, :] < np.repeat(height[:, None], 16, axis=1)[:, :, None])


SHARP = {"box": voxels(np.ones((16, 16, 16))), "stairs": stairs()}
SMOOTH = {"sphere": icosphere(4), "torus": torus(nu=72, nv=36), "teddy": synthetic_shape("teddy-bears", 0).mesh}


def levels(mesh: Mesh) -> tuple[float, float]:
    around = rings(mesh.faces, len(mesh.vertices))
    start, scale = framed(mesh.vertices, around)
    return noise_levels(Surface(start, mesh.faces, around, scale))


@pytest.mark.parametrize("strength", [0.1, 0.2, 0.3])
@pytest.mark.parametrize("shape", [*SHARP, *SMOOTH])
def test_no_fixed_filter_is_much_better(shape: str, strength: float) -> None:
    """Nor does it ever leave half of the angles that there were, without being told kind or noise."""
    truth = (SHARP | SMOOTH)[shape]
    mesh = add_noise(truth, strength, seed=4)
    found = mean_angle(truth, denoise(mesh, "auto"))
    fixed = ("guided_normal", "bilateral_normal", "fast_effective", "finite_volume", "laplacian")
    assert found < 1.15 * min(mean_angle(truth, denoise(mesh, name)) for name in fixed) + 0.2
    assert found < 0.5 * mean_angle(truth, mesh)


@pytest.mark.parametrize("strength", [0.1, 0.25])
@pytest.mark.parametrize("shape", SHARP)
def test_right_angles_are_taken_for_sharp(shape: str, strength: float) -> None:
    assert choose(add_noise(SHARP[shape], strength, seed=2)).surface == "sharp"


def test_what_is_chosen_is_what_runs() -> None:
    mesh = add_noise(torus(), 0.2, seed=3)
    choice = choose(mesh)
    assert isinstance(choice, Choice)
    assert sum(part.share for part in choice.parts) == pytest.approx(1)
    found = [denoise(mesh, part.method, part.iterations, **part.parameters) for part in choice.parts]
    moved = sum(part.share * (one.vertices - mesh.vertices) for part, one in zip(choice.parts, found, strict=True))
    normals = vertex_normals(Mesh(mesh.vertices + moved, mesh.faces))
    across = (moved * normals).sum(axis=1)[:, None] * normals
    by_hand = Mesh(mesh.vertices + 0.75 * moved + 0.25 * across, mesh.faces)
    assert denoise(mesh, "auto").vertices == pytest.approx(by_hand.vertices, abs=1e-12)
    assert np.array_equal(denoise(mesh, "auto").vertices, apply_choice(mesh, choice).vertices)
    assert f"{choice.noise:.3f} of a mean edge" in choice.reason


@pytest.mark.parametrize("truth", [*SHARP.values(), *SMOOTH.values()], ids=[*SHARP, *SMOOTH])
def test_a_clean_mesh_comes_out_as_it_was(truth: Mesh) -> None:
    choice = choose(truth)
    assert (choice.parts, choice.surface) == ((), "clean")
    assert "counts as clean" in choice.reason
    assert np.array_equal(denoise(truth, "auto").vertices, truth.vertices)


def test_what_looks_like_noise_moves_by_less_than_it() -> None:
    mesh = add_noise(torus(), 0.06, seed=3)
    moves = np.linalg.norm(denoise(mesh, "auto").vertices - mesh.vertices, axis=1) / mean_edge_length(mesh)
    assert moves.mean() < levels(mesh)[0]


@pytest.mark.parametrize("strength", [0.1, 0.2, 0.3])
def test_the_noise_is_seen(strength: float) -> None:
    for mesh in (icosphere(4), torus(nu=72, nv=36)):
        robust, square = levels(add_noise(mesh, strength, seed=1))
        assert robust == pytest.approx(strength, rel=0.12)
        assert square == pytest.approx(strength, rel=0.12)


def test_impulses_part_the_levels_and_are_removed() -> None:
    truth = SHARP["box"]
    struck = np.random.default_rng(1).random(len(truth.vertices)) < 0.3
    vertices = np.where(struck[:, None], add_noise(truth, 0.5, seed=1).vertices, truth.vertices)
    mesh = add_noise(Mesh(vertices, truth.faces), 0.05, seed=2)
    robust, square = levels(mesh)
    assert square > 1.2 * robust
    assert mean_angle(truth, denoise(mesh, "auto")) < 0.4 * mean_angle(truth, mesh)


def test_strong_noise_gets_the_longest_guided_filter() -> None:
    choice = choose(add_noise(icosphere(4), 0.6, seed=1))
    assert [(part.method, part.iterations) for part in choice.parts] == [("guided_normal", 16)]
    assert "strong" in choice.reason


def test_a_large_mesh_is_judged_by_patches_whatever_its_order_and_place() -> None:
    mesh = add_noise(icosphere(5), 0.2, seed=6)
    choice = choose(mesh)
    assert len(mesh.vertices) > 6000
    assert "on 10242 vertices" not in choice.reason
    for other in (permuted(mesh, seed=1)[0], moved(mesh, (3, 4, 5), scale=9, seed=2)):
        same = choose(other)
        assert [part.parameters for part in same.parts] == [part.parameters for part in choice.parts]
        assert [part.share for part in same.parts] == pytest.approx([part.share for part in choice.parts])


def test_volume_stays() -> None:
    for truth in (*SHARP.values(), *SMOOTH.values()):
        mesh = add_noise(truth, 0.2, seed=8)
        assert abs(volume_change(mesh, denoise(mesh, "auto"))) < 1


@pytest.mark.parametrize(
    "mesh", [Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=int)), cube(), joined(cube(), cube())],
    ids=["nothing", "cube", "cubes"],
)  # fmt: skip
def test_there_is_a_choice_for_the_smallest(mesh: Mesh) -> None:
    assert choose(mesh).reason
    assert np.isfinite(denoise(mesh, "auto").vertices).all()
