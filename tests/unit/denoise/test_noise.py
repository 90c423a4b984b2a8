from __future__ import annotations

import numpy as np
import pytest

from reebase.denoise import NOISES, add_noise
from reebase.errors import ParameterError, UnknownName
from reebase.mesh.geometry import mean_edge_length, vertex_normals
from reebase.mesh.mesh import Mesh
from tests.shapes import grid, icosphere

every_kind = pytest.mark.parametrize("kind", sorted(NOISES))


@every_kind
def test_the_same_seed_gives_the_same_mesh(kind: str) -> None:
    one, again, other = (add_noise(icosphere(2), 0.4, kind, seed) for seed in (3, 3, 4))
    assert np.array_equal(one.vertices, again.vertices)
    assert not np.array_equal(one.vertices, other.vertices)
    assert np.array_equal(one.faces, icosphere(2).faces)


@every_kind
def test_strength_zero_changes_nothing(kind: str) -> None:
    assert np.array_equal(add_noise(icosphere(2), 0.0, kind).vertices, icosphere(2).vertices)


@every_kind
def test_the_root_mean_square_is_as_asked(kind: str) -> None:
    """E|v - u|^2 is sigma^2 |n|^2 = sigma^2, and 3 sigma^2 where the draws are isotropic."""
    mesh = icosphere(5)
    moves = add_noise(mesh, 0.4, kind, seed=1).vertices - mesh.vertices
    expected = 0.4 * mean_edge_length(mesh) * (np.sqrt(3) if kind == "isotropic" else 1)
    assert np.sqrt((moves**2).sum(axis=1).mean()) == pytest.approx(expected, rel=0.03)


def test_normal_noise_is_along_the_normal_and_gaussian() -> None:
    mesh = icosphere(5)
    normals = vertex_normals(mesh)
    moves = add_noise(mesh, 0.4, seed=2).vertices - mesh.vertices
    draws = (moves * normals).sum(axis=1) / (0.4 * mean_edge_length(mesh))
    assert moves == pytest.approx(0.4 * mean_edge_length(mesh) * draws[:, None] * normals, abs=1e-14)
    assert draws.mean() == pytest.approx(0, abs=0.03)
    assert (draws**4).mean() == pytest.approx(3, abs=0.2)


def test_hadamard_noise_scales_each_component_by_a_draw_of_its_own() -> None:
    """On a plane z = 0 only z moves; on a sphere the move is not along the normal."""
    sheet = add_noise(grid(20, 20), 0.4, "hadamard", seed=1)
    assert np.array_equal(sheet.vertices[:, :2], grid(20, 20).vertices[:, :2])
    assert sheet.vertices[:, 2].std() == pytest.approx(0.4 * mean_edge_length(grid(20, 20)), rel=0.1)
    mesh = icosphere(3)
    moves = add_noise(mesh, 0.4, "hadamard", seed=1).vertices - mesh.vertices
    assert np.abs(np.cross(moves, vertex_normals(mesh))).max() > 0.01


@every_kind
def test_isolated_vertices_stay(kind: str) -> None:
    mesh = Mesh(np.concatenate([icosphere(1).vertices, [[np.nan, 1, 2]]]), icosphere(1).faces)
    noisy = add_noise(mesh, 0.4, kind)
    assert np.array_equal(noisy.vertices[-1], mesh.vertices[-1], equal_nan=True)
    assert np.isfinite(noisy.vertices[:-1]).all()


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(UnknownName, match="hadamard, isotropic, normal"):
        add_noise(icosphere(1), kind="pink")


@pytest.mark.parametrize("strength", [-0.1, float("nan"), float("inf")])
def test_a_wrong_strength_is_refused(strength: float) -> None:
    with pytest.raises(ParameterError, match="strength"):
        add_noise(icosphere(1), strength)
