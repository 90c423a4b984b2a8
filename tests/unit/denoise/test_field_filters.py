"""The filters that the field uses beside the thesis's: each equals its slow twin and keeps what it should."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from reebase.denoise import add_noise, denoise, mean_angle, volume_change
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


@pytest.mark.parametrize("method", ["bilateral_normal", "fast_effective", "guided_normal"])
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


def test_the_gain_of_taubin_is_that_of_its_formula() -> None:
    """Coordinates are nearly eigenvectors on a sphere: its radius changes by (1 - lambda k)(1 - mu k)."""
    mesh = icosphere(4)
    once = denoise(mesh, "laplacian", step=1.0).vertices
    k = 1 - np.sqrt((once**2).sum() / (mesh.vertices**2).sum())
    gain = (1 - 0.5 * k) * (1 + k / (1 / 0.5 - 0.1))
    found = denoise(mesh, "taubin").vertices
    assert np.sqrt((found**2).sum() / (mesh.vertices**2).sum()) == pytest.approx(gain, abs=1e-4)
