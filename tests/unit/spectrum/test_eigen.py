"""Eigenpairs: closed forms of the sphere, rectangle and tube, a dense solver, and invariances."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from scipy.sparse import csr_matrix

from reebase.errors import ComputationError, ParameterError
from reebase.mesh.mesh import Mesh
from reebase.spectrum import Operator, Spectrum, eigenpairs, operator
from reebase.spectrum.eigen import MULTIGRID
from reebase.spectrum.factor import Factor
from reebase.spectrum.multigrid import first_eigenpairs
from tests.shapes import (
    capsule,
    cube,
    cylinder,
    grid,
    icosphere,
    joined,
    moebius,
    moved,
    permuted,
    tetrahedron,
    torus,
    uv_sphere,
    voxels,
)  # fmt: skip

SPHERE = 4 * np.pi * np.array([l * (l + 1) for l in range(4) for _ in range(2 * l + 1)])  # noqa: E741 - the degree
"""l (l + 1), 2 l + 1 times each, at unit area."""


def rectangle(a, b, k):
    """Neumann eigenvalues of a by b at unit area: pi^2 (i^2 / a^2 + j^2 / b^2) a b."""
    i, j = np.meshgrid(np.arange(20), np.arange(20))
    return np.sort((np.pi**2 * (i**2 / a**2 + j**2 / b**2) * a * b).ravel())[:k]


def order_of_convergence(errors):
    return np.log2(errors[:-1] / errors[1:])


def test_spheres_converge_to_l_l_plus_1_with_order_two():
    found = np.array([eigenpairs(operator(icosphere(s)), 16).eigenvalues for s in (2, 3, 4)])
    np.testing.assert_allclose(found[-1], SPHERE, rtol=1e-2)
    errors = np.abs(found / np.maximum(SPHERE, 1) - (SPHERE > 0))[:, 1:].max(axis=1)
    assert (order_of_convergence(errors) > 1.8).all()


def test_rectangles_converge_to_the_neumann_spectrum_with_order_two():
    found = np.array([eigenpairs(operator(grid(n, n, 2.0, 1.3)), 8).eigenvalues for n in (8, 16, 32)])
    expected = rectangle(2.0, 1.3, 8)
    np.testing.assert_allclose(found[-1], expected, rtol=1e-2)
    errors = np.abs(found - expected).max(axis=1)
    assert (order_of_convergence(errors) > 1.8).all()


def test_phi_2_of_a_rectangle_is_a_cosine():
    mesh = grid(40, 20, 2.0, 1.0)
    spectrum = eigenpairs(operator(mesh))
    expected = np.sqrt(2) * np.cos(np.pi * mesh.vertices[:, 0] / 2)
    expected *= np.sign(expected[0] * spectrum.fiedler[0])
    np.testing.assert_allclose(spectrum.fiedler, expected, atol=5e-3)


def test_a_long_tube_vibrates_like_a_string():
    """A polygonal tube is flat inside, so that the closed form is that of the polygon's girth."""
    mesh = cylinder(20.0, 0.5, nu=12, along=120)
    found = eigenpairs(operator(mesh), 4).eigenvalues
    area = operator(mesh).area
    np.testing.assert_allclose(found, [area * (np.pi * i / 20) ** 2 for i in range(4)], rtol=1e-3)


@pytest.mark.parametrize("mesh", [tetrahedron(), icosphere(1), torus(nu=16, nv=8), moebius()], ids="abcd")
@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_equals_a_dense_solver(mesh, k):
    found = operator(mesh)
    spectrum = eigenpairs(found, k, tolerance=1e-11)
    mass = found.mass / found.area
    expected = scipy.linalg.eigh(found.C.toarray(), np.diag(mass), eigvals_only=True)[:k]
    np.testing.assert_allclose(spectrum.eigenvalues, expected, rtol=1e-9, atol=1e-9)
    phi = spectrum.eigenvectors
    np.testing.assert_allclose(phi.T @ (mass[:, None] * phi), np.eye(k), atol=1e-9)
    np.testing.assert_allclose(found.C @ phi, mass[:, None] * phi * spectrum.eigenvalues, atol=1e-9)
    np.testing.assert_array_equal(phi[:, 0], 1.0)


def test_finds_every_copy_of_a_multiple_eigenvalue():
    found = eigenpairs(operator(icosphere(3)), 9).eigenvalues
    np.testing.assert_allclose(found[1:4], found[1], rtol=1e-9)
    np.testing.assert_allclose(found[4:9], found[4], rtol=1e-9)


def test_all_eigenpairs_of_a_small_mesh():
    for m, mesh in ((3, Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])), (4, tetrahedron())):
        spectrum = eigenpairs(operator(mesh), m)
        assert spectrum.eigenvectors.shape == (m, m)
        assert (np.diff(spectrum.eigenvalues) >= -1e-9).all()
    mesh = icosphere(2)
    assert len(eigenpairs(operator(mesh), 162).eigenvalues) == 162


def test_deterministic_to_the_last_bit():
    first, second = (eigenpairs(operator(torus())) for _ in range(2))
    np.testing.assert_array_equal(first.eigenvectors, second.eigenvectors)
    np.testing.assert_array_equal(first.eigenvalues, second.eigenvalues)


@pytest.mark.parametrize(
    ("mesh", "digits"), [(capsule(nu=7, nv=2, along=4), 7), (capsule(along=8, nv=4), 7), (capsule(), 5)]
)
def test_invariant_to_motion_scale_and_order(mesh, digits):
    assert (len(mesh.vertices) >= MULTIGRID) == (digits == 5)
    expected = eigenpairs(operator(mesh))
    shuffled, order = permuted(mesh)
    for other, at in (
        (moved(mesh, [9, 9, 9], seed=2), slice(None)), (moved(mesh, scale=1e-6), slice(None)),
        (moved(mesh, scale=1e6), slice(None)), (shuffled, order),
    ):  # fmt: skip
        found = eigenpairs(operator(other))
        np.testing.assert_allclose(found.eigenvalues, expected.eigenvalues, rtol=1e-8, atol=1e-8)
        fiedler = expected.fiedler[at] * np.sign(found.fiedler @ expected.fiedler[at])
        np.testing.assert_allclose(found.fiedler, fiedler, atol=10.0**-digits)


def test_a_vertex_without_mass_takes_part():
    """A face without area at a vertex of its own: C binds it, R does not weigh it."""
    for mesh in (grid(3, 3), grid(12, 12)):
        plain = operator(mesh)
        n = len(mesh.vertices)
        C = plain.C.toarray()
        C = np.block([[C, np.zeros((n, 1))], [np.zeros((1, n + 1))]])
        C[np.ix_([0, n], [0, n])] += [[1, -1], [-1, 1]]
        spectrum = eigenpairs(Operator(csr_matrix(C), np.append(plain.mass, 0.0), "cotangent"))
        np.testing.assert_allclose(spectrum.eigenvalues, eigenpairs(plain).eigenvalues, atol=1e-8)
        assert spectrum.fiedler[n] == pytest.approx(spectrum.fiedler[0])


def star(limbs, seed=0, subdivisions=4):
    """A sphere with so many cones pulled out of it, the more the closer their eigenvalues."""
    mesh = icosphere(subdivisions)
    axes = np.random.default_rng(seed).standard_normal((limbs, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    pull = np.exp(8 * (mesh.vertices @ axes.T - 1)).sum(axis=1)
    return Mesh(mesh.vertices * (1 + 3 * pull[:, None]), mesh.faces)


def crumpled(mesh, strength, seed=0):
    """With slivers and obtuse triangles, and edges crossing one another."""
    edge = np.linalg.norm(mesh.vertices[mesh.faces[:, 0]] - mesh.vertices[mesh.faces[:, 1]], axis=1).mean()
    noise = np.random.default_rng(seed).standard_normal(mesh.vertices.shape)
    return Mesh(mesh.vertices + strength * edge * noise, mesh.faces)


def squeezed(mesh, factor):
    return Mesh(mesh.vertices * (1.0, factor, 1.0), mesh.faces)


FAR = {
    "star": star(5), "many limbs": star(12), "torus": torus(nu=60, nv=30), "strip": grid(120, 12, 10.0, 1.0),
    "square": grid(30, 30), "sphere": icosphere(4), "moebius": moebius(nu=120, nv=8), "poles": uv_sphere(64, 48),
    "wire": cylinder(60.0, 0.2, nu=3, along=400), "crumpled": crumpled(star(5), 0.4), "flat": squeezed(star(5), 0.02),
    "cut open": Mesh(star(5).vertices, star(5).faces[:-400:]), "capsule": capsule(along=60),
}  # fmt: skip


@pytest.mark.parametrize("name", FAR)
@pytest.mark.parametrize("kind", ["cotangent", "tufted"])
@pytest.mark.parametrize("k", [3, 4])
def test_multigrid_equals_the_factorisation_as_far_as_it_promises(name, kind, k):
    used = np.unique(FAR[name].faces)
    mesh = Mesh(FAR[name].vertices[used], np.searchsorted(used, FAR[name].faces))
    known = operator(mesh, kind)
    mass = known.mass / known.area
    found = first_eigenpairs(known.C, mass, mesh, k - 1)
    assert found is not None
    exact = eigenpairs(Operator(known.C, known.mass, kind), 8)
    np.testing.assert_allclose(found[0], exact.eigenvalues[1:k], rtol=1e-8)
    np.testing.assert_array_equal(eigenpairs(known, k).eigenvectors[:, 1:], found[1])
    # phi_2 against its projection on the eigenvectors that share its eigenvalue
    same = exact.eigenvectors[:, 1:][:, exact.eigenvalues[1:] < exact.eigenvalues[1] * (1 + 1e-6)]
    phi = found[1][:, 0]
    off = phi - same @ (same.T @ (mass * phi))
    assert np.sqrt(mass @ off**2) < 1e-5
    np.testing.assert_allclose(found[1].T @ (mass[:, None] * found[1]), np.eye(k - 1), atol=1e-9)
    np.testing.assert_allclose(mass @ found[1], 0.0, atol=1e-9)


def test_multigrid_leaves_to_the_factorisation_what_it_cannot_do():
    """No level below the first; a graph that does not coarsen; two parts; a vertex of its own; nothing finite."""
    sphere, two = icosphere(3), joined(icosphere(3), moved(icosphere(3), [3, 0, 0]))
    lonely = Mesh(np.concatenate([sphere.vertices, [[9, 9, 9]]]), sphere.faces)
    for mesh in (cube(), two, lonely):
        made = operator(mesh)
        assert first_eigenpairs(made.C, made.mass / made.area, mesh, 2) is None
    made = operator(sphere)
    weak = made.C + 1e6 * csr_matrix(np.diag(made.C.diagonal()))
    assert first_eigenpairs(csr_matrix(weak), made.mass / made.area, sphere, 2) is None
    assert first_eigenpairs(made.C * np.nan, made.mass / made.area, sphere, 2) is None
    np.testing.assert_allclose(eigenpairs(operator(two), 3).eigenvalues[1], 0.0, atol=1e-8)


def test_near_degeneracy_is_a_ratio_below_1_05():
    assert eigenpairs(operator(icosphere(2))).near_degenerate
    assert eigenpairs(operator(grid(10, 10))).near_degenerate
    assert not eigenpairs(operator(capsule())).near_degenerate
    vectors = np.ones((5, 3))
    assert not Spectrum(np.array([0, 1, 1.05]), vectors).near_degenerate
    assert Spectrum(np.array([0, 1, 1.0499]), vectors).near_degenerate
    with pytest.raises(ParameterError, match="k=3"):
        _ = eigenpairs(operator(capsule()), 2).near_degenerate
    with pytest.raises(ParameterError, match="k=2"):
        _ = eigenpairs(operator(capsule()), 1).fiedler


@pytest.mark.parametrize("k", [0, -1, 5])
def test_refuses_more_eigenpairs_than_vertices(k):
    with pytest.raises(ParameterError, match="4 vertices has 4 eigenpairs"):
        eigenpairs(operator(tetrahedron()), k)


@pytest.mark.parametrize("mesh", [tetrahedron(), icosphere(2)], ids=["dense", "sparse"])
def test_says_so_when_a_vertex_has_no_faces(mesh):
    lonely = Mesh(np.concatenate([mesh.vertices, [[9, 9, 9]]]), mesh.faces)
    with pytest.raises(ComputationError, match="without faces"):
        eigenpairs(operator(lonely))


def test_refuses_a_factor_that_errs(monkeypatch):
    right, wrong = Factor.solve, 1 + 1e-4 * np.sin(np.arange(162))
    monkeypatch.setattr(Factor, "solve", lambda self, b, scale: right(self, wrong * b, scale) * wrong)
    with pytest.raises(ComputationError):
        eigenpairs(operator(icosphere(2)))


@pytest.mark.parametrize("k", [3, 40])
def test_vertices_that_weigh_next_to_nothing_get_their_neighbours_values(k):
    """A vertex in a face that is 1e-6 of an edge wide."""
    mesh = icosphere(3)
    a, b, c = mesh.faces[0]
    middle = mesh.vertices[[a, b, c]].mean(axis=0)
    points = np.vstack([mesh.vertices, middle + 1e-6 * (mesh.vertices[[a, b, c]] - middle), middle])
    d, e, f, g = range(len(mesh.vertices), len(points))
    faces = [[a, b, d], [b, e, d], [b, c, e], [c, f, e], [c, a, f], [a, d, f], [d, e, g], [e, f, g], [f, d, g]]
    made = operator(Mesh(points, np.vstack([mesh.faces[1:], faces])), "cotangent")
    assert made.mass[g] < 1e-10 * np.median(made.mass)
    found = eigenpairs(Operator(made.C, made.mass, made.kind), k, tolerance=1e-4)
    np.testing.assert_allclose(found.eigenvectors[g], found.eigenvectors[[d, e, f]].mean(axis=0), atol=1e-4)
    np.testing.assert_allclose(found.eigenvalues, eigenpairs(operator(mesh), k).eigenvalues, rtol=1e-2, atol=1e-6)


@pytest.mark.parametrize("tolerance", [0.0, 0.1, np.nan])
def test_refuses_a_tolerance_out_of_range(tolerance):
    with pytest.raises(ParameterError, match="from 1e-12 to 1e-2"):
        eigenpairs(operator(icosphere(2)), tolerance=tolerance)


MANY = {
    "star": star(5, subdivisions=3), "sphere": icosphere(3), "torus": torus(nu=32, nv=16), "square": grid(22, 22),
    "poles": uv_sphere(), "strip": grid(70, 7, 10.0, 1.0), "wire": cylinder(60.0, 0.2, nu=3, along=150),
    "four": joined(*[moved(icosphere(2), [3 * i, 0, 0]) for i in range(4)]),
}  # fmt: skip


@pytest.fixture(scope="module", params=MANY)
def solved(request):
    """An operator and all its eigenvalues by a dense solver."""
    made = operator(MANY[request.param])
    return made, scipy.linalg.eigh(made.C.toarray(), np.diag(made.mass / made.area), eigvals_only=True)


@pytest.mark.parametrize("k", [3, 8, 36, 50, 100])
def test_many_eigenpairs_and_all_copies_equal_a_dense_solver(solved, k):
    """Four like spheres have every eigenvalue of the sphere, up to five at once by its symmetry, four times."""
    made, exact = solved
    mass = made.mass / made.area
    found = eigenpairs(Operator(made.C, made.mass, made.kind), k)
    np.testing.assert_allclose(found.eigenvalues, exact[:k], rtol=1e-8, atol=1e-9 * max(exact[k - 1], 1))
    phi = found.eigenvectors
    np.testing.assert_allclose(phi.T @ (mass[:, None] * phi), np.eye(k), atol=1e-8)
    off = made.C @ phi - mass[:, None] * phi * found.eigenvalues
    assert (np.sqrt((off**2 / mass[:, None]).sum(axis=0)) < 1e-4 * max(exact[k - 1], 1)).all()


def test_many_eigenvalues_do_not_depend_on_the_order_of_vertices_nor_on_the_mesh_being_known():
    mesh = star(5)
    expected = eigenpairs(operator(mesh), 40)
    shuffled = operator(permuted(mesh)[0])
    for made in (shuffled, Operator(shuffled.C, shuffled.mass, shuffled.kind)):
        np.testing.assert_allclose(eigenpairs(made, 40).eigenvalues, expected.eigenvalues, rtol=1e-8, atol=1e-9)
    again = eigenpairs(operator(mesh), 40)
    np.testing.assert_array_equal(again.eigenvectors, expected.eigenvectors)


def test_a_coarser_tolerance_errs_by_its_square():
    made = operator(star(5))
    exact, coarse = eigenpairs(made, 40, 1e-11).eigenvalues[1:], eigenpairs(made, 40, 1e-4).eigenvalues[1:]
    assert 1e-14 < abs(coarse / exact - 1).max() < 1e-6


def test_a_third_of_the_pairs_of_a_symmetric_shape():
    # A cube of voxels: eigenvalues in multiplets, and not many more vertices than three times those wanted.
    mesh = voxels(np.ones((7, 7, 7), dtype=bool))
    built = operator(mesh)
    spectrum = eigenpairs(built, 90)
    assert 3 * 90 < len(mesh.vertices) < 6 * 90
    exact = scipy.linalg.eigh(built.C.toarray(), np.diag(built.mass / built.area), eigvals_only=True)[:90]
    np.testing.assert_allclose(spectrum.eigenvalues, exact, rtol=1e-8, atol=1e-8)
