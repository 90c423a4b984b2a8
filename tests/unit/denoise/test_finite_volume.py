from __future__ import annotations

import math

import numpy as np
import pytest

from reebase.denoise import add_noise, denoise
from reebase.denoise.eigenvector_kernels import minor_eigenvectors
from reebase.denoise.finite_volume_kernels import median
from reebase.mesh.mesh import Mesh
from tests.oracles import denoise as oracle
from tests.shapes import capsule, cylinder, grid, icosphere, moebius, torus, uv_sphere

SHAPES = {
    "sphere": icosphere(2), "torus": torus(nu=20, nv=12), "capsule": capsule(nu=12, nv=4, along=10),
    "uv_sphere": uv_sphere(16, 10), "cylinder": cylinder(nu=12, along=8), "moebius": moebius(20, 3),
    "grid": grid(6, 5),
}  # fmt: skip


def twin(mesh: Mesh, **parameters: object) -> np.ndarray:
    return oracle.finite_volume(mesh, floor=1e-6 * oracle.mean_edge(mesh), **parameters)


@pytest.mark.parametrize("kind", ["normal", "isotropic"])
@pytest.mark.parametrize("mesh", SHAPES.values(), ids=SHAPES)
def test_the_kernel_equals_its_slow_twin(mesh: Mesh, kind: str) -> None:
    noisy = add_noise(mesh, 0.3, kind, seed=11)
    assert denoise(noisy, boundary="free").vertices == pytest.approx(twin(noisy), abs=1e-10)


@pytest.mark.parametrize("mesh", SHAPES.values(), ids=SHAPES)
def test_the_kernel_equals_its_slow_twin_without_noise(mesh: Mesh) -> None:
    """Symmetric rings, where eigenvalues coincide and offsets are all equal."""
    assert denoise(mesh, boundary="free").vertices == pytest.approx(twin(mesh), abs=1e-8)


@pytest.mark.parametrize(
    "parameters", [{"normal": "area_weighted"}, {"scale": "root_mean_square"}, {"anisotropy": False}]
)
def test_each_variant_equals_its_slow_twin(parameters: dict[str, object]) -> None:
    noisy = add_noise(torus(nu=20, nv=12), 0.3, seed=4)
    found = denoise(noisy, **parameters).vertices
    assert found == pytest.approx(twin(noisy, **parameters), abs=1e-10)
    assert np.abs(found - denoise(noisy).vertices).max() > 1e-4


def pyramid(height: float) -> Mesh:
    """Six triangles round an apex over a regular hexagon of radius 1."""
    angle = np.pi / 3 * np.arange(6)
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(6)], axis=1)
    faces = [[0, 1 + k, 1 + (k + 1) % 6] for k in range(6)]
    return Mesh(np.concatenate([[[0.0, 0, height]], rim]), np.array(faces))


@pytest.mark.parametrize("height", [-0.5, 0.01, 0.3, 2.0])
def test_an_apex_over_a_hexagon_in_closed_form(height: float) -> None:
    """mu = 0, C = diag(3, 3, 0), so n = e_z and FA = sqrt(1/2); every r is two thirds of the height."""
    found = denoise(pyramid(height), boundary="fixed").vertices
    assert found[0] == pytest.approx([0, 0, height - math.sqrt(0.5) * 2 / 3 * height], abs=1e-15)
    assert np.array_equal(found[1:], pyramid(height).vertices[1:])


def test_weights_that_underflow_do_not_divide_zero_by_zero() -> None:
    """Offsets that agree to 1e-9 give exponents of 1e9: all weights but the nearest vanish."""
    mesh = add_noise(grid(20, 20), 1e-9, seed=0)
    moved = denoise(mesh, iterations=3).vertices
    assert np.isfinite(moved).all()
    assert np.abs(moved[:, 2]).max() <= np.abs(mesh.vertices[:, 2]).max()


def test_the_median_is_numpys() -> None:
    random = np.random.default_rng(0)
    for count in range(1, 60):
        values = random.integers(-9, 9, size=count + 3).astype(float)
        assert median(values.copy(), count) == np.median(values[:count])


def minor_of(deviator: np.ndarray, towards: np.ndarray) -> np.ndarray:
    """The minor eigenvector of one deviator, the second of three columns."""
    entries, normals = np.zeros((6, 3)), np.ones((3, 3))
    entries[:, 1], normals[:, 1] = deviator[np.triu_indices(3)], towards
    minor_eigenvectors(entries, np.array([0.0, np.linalg.norm(deviator) / 6**0.5, 0.0]), normals)
    assert (normals[:, ::2] == 1).all()
    return normals[:, 1]


@pytest.mark.parametrize("seed", range(4))
def test_minor_eigenvectors_are_numpys(seed: int) -> None:
    random = np.random.default_rng(seed)
    for spread in (1.0, 1e-2, 1e-4):
        q = np.linalg.qr(random.standard_normal((3, 3)))[0]
        gap = spread * random.uniform(0.1, 1.0)
        matrix = q @ np.diag([0.3, 0.3 + gap, 2.0]) @ q.T
        deviator = matrix - np.trace(matrix) / 3 * np.eye(3)
        towards = random.standard_normal(3)
        found = minor_of(deviator, towards)
        expected = np.linalg.eigh(matrix)[1][:, 0]
        expected *= np.sign(expected @ towards)
        assert found == pytest.approx(expected, abs=1e-13 / gap)


@pytest.mark.parametrize("diagonal", [(0, 0, 0), (1, 1, 1), (1, 1, 2)])
def test_where_no_direction_is_minor_the_given_one_is_taken(diagonal: tuple[float, float, float]) -> None:
    deviator = np.diag(diagonal) - sum(diagonal) / 3 * np.eye(3)
    assert minor_of(deviator, np.array([0.0, 0.6, 0.8])).tolist() == [0.0, 0.6, 0.8]
