"""Ways along the surface against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from reebase.errors import ParameterError
from reebase.mesh import Mesh
from reebase.mesh.geodesics import distance_to, farthest_points, geodesic_distances
from reebase.mesh.topology import edges
from tests.shapes import capsule, cylinder, grid, icosphere, joined, moved, torus


def along_edges(mesh: Mesh, source: int) -> np.ndarray:
    a, b = edges(mesh.faces).vertices.T
    lengths = np.linalg.norm(mesh.vertices[a] - mesh.vertices[b], axis=1)
    count = len(mesh.vertices)
    return dijkstra(coo_array((lengths, (a, b)), shape=(count, count)).tocsr(), directed=False, indices=source)


def test_it_is_exact_on_a_plane():
    mesh = moved(grid(17, 11, 3.0, 2.0), (1, 2, 3), seed=4)
    sources = [0, 40, 99]
    expected = np.linalg.norm(mesh.vertices[sources][:, None] - mesh.vertices, axis=2)
    np.testing.assert_allclose(geodesic_distances(mesh, sources), expected, atol=1e-12)


def test_it_is_exact_on_what_unrolls_into_a_plane():
    mesh = cylinder(2.0, 0.5, nu=24, along=16)
    source = mesh.vertices[0]
    step = np.rint(np.angle(np.exp(1j * (np.arctan2(*mesh.vertices.T[1::-1]) - np.arctan2(source[1], source[0]))))
                   / (2 * np.pi / 24))  # fmt: skip
    side = 2 * 0.5 * np.sin(np.pi / 24)
    expected = np.hypot(step * side, mesh.vertices[:, 2] - source[2])
    body = np.isclose(np.hypot(*mesh.vertices.T[:2]), 0.5)
    np.testing.assert_allclose(geodesic_distances(mesh, [0])[0][body], expected[body], atol=1e-9)


def test_on_the_sphere_it_tends_to_the_great_circle():
    errors = []
    for level in (2, 3, 4):
        mesh = icosphere(level)
        exact = np.arccos(np.clip(mesh.vertices @ mesh.vertices[7], -1, 1))
        errors.append(np.abs(geodesic_distances(mesh, [7])[0] - exact).max())
    assert errors[2] < 0.05
    assert errors[2] < 0.62 * errors[1] < 0.62**2 * errors[0]


@pytest.mark.parametrize("mesh", [torus(), capsule(), moved(torus(1, 0.2, 30, 7), seed=1)])
def test_it_lies_between_the_straight_line_and_the_way_along_edges(mesh):
    found = geodesic_distances(mesh, [3])[0]
    assert (found >= np.linalg.norm(mesh.vertices - mesh.vertices[3], axis=1) - 1e-12).all()
    assert (found <= along_edges(mesh, 3) + 1e-12).all()
    assert found[3] == 0.0


def test_no_way_is_infinite():
    found = geodesic_distances(joined(icosphere(1), moved(icosphere(1), (5, 0, 0))), [0])[0]
    assert np.isfinite(found[:42]).all()
    assert np.isinf(found[42:]).all()


def test_points_are_spread():
    mesh = grid(20, 20)
    spread = farthest_points(mesh, 4)
    corners = {tuple(corner) for corner in mesh.vertices[spread.vertices, :2].tolist()}
    assert corners == {(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)}
    np.testing.assert_array_equal(spread.nearest[spread.vertices], np.arange(4))
    np.testing.assert_array_equal(spread.distances, geodesic_distances(mesh, spread.vertices))
    assert len(farthest_points(icosphere(0), 100).vertices) == 12


def test_points_keep_clear():
    mesh = grid(20, 20)
    clear = np.minimum(mesh.vertices[:, :2], 1 - mesh.vertices[:, :2]).min(axis=1)
    first = farthest_points(mesh, 5, clear=clear).vertices
    np.testing.assert_allclose(mesh.vertices[first[0], :2], 0.5)
    assert clear[first].min() >= 0.2


def test_within_reach_nothing_changes_and_beyond_is_infinite():
    mesh = torus()
    whole, near = geodesic_distances(mesh, [3, 50]), geodesic_distances(mesh, [3, 50], reach=0.8)
    np.testing.assert_array_equal(near, np.where(whole <= 0.8, whole, np.inf))
    spread, local = farthest_points(mesh, 20), farthest_points(mesh, 20, reach=0.3)
    np.testing.assert_array_equal(local.vertices, spread.vertices)
    np.testing.assert_array_equal(local.nearest, spread.nearest)
    known = np.isfinite(local.distances)
    assert known[spread.distances <= 0.3].all()
    np.testing.assert_array_equal(local.distances[known], spread.distances[known])


def test_the_distance_to_several_is_that_to_the_nearest():
    mesh = grid(12, 9)
    sources = [0, 60, 61, 100, 60]
    np.testing.assert_allclose(
        distance_to(mesh, sources), geodesic_distances(mesh, sources).min(axis=0), atol=0.02
    )
    assert np.isinf(distance_to(mesh, [])).all()


def test_what_is_no_vertex_is_refused():
    with pytest.raises(ParameterError, match="0 to 11"):
        geodesic_distances(icosphere(0), [12])
    with pytest.raises(ParameterError, match="at least 1"):
        farthest_points(icosphere(0), 0)
