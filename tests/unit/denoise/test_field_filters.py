"""The filters that the field uses beside the thesis's: each equals its slow twin and keeps what it should."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from reebase.denoise import add_noise, denoise, fairing, mean_angle, volume_change
from reebase.mesh.geometry import mean_edge_length
from reebase.mesh.mesh import Mesh
from tests.oracles import denoise as oracle
from tests.shapes import capsule, cylinder, icosphere, moebius, torus, voxels

Twin = Callable[[Mesh], np.ndarray]

SHAPES = {"torus": torus(nu=12, nv=7), "cylinder": cylinder(nu=8, along=4), "moebius": moebius(14, 3)}

FEW = {"normal_iterations": 2, "vertex_iterations": 3}
VARIANTS: list[tuple[str, dict[str, object], Twin]] = [
    ("bilateral_normal", FEW, lambda mesh: oracle.bilateral_normal(mesh, **FEW)),
    (
        "bilateral_normal", FEW | {"sigma_s": 0.3, "reach": 2},
        lambda mesh: oracle.bilateral_normal(mesh, 0.3, 2.0, **FEW),
    ),
    ("fast_effective", {}, oracle.fast_effective),
    ("fast_effective", FEW | {"threshold": 0.5}, lambda mesh: oracle.fast_effective(mesh, 0.5, **FEW)),
    ("guided_normal", FEW, lambda mesh: oracle.guided_normal(mesh, **FEW)),
    ("guided_normal", FEW | {"sigma_s": 0.2, "reach": 2}, lambda mesh: oracle.guided_normal(mesh, 0.2, 2.0, **FEW)),
    ("bilateral_normal_global", {}, oracle.bilateral_normal_global),
    (
        "bilateral_normal_global", {"sigma_s": 0.3, "reach": 2, "fidelity": 0.5, "vertex_iterations": 3},
        lambda mesh: oracle.bilateral_normal_global(mesh, 0.3, 2.0, 0.5, 3),
    ),
    ("l0", {}, oracle.l0),
    ("l0", {"flatness": 0.02}, lambda mesh: oracle.l0(mesh, 0.02)),
    ("fairing", {"keep_volume": False}, oracle.fairing),
    ("fairing", {"keep_volume": False, "time": 20, "largest": 2}, lambda mesh: oracle.fairing(mesh, 20.0, 2.0)),
    ("taubin", {}, oracle.taubin),
    ("taubin", {"step": 0.3, "pass_band": 0.2}, lambda mesh: oracle.taubin(mesh, 0.3, 0.2)),
]  # fmt: skip


@pytest.mark.parametrize(
    ("method", "parameters", "twin"), VARIANTS, ids=[f"{name}-{'-'.join(given)}" for name, given, _ in VARIANTS]
)
@pytest.mark.parametrize("mesh", SHAPES.values(), ids=SHAPES)
def test_the_filter_equals_its_slow_twin(mesh: Mesh, method: str, parameters: dict[str, object], twin: Twin) -> None:
    noisy = add_noise(mesh, 0.2, "isotropic", seed=11)
    found = denoise(noisy, method, boundary="free", **parameters).vertices
    assert found == pytest.approx(twin(noisy), abs=1e-10)
    assert np.abs(found - noisy.vertices).max() > 1e-3


@pytest.mark.parametrize(
    "method", ["bilateral_normal", "bilateral_normal_global", "fast_effective", "guided_normal", "l0"]
)
def test_a_box_keeps_its_edges(method: str) -> None:
    """Faces on either side of a right angle do not blur: nearer to the truth than a Laplacian, and no smaller."""
    truth = voxels(np.ones((12, 12, 12)))
    noisy = add_noise(truth, 0.2, seed=3)
    found, plain = denoise(noisy, method), denoise(noisy, "laplacian", 3)
    assert mean_angle(truth, found) < 0.65 * mean_angle(truth, plain)
    assert abs(volume_change(truth, found)) < 0.5 * abs(volume_change(truth, plain))


def test_taubin_keeps_the_volume_that_a_laplacian_loses() -> None:
    mesh = capsule()
    lost = volume_change(mesh, denoise(mesh, "laplacian", 20))
    assert lost < -5
    assert abs(volume_change(mesh, denoise(mesh, "taubin", 20))) < -0.2 * lost


@pytest.mark.parametrize("mesh", SHAPES.values(), ids=SHAPES)
def test_taubin_along_normals_is_its_loop(mesh: Mesh) -> None:
    noisy = add_noise(mesh, 0.2, "isotropic", seed=11)
    neighbours = [sorted({int(w) for f in mesh.faces if v in f for w in f} - {v}) for v in range(len(mesh.vertices))]

    def pull(positions: np.ndarray, share: float) -> np.ndarray:
        return np.array([share * (positions[near].mean(axis=0) - positions[v]) for v, near in enumerate(neighbours)])

    smooth = noisy.vertices
    for _ in range(2):
        smooth = smooth + pull(smooth, 0.5)
    normals = np.zeros_like(smooth)
    for i, j, k in mesh.faces:
        across = np.cross(smooth[j] - smooth[i], smooth[k] - smooth[i])
        normals[[i, j, k]] += across / np.linalg.norm(across)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    expected = noisy.vertices
    for _ in range(2):
        for share in (0.5, 1 / (0.1 - 1 / 0.5)):
            moves = pull(expected, share)
            expected = expected + np.array([(d @ n) * n for d, n in zip(moves, normals, strict=True)])
    found = denoise(noisy, "taubin", 2, boundary="free", along="normals").vertices
    assert found == pytest.approx(expected, abs=1e-10)


def test_the_gain_of_taubin_is_that_of_its_formula() -> None:
    """Coordinates are nearly eigenvectors on a sphere: its radius changes by (1 - lambda k)(1 - mu k)."""
    mesh = icosphere(4)
    once = denoise(mesh, "laplacian", step=1.0).vertices
    k = 1 - np.sqrt((once**2).sum() / (mesh.vertices**2).sum())
    gain = (1 - 0.5 * k) * (1 + k / (1 / 0.5 - 0.1))
    found = denoise(mesh, "taubin").vertices
    assert np.sqrt((found**2).sum() / (mesh.vertices**2).sum()) == pytest.approx(gain, abs=1e-4)


def test_fairing_keeps_the_volume_of_closed_meshes() -> None:
    mesh = add_noise(torus(), 0.2, seed=1)
    assert volume_change(mesh, denoise(mesh, "fairing", 3, time=5)) == pytest.approx(0, abs=1e-9)
    assert volume_change(mesh, denoise(mesh, "fairing", 3, time=5, keep_volume=False)) < -3


def test_a_sphere_shrinks_by_its_mean_curvature() -> None:
    """The flow dr/dt = -2/r by an implicit step from r = 1: coordinates have the eigenvalue 2, so r = 1 / (1 + 2 t)."""
    mesh = icosphere(5)
    time = 10 * mean_edge_length(mesh) ** 2
    found = denoise(mesh, "fairing", time=10, keep_volume=False).vertices
    assert np.linalg.norm(found, axis=1) == pytest.approx(1 / (1 + 2 * time), rel=2e-3)


def test_what_gradients_do_not_solve_factors_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fairing, "MOST_ROUNDS", 2)
    mesh = add_noise(SHAPES["torus"], 0.2, seed=1)
    found = denoise(mesh, "fairing", keep_volume=False, time=50).vertices
    assert found == pytest.approx(oracle.fairing(mesh, 50.0), abs=1e-10)
