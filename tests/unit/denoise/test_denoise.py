"""What holds for every filter: who moves, what it does not depend on, what is refused."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from reebase.denoise import BOUNDARIES, METHODS, add_noise, denoise, mean_angle
from reebase.errors import ParameterError, UnknownName
from reebase.mesh.mesh import Mesh
from tests.shapes import cube, cylinder, grid, icosphere, joined, moebius, moved, permuted, rotation, torus

every_method = pytest.mark.parametrize("method", sorted(METHODS))

FORGETFUL = {"graph_p_laplacian": {"fitting": 0}, "uniform": {"fitting": 0}}
"""Parameters with which a filter no longer refers to where the vertices were at the beginning."""

ITERATIONS = {"anisotropic": 80}
"""Iterations of filters that are slow: gradients on an even sphere deviate little, so all of them are damped."""

LOCAL = sorted({"laplacian", "mean", "angle_median", "weighted_laplacian", "finite_volume", "fast_effective", "taubin"})
"""Filters without a statistic of the whole mesh in them."""


def noisy(mesh: Mesh | None = None) -> Mesh:
    return add_noise(icosphere(3) if mesh is None else mesh, 0.3, "isotropic", seed=7)


@every_method
def test_noise_on_a_sphere_gets_less(method: str) -> None:
    truth = icosphere(4)
    mesh = add_noise(truth, 0.3, seed=1)
    assert mean_angle(truth, denoise(mesh, method, ITERATIONS.get(method, 1))) < 0.75 * mean_angle(truth, mesh)


@every_method
def test_faces_stay_and_the_input_too(method: str) -> None:
    mesh = noisy()
    before = mesh.vertices.copy()
    result = denoise(mesh, method)
    assert np.array_equal(result.faces, mesh.faces)
    assert np.array_equal(mesh.vertices, before)
    assert not np.array_equal(result.vertices, before)


@every_method
def test_iterations_are_steps_one_after_another(method: str) -> None:
    mesh = noisy()
    given = FORGETFUL.get(method, {})
    twice = denoise(denoise(mesh, method, **given), method, **given)
    assert denoise(mesh, method, 2, **given).vertices == pytest.approx(twice.vertices, abs=1e-9)


@every_method
@pytest.mark.parametrize("shape", [torus(), cylinder(), moebius()], ids=["torus", "cylinder", "moebius"])
def test_translation_rotation_and_scale_commute(method: str, shape: Mesh) -> None:
    mesh = noisy(shape)
    expected = denoise(mesh, method, 2).vertices
    turned = denoise(moved(mesh, (3, -2, 5), scale=7.5, seed=2), method, 2).vertices
    assert turned == pytest.approx(7.5 * expected @ rotation(2).T + [3, -2, 5], abs=1e-10)


@every_method
@pytest.mark.parametrize("scale", [1e-100, 1e-12, 1e12, 1e100])
def test_the_unit_does_not_matter(method: str, scale: float) -> None:
    mesh = noisy()
    found = denoise(moved(mesh, scale=scale), method).vertices
    assert found / scale == pytest.approx(denoise(mesh, method).vertices, abs=1e-11)


@every_method
def test_far_from_the_origin_only_the_rounding_of_coordinates_shows(method: str) -> None:
    mesh = noisy()
    found = denoise(moved(mesh, (1e6, 1e6, -1e6)), method).vertices - np.array([1e6, 1e6, -1e6])
    assert found == pytest.approx(denoise(mesh, method).vertices, abs=1e-7)


@every_method
@pytest.mark.parametrize("shape", [torus(), cylinder()], ids=["torus", "cylinder"])
def test_the_order_of_vertices_and_faces_does_not_matter(method: str, shape: Mesh) -> None:
    mesh = noisy(shape)
    shuffled, order = permuted(mesh, seed=5)
    expected = denoise(mesh, method, 2).vertices[order]
    assert denoise(shuffled, method, 2).vertices == pytest.approx(expected, abs=1e-10)


@every_method
@pytest.mark.parametrize("boundary", sorted(BOUNDARIES))
def test_a_plane_stays_in_its_plane(method: str, boundary: str) -> None:
    mesh = moved(grid(6, 5), (1, 2, 3), seed=3)
    normal = rotation(3)[:, 2]
    moves = denoise(mesh, method, 3, boundary=boundary).vertices - mesh.vertices
    assert np.abs(moves @ normal).max() < 1e-12


@every_method
def test_boundary_vertices_move_along_their_curve(method: str) -> None:
    mesh = noisy(cylinder())
    rim = np.flatnonzero(np.abs(cylinder().vertices[:, 2]) == 1)
    along = 17  # vertices of one generatrix; the rims are its two ends
    for v in rim[:10]:
        before, after = mesh.vertices[(v - along) % len(mesh.vertices)], mesh.vertices[(v + along) % len(mesh.vertices)]
        tangent = (after - before) / np.linalg.norm(after - before)
        move = denoise(mesh, method).vertices[v] - mesh.vertices[v]
        assert move == pytest.approx((move @ tangent) * tangent, abs=1e-12)


@every_method
def test_progress_rises_to_one(method: str) -> None:
    told: list[float] = []
    denoise(noisy(torus()), method, 3, progress=told.append)
    assert told == sorted(told) and told[0] >= 0
    assert told[-1] == pytest.approx(1)
    assert len(told) >= (1 if method in {"laplacian", "taubin"} else 3)


@every_method
def test_a_fixed_boundary_stays_and_a_free_one_moves(method: str) -> None:
    mesh = noisy(cylinder())
    rim = np.abs(cylinder().vertices[:, 2]) == 1
    fixed = denoise(mesh, method, 2, boundary="fixed").vertices
    free = denoise(mesh, method, 2, boundary="free").vertices
    assert np.array_equal(fixed[rim], mesh.vertices[rim])
    assert (fixed[~rim] != mesh.vertices[~rim]).any(axis=1).all()
    assert (free[rim] != mesh.vertices[rim]).any(axis=1).all()


@every_method
def test_isolated_vertices_stay_even_without_coordinates(method: str) -> None:
    mesh = noisy()
    vertices = np.concatenate([[[9.0, 9, 9]], mesh.vertices, [[np.nan, 1, np.inf]]])
    result = denoise(Mesh(vertices, mesh.faces + 1), method, 2).vertices
    assert result[0].tolist() == [9, 9, 9]
    assert np.array_equal(result[-1], vertices[-1], equal_nan=True)
    assert result[1:-1] == pytest.approx(denoise(mesh, method, 2).vertices, abs=1e-12)


@pytest.mark.parametrize("method", LOCAL)
def test_components_do_not_see_each_other(method: str) -> None:
    one, other = noisy(icosphere(2)), moved(noisy(torus(nu=12, nv=8)), (9, 0, 0))
    both = denoise(joined(one, other), method).vertices
    assert both[: len(one.vertices)] == pytest.approx(denoise(one, method).vertices, abs=1e-5)


@every_method
@pytest.mark.parametrize(
    "mesh",
    [
        Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]])),
        Mesh(np.ones((2, 3)), np.zeros((0, 3), dtype=int)),
        Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=int)),
    ],
    ids=["one point", "no faces", "nothing"],
)
def test_a_mesh_without_extent_stays(method: str, mesh: Mesh) -> None:
    assert np.array_equal(denoise(mesh, method).vertices, mesh.vertices)


@every_method
def test_odd_faces_give_finite_positions(method: str) -> None:
    random = np.random.default_rng(2)
    faces = random.integers(0, 12, size=(60, 3))  # repeated corners, duplicates, edges with many faces
    result = denoise(Mesh(random.standard_normal((12, 3)), faces), method, 5, boundary="free")
    assert np.isfinite(result.vertices).all()
    line = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.array([[0, 1, 2]]))
    assert np.isfinite(denoise(line, method, 3, boundary="free").vertices).all()


@pytest.mark.parametrize("method", sorted(METHODS.keys() - {"l0"}))  # whose forty factors take a minute here
def test_a_fan_of_many_triangles_takes_no_quadratic_time(method: str) -> None:
    count = 100_000
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    rim = np.stack([np.cos(angle), np.sin(angle), 0.1 * np.sin(5 * angle)], axis=1)
    fan = np.stack([np.zeros(count, dtype=int), 1 + np.arange(count), 1 + (np.arange(count) + 1) % count], axis=1)
    result = denoise(Mesh(np.concatenate([[[0, 0, 1.0]], rim]), fan), method)
    assert abs(result.vertices[0, 2]) < 1


def test_the_default_is_finite_volume_once() -> None:
    mesh = noisy()
    assert np.array_equal(denoise(mesh).vertices, denoise(mesh, "finite_volume", 1).vertices)


def test_an_unknown_method_is_refused_with_the_choices() -> None:
    with pytest.raises(UnknownName, match="guided_normal, kernel, l0, laplacian") as refusal:
        denoise(cube(), "sandpaper")
    assert refusal.value.details["choices"] == sorted(METHODS)


def test_an_unknown_boundary_is_refused() -> None:
    with pytest.raises(UnknownName, match="curve, fixed, free"):
        denoise(cube(), boundary="torn")


@pytest.mark.parametrize("iterations", [0, -1, 1001, 1.5, 2.0, "3", True, None])
def test_wrong_iterations_are_refused(iterations: object) -> None:
    with pytest.raises(ParameterError, match="iterations"):
        denoise(cube(), iterations=iterations)


@pytest.mark.parametrize(
    ("method", "parameters", "message"),
    [
        ("laplacian", {"step": 0}, r"step must be a number in \(0, 1\]"),
        ("laplacian", {"step": 1.1}, "step"),
        ("laplacian", {"step": float("nan")}, "step"),
        ("laplacian", {"step": "half"}, "step"),
        ("laplacian", {"step": True}, "step"),
        ("laplacian", {"steps": 0.5}, "has no parameter 'steps'; its parameters: step"),
        ("finite_volume", {"normal": "major"}, "'minor_eigenvector', 'area_weighted'"),
        ("finite_volume", {"scale": 2}, "scale"),
        ("finite_volume", {"anisotropy": 1}, "True, False"),
        ("finite_volume", {"sigma": 1}, "has no parameter 'sigma'"),
        ("bilateral", {"sigma_s": "guessed"}, "sigma_s must be one of 'deviation'; found 'guessed'"),
        ("bilateral", {"sigma_s": 0}, r"sigma_s must be a number in \(0, 1000\]"),
        ("uniform", {"fitting": -1}, "fitting"),
        ("multiscale_anisotropic", {"scales": 5}, "scales must be one of 1, 2, 3, 4"),
        ("multiscale_anisotropic", {"scales": True}, "scales"),
        ("fast_effective", {"normal_iterations": 2.0}, r"normal_iterations must be a whole number in \[1, 1000\]"),
    ],
)
def test_wrong_parameters_are_refused(method: str, parameters: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        denoise(cube(), method, **parameters)


def test_importing_the_package_does_not_import_numba() -> None:
    program = "import sys, reebase.denoise, reebase.mesh.clean; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0
