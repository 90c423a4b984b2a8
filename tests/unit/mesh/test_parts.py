"""Parts by size and where they are nearest: against distances of all pairs, and gaps that are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial.distance import cdist

from reebase.errors import DegenerateMesh, NoFaces
from reebase.mesh import Mesh, largest_component
from reebase.mesh.parts import links, parts
from reebase.mesh.parts_kernels import spanning_tree, touching
from tests.shapes import cube, grid, icosphere, joined, moved, permuted


def points_of(found, linked):
    corners = found.mesh.vertices[found.mesh.faces[linked.faces]]
    return np.einsum("lsi,lsij->lsj", linked.weights, corners)


def test_parts_are_numbered_by_area_and_the_first_is_the_largest_component() -> None:
    mesh = joined(cube(), icosphere(2, 3.0), moved(cube(), (9, 0, 0), scale=2))
    found = parts(mesh)
    assert len(found) == 3
    assert found.areas[1:].tolist() == pytest.approx([24, 6])
    (first, kept), (same, also) = found.part(0), largest_component(mesh)
    np.testing.assert_array_equal(first.vertices, same.vertices)
    np.testing.assert_array_equal(first.faces, same.faces)
    np.testing.assert_array_equal(kept, also)
    assert [len(found.largest(count)) for count in (1, 2, 9)] == [1, 2, 3]
    assert len(found.largest(1).mesh.faces) == len(first.faces)


def test_no_faces_is_refused() -> None:
    with pytest.raises(NoFaces):
        parts(Mesh(np.zeros((3, 3)), np.empty((0, 3), int)))


@pytest.mark.filterwarnings("ignore:overflow")
@pytest.mark.parametrize("scale", [0.0, 1e-170, 1e170])
def test_parts_without_an_area_that_can_be_told_are_refused(scale: float) -> None:
    mesh = joined(cube(), moved(cube(), (9, 0, 0)))
    with pytest.raises(DegenerateMesh, match="area"):
        links(parts(Mesh(mesh.vertices * scale, mesh.faces)))


@pytest.mark.parametrize("count", [2, 7, 60])
def test_the_tree_is_as_short_as_that_of_all_distances(count: int) -> None:
    random = np.random.default_rng(count)
    points = random.random((400, 3))
    part = np.concatenate([np.arange(count), random.integers(0, count, 400 - count)])
    pairs, squares = spanning_tree(points, part, count)
    D = cdist(points, points)
    between = np.array([[D[np.ix_(part == a, part == b)].min() if a != b else 0 for a in range(count)]
                        for b in range(count)])  # fmt: skip
    assert np.sqrt(squares).sum() == pytest.approx(minimum_spanning_tree(between).sum())
    np.testing.assert_allclose(np.sqrt(squares), D[pairs[:, 0], pairs[:, 1]])
    assert np.linalg.matrix_rank(np.eye(count)[part[pairs[:, 0]]] - np.eye(count)[part[pairs[:, 1]]]) == count - 1


def test_the_tree_of_points_at_one_place_and_in_one_plane() -> None:
    points = np.zeros((90, 3))
    points[30:, :2] = np.random.default_rng(0).integers(0, 3, (60, 2))
    pairs, squares = spanning_tree(points, np.arange(90) % 30, 30)
    assert len(pairs) == 29 and (squares == 0).all()


def test_points_that_touch_are_those_within_reach_of_another_part() -> None:
    random = np.random.default_rng(1)
    points, part = random.random((500, 3)), random.integers(0, 5, 500)
    D = np.where(part[:, None] == part, np.inf, cdist(points, points))
    expected = np.flatnonzero(D.min(axis=1) < 0.1)
    found = touching(points, part, 0.1)
    np.testing.assert_array_equal(found[:, 0], expected)
    np.testing.assert_array_equal(found[:, 1], D.argmin(axis=1)[expected])


def test_a_gap_is_found_where_no_vertex_is_near() -> None:
    # A leg under the middle of a board of two triangles.
    board = Mesh(np.array([[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0.0]]), [[0, 1, 2], [0, 2, 3]])
    leg = moved(cube(), (4, 7, -0.8))
    found = parts(joined(board, leg))
    linked = links(found)
    assert linked.gaps.min() == pytest.approx(0.3, abs=linked.spacing)
    ends = points_of(found, linked)
    assert (found.labels[linked.faces[:, 0]] != found.labels[linked.faces[:, 1]]).all()
    assert np.abs(ends[..., :2] - [4, 7]).max() < 0.5 + 2 * linked.spacing
    np.testing.assert_allclose(linked.gaps, np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1))
    assert not linked.touch.any()


def test_links_lead_to_every_part_however_small_and_wherever_it_touches() -> None:
    triangle = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), [[0, 1, 2]])
    fans = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0.0]]), [[0, 1, 2], [0, 3, 4]])
    mesh = joined(icosphere(3), moved(triangle, (5, 0, 0), scale=1e-3), moved(fans, (-5, 0, 0)), grid(3, 3))
    found = parts(permuted(mesh)[0])
    reached = found.labels[links(found).faces]
    assert set(reached.ravel().tolist()) == set(range(len(found))) == set(range(5))
