from __future__ import annotations

import numpy as np
import pytest

from reebase.denoise import (
    add_noise,
    displacement,
    edge_angle,
    face_normal_error,
    joined_soup,
    mean_angle,
    measure_errors,
    vertex_error,
    visual_error,
    volume_change,
)
from reebase.denoise.distance import distances_to_surface, square_distances
from reebase.errors import MeshError, NoFaces, ParameterError
from reebase.mesh.mesh import Mesh
from tests.oracles import denoise as oracle
from tests.shapes import cube, flipped, grid, icosphere, joined, moebius, moved, torus

MEASURES = {
    "mean_angle": mean_angle, "displacement": displacement, "face_normal_error": face_normal_error,
    "visual_error": visual_error, "vertex_error": vertex_error, "volume_change": volume_change,
}  # fmt: skip
every_measure = pytest.mark.parametrize("measure", MEASURES.values(), ids=MEASURES)


def tilted(degrees: float) -> Mesh:
    """A grid turned about the x axis."""
    angle = np.radians(degrees)
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    return Mesh(grid(4, 4).vertices @ turn.T, grid(4, 4).faces)


@every_measure
def test_a_mesh_has_no_error_against_itself(measure) -> None:
    mesh = add_noise(torus(), 0.3)
    assert measure(mesh, mesh) == pytest.approx(0, abs=1e-15)


@every_measure
def test_without_faces_nothing_can_be_said(measure) -> None:
    points = Mesh(np.zeros((3, 3)), np.zeros((0, 3), dtype=int))
    with pytest.raises(NoFaces):
        measure(points, points)


@pytest.mark.parametrize(
    "measure", [mean_angle, displacement, edge_angle, face_normal_error, visual_error, volume_change]
)
def test_other_faces_are_refused(measure) -> None:
    with pytest.raises(ParameterError, match="same faces; the truth"):
        measure(torus(), flipped(torus()))
    with pytest.raises(ParameterError, match="same faces; the truth"):
        measure(torus(), cube())


@pytest.mark.parametrize("degrees", [1e-7, 1.0, 90.0, 179.0])
def test_turned_by_an_angle(degrees: float) -> None:
    """|n - n^| = 2 sin(angle / 2) on every face."""
    assert mean_angle(tilted(0), tilted(degrees)) == pytest.approx(degrees)
    assert face_normal_error(tilted(0), tilted(degrees)) == pytest.approx(2 * np.sin(np.radians(degrees) / 2))


def test_the_face_normal_error_is_weighted_by_the_area_of_the_result() -> None:
    truth = joined(tilted(0), moved(tilted(0), (0, 0, 5)))
    result = joined(tilted(90), moved(tilted(0), (0, 0, 5), scale=3.0))
    assert face_normal_error(truth, result) == pytest.approx(np.sqrt(2) * 1 / 10)
    assert mean_angle(truth, result) == pytest.approx(45)


def test_faces_without_area_do_not_count_in_the_mean_angle() -> None:
    flat = Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    assert mean_angle(joined(tilted(0), flat), joined(tilted(30), flat)) == pytest.approx(30)
    assert mean_angle(flat, flat) == 0


def test_translation_moves_positions_and_no_laplacian() -> None:
    mesh = icosphere(2)
    assert visual_error(mesh, moved(mesh, (3, 0, 4))) == pytest.approx(25 / 2)
    assert mean_angle(mesh, moved(mesh, (3, 0, 4))) == pytest.approx(0, abs=1e-12)
    assert volume_change(mesh, moved(mesh, (3, 0, 4))) == pytest.approx(0, abs=1e-10)


def test_the_visual_error_equals_its_slow_twin() -> None:
    first, second = add_noise(torus(nu=9, nv=6), 0.3), add_noise(torus(nu=9, nv=6), 0.2, "isotropic", seed=5)
    assert visual_error(first, second) == pytest.approx(oracle.visual_error(first, second))


def test_vertices_without_faces_do_not_count_in_the_visual_error() -> None:
    first, second = icosphere(1), moved(icosphere(1), (1, 0, 0))
    far = Mesh(np.concatenate([second.vertices, [[9.0, 9, 9]]]), second.faces)
    near = Mesh(np.concatenate([first.vertices, [[np.nan, 0, 0]]]), first.faces)
    assert visual_error(near, far) == pytest.approx(0.5)


@pytest.mark.parametrize("scale", [0.5, 0.9, 1.1, 2.0])
def test_scaling_changes_volume_by_its_cube(scale: float) -> None:
    assert volume_change(cube(), moved(cube(), scale=scale)) == pytest.approx(100 * (scale**3 - 1))
    assert mean_angle(cube(), moved(cube(), scale=scale)) == pytest.approx(0)


@pytest.mark.parametrize("mesh", [grid(2, 2), moebius()], ids=["open", "moebius"])
def test_a_surface_that_encloses_nothing_has_no_volume(mesh: Mesh) -> None:
    with pytest.raises(MeshError, match="no volume"):
        volume_change(mesh, mesh)


def test_vertices_above_a_sheet() -> None:
    sheet = grid(5, 5, 3.0, 4.0)
    assert vertex_error(sheet, moved(sheet, (0, 0, 1))) == pytest.approx(1 / 5)
    assert vertex_error(sheet, moved(sheet, scale=0.5)) == pytest.approx(0, abs=1e-15)


def test_a_cube_in_a_cube() -> None:
    """The corners of the inner cube are half the difference of the sides from the outer one's faces."""
    assert vertex_error(cube(2.0), cube(1.0)) == pytest.approx(0.5 / np.sqrt(12))
    assert vertex_error(cube(1.0), cube(2.0)) == pytest.approx(np.sqrt(3) / 2 / np.sqrt(3))


def test_a_point_gives_no_scale() -> None:
    with pytest.raises(MeshError, match="single point"):
        vertex_error(Mesh(np.ones((3, 3)), np.array([[0, 1, 2]])), cube())


def test_distances_with_triangles_of_very_different_size() -> None:
    """The nearest triangle is not the one with the nearest centroid."""
    mesh = joined(cube(100.0), moved(icosphere(3), (0, 0, 60)))
    points = np.random.default_rng(0).uniform(-80, 80, size=(200, 3))
    corners = mesh.vertices[mesh.faces]
    expected = np.sqrt(square_distances(points[:, None], corners[None]).min(axis=1))
    assert distances_to_surface(points, mesh) == pytest.approx(expected)


def test_the_distance_to_a_triangle_by_region() -> None:
    triangle = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]])
    points = np.array([[1.0, 1, 3], [-3, -4, 0], [2, -5, 0], [4, 4, 0], [7, 0, 4], [1, 1, 0]])
    expected = [3, 5, 5, np.sqrt(8), 5, 0]
    assert np.sqrt(square_distances(points, triangle[None])) == pytest.approx(expected)


def test_the_distance_to_a_triangle_that_is_a_line_or_a_point() -> None:
    line = np.array([[[0.0, 0, 0], [1, 0, 0], [3, 0, 0]], [[1, 1, 1], [1, 1, 1], [1, 1, 1]]])
    assert np.sqrt(square_distances(np.array([2.0, 2, 0]), line)) == pytest.approx([2, np.sqrt(3)])


def test_displacement_counts_mean_edges_and_no_isolated_vertices() -> None:
    """A cube of 12 sides of length 1 and 6 diagonals, moved by 1/2."""
    alone = np.vstack([cube().vertices, [[np.nan] * 3]])
    truth, result = Mesh(alone, cube().faces), Mesh(alone + np.array([0.3, 0, -0.4]), cube().faces)
    assert displacement(truth, result) == pytest.approx(0.5 * 18 / (12 + 6 * np.sqrt(2)))


def roof(degrees: float) -> Mesh:
    """A level side over x < 0, and one that falls at a right angle less ``degrees`` beyond the ridge x = 0."""
    flat = grid(8, 4)
    x, y, _ = (flat.vertices - [0.5, 0, 0]).T
    fall = np.radians(90 - degrees)
    beyond = np.maximum(x, 0)
    return Mesh(np.stack([np.where(x > 0, np.cos(fall) * x, x), y, -np.sin(fall) * beyond], axis=1), flat.faces)


def test_the_angle_at_edges_is_that_of_the_faces_round_them() -> None:
    truth, bent = roof(0), roof(10)
    x = grid(8, 4).vertices[grid(8, 4).faces][:, :, 0] - 0.5
    near, beyond = (x == 0).any(axis=1), x.max(axis=1) > 0
    assert 0 < near.sum() < len(near)
    assert edge_angle(truth, bent) == pytest.approx(10 * beyond[near].mean())
    assert mean_angle(truth, bent) == pytest.approx(10 * beyond.mean())
    assert edge_angle(truth, bent, 95.0) is None
    assert edge_angle(torus(), add_noise(torus(), 0.2)) is None


def test_all_errors_at_once_are_each_by_itself() -> None:
    truth, result = torus(), add_noise(torus(), 0.3)
    found = measure_errors(truth, result)
    for name, measure in MEASURES.items():
        if name != "visual_error":
            assert getattr(found, name) == measure(truth, result)
    larger = measure_errors(Mesh(7 * truth.vertices, truth.faces), Mesh(7 * result.vertices, result.faces))
    assert larger.visual_error == pytest.approx(found.visual_error)
    assert measure_errors(moebius(), moebius()).volume_change is None


def test_triangles_without_common_vertices_are_joined_soup() -> None:
    mesh = torus()
    soup = Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))
    found = joined_soup(soup)
    assert len(found.vertices) == len(mesh.vertices)
    assert np.array_equal(found.vertices[found.faces], mesh.vertices[mesh.faces])
    assert joined_soup(mesh) is mesh
    one = Mesh(np.eye(3), [[0, 1, 2]])
    assert joined_soup(one) is one
