from __future__ import annotations

import numpy as np
import pytest

from reebase.errors import UnknownName
from reebase.mesh.geometry import face_areas, face_normals, mean_edge_length, signed_volume, vertex_normals
from reebase.mesh.mesh import Mesh
from tests.oracles.denoise import area
from tests.shapes import cube, flipped, grid, icosphere, moved, tetrahedron, torus


def test_area_equals_herons_formula() -> None:
    mesh = torus(nu=11, nv=7)
    expected = [area(mesh.vertices, face) for face in mesh.faces]
    assert face_areas(mesh) == pytest.approx(expected, rel=1e-12)


def test_normals_of_a_cube_are_the_axes() -> None:
    normals = face_normals(cube())
    centroids = cube().vertices[cube().faces].mean(axis=1)
    axis = np.abs(centroids).argmax(axis=1)
    expected = np.zeros_like(normals)
    expected[np.arange(12), axis] = np.sign(centroids[np.arange(12), axis])
    assert normals == pytest.approx(expected)


def test_a_face_without_area_has_normal_zero() -> None:
    mesh = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.array([[0, 1, 2]]))
    assert (face_normals(mesh) == 0).all()
    assert (vertex_normals(mesh) == 0).all()


@pytest.mark.parametrize("weights", ["uniform", "area", "angle"])
def test_vertex_normals_of_a_regular_solid_point_from_its_centre(weights: str) -> None:
    mesh = icosphere(0)
    assert vertex_normals(mesh, weights) == pytest.approx(mesh.vertices)


def test_angle_weights_do_not_depend_on_how_a_cube_is_cut() -> None:
    mesh = cube(2.0)
    assert vertex_normals(mesh, "angle") == pytest.approx(mesh.vertices / np.sqrt(3))


def test_area_weights_sum_doubled_normals() -> None:
    mesh = torus(nu=8, nv=5)
    expected = np.zeros_like(mesh.vertices)
    for face, normal, size in zip(mesh.faces, face_normals(mesh), face_areas(mesh), strict=True):
        expected[face] += size * normal
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    assert vertex_normals(mesh, "area") == pytest.approx(expected)


def test_unknown_weights_are_refused() -> None:
    with pytest.raises(UnknownName, match="angle, area, uniform"):
        vertex_normals(cube(), "volume")


def test_mean_edge_length_counts_each_edge_once() -> None:
    assert mean_edge_length(tetrahedron()) == pytest.approx(2 * np.sqrt(2))
    assert mean_edge_length(grid(1, 1)) == pytest.approx((4 + np.sqrt(2)) / 5)
    assert mean_edge_length(Mesh(np.zeros((2, 3)), np.zeros((0, 3), dtype=int))) == 0


def test_volume_is_signed_and_does_not_move() -> None:
    assert signed_volume(cube(2.0)) == pytest.approx(8)
    assert signed_volume(flipped(cube(2.0))) == pytest.approx(-8)
    assert signed_volume(moved(cube(2.0), (1e6, 0, -1e6))) == pytest.approx(8)
    assert signed_volume(Mesh(np.zeros((0, 3)), np.zeros((0, 3), dtype=int))) == 0
