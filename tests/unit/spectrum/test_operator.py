"""C and R: equal to straight loops, and the properties that make them a Laplacian."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from reebase.errors import DegenerateMesh, MissingPackage, NoFaces, UnknownName
from reebase.mesh.mesh import Mesh
from reebase.spectrum import eigenpairs, mixed_voronoi, operator, stiffness
from reebase.spectrum.operator import CROWD
from tests.oracles import spectrum as oracle
from tests.shapes import cube, flipped, grid, icosphere, moebius, moved, permuted, tetrahedron, torus, uv_sphere

SURFACES = {
    "tetrahedron": tetrahedron(), "cube": cube(), "sphere": icosphere(2), "poles": uv_sphere(), "torus": torus(),
    "rectangle": grid(4, 3, 2.0, 1.0), "moebius": moebius(),
    "rough": Mesh(icosphere(2).vertices * np.random.default_rng(0).uniform(0.6, 1.4, (162, 1)), icosphere(2).faces),
}  # fmt: skip


def area(mesh):
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def three_pages():
    """A book: one edge with three faces."""
    return Mesh([[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, -1, 0]], [[0, 1, 2], [0, 1, 3], [0, 1, 4]])


def with_sliver(height):
    """A square with a vertex on one side, at the given distance from it."""
    vertices = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, height, 0]]
    return Mesh(vertices, [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])


@pytest.mark.parametrize("name", SURFACES)
def test_equals_the_straight_loops(name):
    mesh = SURFACES[name]
    np.testing.assert_allclose(stiffness(mesh).toarray(), oracle.stiffness(mesh), atol=1e-11)
    np.testing.assert_allclose(mixed_voronoi(mesh), oracle.mixed_voronoi(mesh), atol=1e-13)


@pytest.mark.parametrize("kind", ["cotangent", "tufted"])
@pytest.mark.parametrize("name", SURFACES)
def test_symmetric_positive_semi_definite_and_blind_to_constants(name, kind):
    found = operator(SURFACES[name], kind)
    C = found.C.toarray()
    assert found.kind == kind and found.C.format == "csr" and found.C.has_sorted_indices
    np.testing.assert_array_equal(C, C.T)
    np.testing.assert_allclose(C.sum(axis=1), 0, atol=1e-11)
    eigenvalues = np.linalg.eigvalsh(C)
    assert eigenvalues[0] > -1e-11 and eigenvalues[1] > 1e-6


@pytest.mark.parametrize("name", SURFACES)
def test_masses_are_positive_and_sum_to_the_area(name):
    mass = mixed_voronoi(SURFACES[name])
    assert mass.sum() == pytest.approx(area(SURFACES[name]), rel=1e-13)
    assert (mass > 0).all()
    assert operator(SURFACES[name]).area == pytest.approx(area(SURFACES[name]), rel=1e-13)


def test_cells_of_a_regular_grid_are_squares():
    mass = mixed_voronoi(grid(4, 4)).reshape(5, 5)
    np.testing.assert_allclose(mass[1:-1, 1:-1], 1 / 16)
    np.testing.assert_allclose(mass[0, 1:-1], 1 / 32)
    np.testing.assert_allclose([mass[0, 0], mass[0, -1]], 1 / 64)


def test_an_obtuse_triangle_gives_half_to_its_obtuse_corner():
    mesh = Mesh([[0, 0, 0], [4, 0, 0], [1, 1, 0]], [[0, 1, 2]])
    np.testing.assert_allclose(mixed_voronoi(mesh), [0.5, 0.5, 1.0])


def test_the_dirichlet_energy_of_a_linear_function_is_exact():
    """x on a rectangle of 3 by 2: the energy is the area."""
    for mesh in (grid(5, 4, 3.0, 2.0), moved(grid(5, 4, 3.0, 2.0), [1, 2, 3], seed=3)):
        x = grid(5, 4, 3.0, 2.0).vertices[:, 0]
        assert x @ (stiffness(mesh) @ x) == pytest.approx(6.0)


def test_invariant_to_motion_scale_order_and_orientation():
    mesh = SURFACES["rough"]
    C, mass = stiffness(mesh).toarray(), mixed_voronoi(mesh)
    for other, factor in (
        (moved(mesh, [5, -3, 2], seed=1), 1), (moved(mesh, scale=1e-5), 1e-10), (moved(mesh, scale=1e7), 1e14),
        (flipped(mesh, range(0, 320, 3)), 1),
    ):  # fmt: skip
        np.testing.assert_allclose(stiffness(other).toarray(), C, atol=1e-10)
        np.testing.assert_allclose(mixed_voronoi(other), factor * mass, rtol=1e-10)
    shuffled, order = permuted(mesh)
    np.testing.assert_allclose(stiffness(shuffled).toarray(), C[np.ix_(order, order)], atol=1e-12)
    np.testing.assert_allclose(mixed_voronoi(shuffled), mass[order], rtol=1e-12)


def test_the_tufted_cover_of_a_delaunay_surface_is_the_cotangent_operator():
    mesh = icosphere(3)
    difference = abs(operator(mesh, "tufted").C - operator(mesh, "cotangent").C).max()
    assert difference < 1e-3


def test_auto_takes_the_tufted_cover_only_where_it_is_needed():
    assert operator(icosphere(1)).kind == "cotangent"
    assert operator(moebius()).kind == "cotangent"
    assert operator(with_sliver(1e-2)).kind == "cotangent"
    assert operator(with_sliver(1e-6)).kind == "tufted"
    assert operator(three_pages()).kind == "tufted"


def test_mass_stays_that_of_the_given_mesh_under_the_tufted_cover():
    np.testing.assert_array_equal(operator(three_pages()).mass, mixed_voronoi(three_pages()))


@pytest.mark.parametrize("height", [0.0, 1e-300, 1e-17, 1e-9, -1e-17])
@pytest.mark.parametrize("kind", ["auto", "cotangent", "tufted"])
def test_degenerate_triangles_give_nothing_infinite(height, kind):
    found = operator(with_sliver(height), kind)
    assert np.isfinite(found.C.data).all() and np.isfinite(found.mass).all()
    assert (found.mass >= 0).all()
    assert found.area == pytest.approx(area(with_sliver(height)), rel=1e-12)
    # a vertex twice in a face, and a face that is a point
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0]]
    if kind == "cotangent":
        found = operator(Mesh(vertices, [[0, 1, 2], [0, 0, 1], [2, 2, 2], [0, 3, 1]]), kind)
        assert np.isfinite(found.C.data).all()
        np.testing.assert_allclose(found.mass[:3], [0.25, 0.125, 0.125])


def test_refuses_what_has_no_surface():
    with pytest.raises(NoFaces):
        operator(Mesh(np.zeros((3, 3)), np.empty((0, 3), int)))
    with pytest.raises(DegenerateMesh):
        operator(Mesh(np.zeros((3, 3)), [[0, 1, 2]]))
    with pytest.raises(DegenerateMesh, match="area"):
        operator(moved(cube(), scale=1e200))
    with pytest.raises(UnknownName, match="cotangent"):
        operator(cube(), "graph")


def test_names_the_package_that_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "robust_laplacian", None)
    with pytest.raises(MissingPackage, match=r"reebase\[robust\]"):
        operator(three_pages())
    assert operator(cube()).kind == "cotangent"


def book(pages):
    """So many triangles on one edge."""
    turn = 2 * np.pi * np.arange(pages) / pages
    tips = np.stack([np.cos(turn), np.sin(turn), np.full(pages, 0.5)], axis=1)
    page = np.stack([np.zeros(pages), np.ones(pages), 2 + np.arange(pages)], axis=1)
    return Mesh(np.vstack([[0, 0, 0], [0, 0, 1], tips]), page.astype(int))


def test_an_edge_with_very_many_faces_does_not_take_the_tufted_cover():
    assert operator(book(CROWD)).kind == "tufted"
    many = operator(book(CROWD + 1))
    assert many.kind == "cotangent"
    assert many.area == pytest.approx((CROWD + 1) / 2)
    # Each tip hangs on the edge alone: equal eigenvalues, one fewer than pages, of vectors that vanish on the edge.
    tip = many.C[2, 2] / (many.mass[2] / many.area)
    np.testing.assert_allclose(eigenpairs(many, 9).eigenvalues[1:], tip, rtol=1e-8)
