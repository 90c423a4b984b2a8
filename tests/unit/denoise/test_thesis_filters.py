"""Each filter of the thesis equals its slow twin, and does what its equation says on shapes known in closed form."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from reebase.denoise import add_noise, denoise
from reebase.denoise.filter import Surface
from reebase.denoise.fitting import noise_level
from reebase.mesh.geometry import mean_edge_length
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import rings
from tests.oracles import denoise as oracle
from tests.shapes import capsule, cylinder, grid, icosphere, moebius, moved, tetrahedron, torus

Twin = Callable[[Mesh], np.ndarray]

SHAPES = {
    "torus": torus(nu=14, nv=9), "capsule": capsule(nu=9, nv=3, along=5), "cylinder": cylinder(nu=9, along=5),
    "moebius": moebius(16, 3),
}  # fmt: skip
every_shape = pytest.mark.parametrize("mesh", SHAPES.values(), ids=SHAPES)

VARIANTS: list[tuple[str, dict[str, object], Twin]] = [
    ("mean", {}, lambda mesh: oracle.normals_voting(mesh, "mean")),
    ("angle_median", {}, lambda mesh: oracle.normals_voting(mesh, "angle_median")),
    ("weighted_laplacian", {}, oracle.weighted_laplacian),
    ("weighted_laplacian", {"step": 0.4, "largest": 1.5}, lambda mesh: oracle.weighted_laplacian(mesh, 0.4, 1.5)),
    ("bilateral", {}, oracle.bilateral),
    ("bilateral", {"reach": 0.7, "sigma_s": 0.2}, lambda mesh: oracle.bilateral(mesh, 0.7, 0.2)),
    ("bilateral", {"normal": "area"}, lambda mesh: oracle.bilateral(mesh, by_area=True)),
    ("anisotropic", {}, oracle.anisotropic),
    ("anisotropic", {"step": 0.4, "c": 0.5}, lambda mesh: oracle.anisotropic(mesh, 0.4, 0.5)),
    ("anisotropic", {"literal": True}, lambda mesh: oracle.anisotropic(mesh, literal=True)),
    ("anisotropic", {"literal": True, "c": 2}, lambda mesh: oracle.anisotropic(mesh, c=2, literal=True)),
    ("kernel", {}, oracle.kernel),
    ("kernel", {"kappa": 0.1}, lambda mesh: oracle.kernel(mesh, 0.1)),
    ("multiscale_anisotropic", {}, oracle.multiscale_anisotropic),
    (
        "multiscale_anisotropic", {"step": 0.5, "scales": 3, "c": 0.1},
        lambda mesh: oracle.multiscale_anisotropic(mesh, 0.5, 3, 0.1),
    ),
    *(
        ("graph_p_laplacian", given, lambda mesh, given=given: oracle.graph_diffusion(mesh, mesh.vertices, **given))
        for given in (
            {"fitting": 0.0}, {"fitting": 0.0, "p": 2.0, "literal": True}, {"fitting": 0.0, "p": 0.5, "step": 0.3},
            {"fitting": 0.0, "weights": "nonlocal"},
        )
    ),
    ("uniform", {"fitting": 0}, lambda mesh: oracle.graph_diffusion(mesh, mesh.vertices, weights="uniform", p=2.0)),
]  # fmt: skip


@pytest.mark.parametrize(
    ("method", "parameters", "twin"), VARIANTS, ids=[f"{name}-{'-'.join(given)}" for name, given, _ in VARIANTS]
)
@every_shape
def test_the_filter_equals_its_slow_twin(mesh: Mesh, method: str, parameters: dict[str, object], twin: Twin) -> None:
    noisy = add_noise(mesh, 0.25, "isotropic", seed=11)
    found = denoise(noisy, method, boundary="free", **parameters).vertices
    assert found == pytest.approx(twin(noisy), abs=1e-10)
    assert np.abs(found - noisy.vertices).max() > 1e-3


@pytest.mark.parametrize("fitting", [0.7, "morozov"])
@pytest.mark.parametrize("method", ["graph_p_laplacian", "uniform"])
def test_three_iterations_with_a_fitting_term_equal_the_slow_twin(method: str, fitting: float | str) -> None:
    mesh = add_noise(torus(nu=14, nv=9), 0.3, seed=2)
    sigma = oracle.noise_level(mesh)
    positions = mesh.vertices
    given = {"weights": "uniform", "p": 2.0} if method == "uniform" else {}
    # For p = 1 the diffusion has the dimension of 1 / length, so lambda has too: it is per mean edge length.
    strength = None if fitting == "morozov" else fitting / (oracle.mean_edge(mesh) if method != "uniform" else 1)
    for _ in range(3):
        positions = oracle.graph_diffusion(
            Mesh(positions, mesh.faces), mesh.vertices, sigma=sigma, fitting=strength, **given
        )
    assert denoise(mesh, method, 3, fitting=fitting).vertices == pytest.approx(positions, abs=1e-10)


def test_kernel_diffusion_with_a_fitting_term_equals_its_slow_twin() -> None:
    mesh = add_noise(torus(nu=14, nv=9), 0.3, seed=2)
    once = oracle.kernel(mesh, start=mesh.vertices, fitting=0.5)
    twice = oracle.kernel(Mesh(once, mesh.faces), start=mesh.vertices, fitting=0.5)
    # The ridge is in squared mean edge lengths of the positions that an iteration begins with.
    assert denoise(mesh, "kernel", 2, fitting=0.5).vertices == pytest.approx(twice, abs=1e-10)


@pytest.mark.parametrize("method", ["graph_p_laplacian", "uniform", "kernel"])
def test_morozov_keeps_the_residual_at_the_noise(method: str) -> None:
    mesh = add_noise(icosphere(4), 0.3, seed=3)
    sigma = noise_level(surface(mesh))
    for iterations in (5, 40):
        residual = denoise(mesh, method, iterations, fitting="morozov").vertices - mesh.vertices
        assert np.sqrt((residual**2).sum(axis=1).mean()) == pytest.approx(sigma, rel=1e-6)


def surface(mesh: Mesh) -> Surface:
    return Surface(mesh.vertices, mesh.faces, rings(mesh.faces, len(mesh.vertices)))


@pytest.mark.parametrize("strength", [0.05, 0.2, 0.4])
@pytest.mark.parametrize("mesh", [icosphere(5), torus(nu=96, nv=48), grid(60, 60)], ids=["sphere", "torus", "grid"])
def test_the_noise_level_is_found(mesh: Mesh, strength: float) -> None:
    """Within a tenth, up to noise that turns the normals themselves."""
    noisy = add_noise(mesh, strength, seed=5)
    level = noise_level(surface(noisy)) / mean_edge_length(mesh)
    assert level == pytest.approx(strength, rel=0.1 if strength < 0.3 else 0.25)


def test_the_noise_level_equals_its_slow_twin() -> None:
    for mesh in SHAPES.values():
        noisy = add_noise(mesh, 0.2, seed=1)
        assert noise_level(surface(noisy)) == pytest.approx(oracle.noise_level(noisy), rel=1e-12)


def test_where_normals_agree_the_mean_and_the_median_stay() -> None:
    """Every triangle of a plane has the plane's normal, in which vertices do not stand out."""
    for method in ("mean", "angle_median", "bilateral", "multiscale_anisotropic"):
        assert denoise(grid(6, 5), method, 3, boundary="free").vertices == pytest.approx(grid(6, 5).vertices, abs=1e-15)


def test_cotangent_weights_reproduce_a_plane_with_any_triangles() -> None:
    """A function that is linear in the plane is harmonic: interior vertices stay, where no weight is clamped."""
    sheet = grid(8, 8)
    inner = ((sheet.vertices[:, :2] > 0) & (sheet.vertices[:, :2] < 1)).all(axis=1)
    shift = np.random.default_rng(1).uniform(-0.02, 0.02, size=(len(sheet.vertices), 2)) * inner[:, None]
    bent = Mesh(sheet.vertices + np.pad(shift, ((0, 0), (0, 1))), sheet.faces)
    found = denoise(moved(bent, seed=4), "weighted_laplacian", boundary="fixed").vertices
    assert found == pytest.approx(moved(bent, seed=4).vertices, abs=0.01)


def test_a_tetrahedron_under_uniform_diffusion_shrinks_to_a_known_share() -> None:
    """Full steps with lambda = 0 are the Laplacian's: v -> -v / 3 about the centre; nine tenths: -v / 5."""
    found = denoise(tetrahedron(), "uniform", fitting=0.0).vertices
    assert found == pytest.approx(-tetrahedron().vertices / 5, abs=1e-15)
