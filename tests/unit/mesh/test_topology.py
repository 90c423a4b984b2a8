from __future__ import annotations

import numpy as np
import pytest

from reebase.errors import NoFaces
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import edges, largest_component, rings
from tests.shapes import (
    cube,
    cylinder,
    flipped,
    grid,
    icosphere,
    joined,
    moebius,
    moved,
    permuted,
    tetrahedron,
    torus,
    voxels,
)

CLOSED = {"tetrahedron": tetrahedron(), "cube": cube(), "sphere": icosphere(2), "torus": torus(nu=12, nv=8)}


def slow_edges(faces: np.ndarray) -> dict[tuple[int, int], list[int]]:
    """Ends of each edge -> its sides, by a dictionary."""
    found: dict[tuple[int, int], list[int]] = {}
    for f, face in enumerate(faces.tolist()):
        for k in range(3):
            a, b = face[k], face[(k + 1) % 3]
            found.setdefault((min(a, b), max(a, b)), []).append(3 * f + k)
    return dict(sorted(found.items()))


def some_faces(seed: int) -> np.ndarray:
    """Random triangles on few vertices: edges with many faces, repeated corners, duplicates."""
    return np.random.default_rng(seed).integers(0, 9, size=(40, 3))


@pytest.mark.parametrize("seed", range(5))
def test_edges_equal_a_dictionary_of_sides(seed: int) -> None:
    faces = some_faces(seed)
    expected = slow_edges(faces)
    found = edges(faces)
    assert [tuple(pair) for pair in found.vertices.tolist()] == list(expected)
    for e, sides in enumerate(expected.values()):
        assert found.sides[found.starts[e] : found.starts[e + 1]].tolist() == sides
        assert (found.of_side[sides] == e).all()
    start = faces.ravel()
    assert (found.forward == (start <= np.roll(faces, -1, axis=1).ravel())).all()
    assert (found.face_counts == [len(sides) for sides in expected.values()]).all()


@pytest.mark.parametrize("seed", range(5))
def test_rings_equal_sets(seed: int) -> None:
    faces = some_faces(seed)
    around = rings(faces, 11)
    for v in range(11):
        expected = {int(a) for face in faces if v in face for a in face} - {v}
        row = slice(around.neighbour_starts[v], around.neighbour_starts[v + 1])
        assert sorted(around.neighbours[row].tolist()) == sorted(expected)
        assert around.degrees[v] == len(expected)
        corners = slice(around.corner_starts[v], around.corner_starts[v + 1])
        turned = [(int(f[(k + 1) % 3]), int(f[(k + 2) % 3])) for f in faces for k in range(3) if f[k] == v]
        assert [tuple(pair) for pair in around.ring[corners].tolist()] == turned


@pytest.mark.parametrize("seed", range(20))
def test_where_a_ring_is_closed_its_neighbours_follow_one_another(seed: int) -> None:
    faces = some_faces(seed)
    if seed % 2:
        faces = np.concatenate([faces, 11 + icosphere(0).faces, [[11, 11, 12], [22, 23, 24], [22, 24, 23]]])
    around = rings(faces, int(faces.max()) + 1)
    for v in range(len(around.degrees)):
        row = around.neighbours[around.neighbour_starts[v] : around.neighbour_starts[v + 1]].tolist()
        ring = around.ring[around.corner_starts[v] : around.corner_starts[v + 1]].tolist()
        assert around.closed[v] == is_one_fan(v, ring)
        if around.closed[v]:
            assert row[0] == ring[0][0]
            assert sorted(zip(row, row[1:] + row[:1], strict=True)) == sorted(map(tuple, ring))


def is_one_fan(v: int, ring: list[list[int]]) -> bool:
    """Whether some order of all of these triangles goes round v once and comes back."""
    if not ring or any(v in pair for pair in ring) or len({start for start, _ in ring}) < len(ring):
        return False
    after = dict(ring)
    seen, here = [], ring[0][0]
    while here in after and here not in seen:
        seen.append(here)
        here = after[here]
    return here == ring[0][0] and len(seen) == len(ring)


@pytest.mark.parametrize("seed", range(5))
def test_triangles_along_edges_equal_a_count(seed: int) -> None:
    faces = some_faces(seed)
    around = rings(faces, 11)
    source = np.repeat(np.arange(11), around.degrees)
    for v, j, found in zip(source, around.neighbours, around.shared, strict=True):
        sides = [(f[k], f[(k + 1) % 3]) for f in faces.tolist() for k in range(3)]
        assert found == sum({v, j} == {a, b} for a, b in sides)


@pytest.mark.parametrize("mesh", CLOSED.values(), ids=CLOSED)
def test_a_closed_manifold_has_two_faces_along_each_edge(mesh: Mesh) -> None:
    found = edges(mesh.faces)
    assert (found.face_counts == 2).all()
    assert 2 * len(found) == 3 * len(mesh.faces)
    assert found.oriented
    assert found.balanced.all()
    assert found.components[0] == 1
    assert found.fans[0] == len(mesh.vertices)
    assert found.boundary_loops == 0
    around = rings(mesh.faces, len(mesh.vertices))
    assert (around.shared == 2).all()
    assert around.closed.all()


@pytest.mark.parametrize(
    ("mesh", "euler", "loops"),
    [(grid(4, 3), 1, 1), (cylinder(), 0, 2), (moebius(), 0, 1), (torus(), 0, 0), (icosphere(1), 2, 0)],
    ids=["grid", "cylinder", "moebius", "torus", "sphere"],
)
def test_euler_characteristic_and_boundary_loops(mesh: Mesh, euler: int, loops: int) -> None:
    found = edges(mesh.faces)
    assert len(mesh.vertices) - len(found) + len(mesh.faces) == euler
    assert found.boundary_loops == loops


def test_only_the_moebius_strip_is_not_oriented() -> None:
    assert not edges(moebius().faces).oriented
    assert not edges(flipped(torus(), [5]).faces).oriented


def test_two_triangles_that_touch_at_a_vertex_are_two_components_two_fans_and_two_loops() -> None:
    found = edges([[0, 1, 2], [0, 3, 4]])
    assert found.components[0] == 2
    assert found.fans[0] == 6  # vertex 0 twice
    assert found.boundary_loops == 2


def test_three_faces_on_one_edge_are_one_component() -> None:
    found = edges([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert found.components[0] == 1
    assert found.non_manifold.tolist() == [0]
    assert len(found.boundary) == 6
    assert found.fans[0] == 5


def test_components_are_numbered_by_their_first_face() -> None:
    mesh = joined(tetrahedron(), cube(), tetrahedron())
    count, labels = edges(mesh.faces).components
    assert count == 3
    assert labels.tolist() == [0] * 4 + [1] * 12 + [2] * 4


def test_components_do_not_depend_on_order() -> None:
    mesh = joined(torus(nu=9, nv=5), icosphere(1), grid(3, 3))
    shuffled, order = permuted(mesh, seed=3)
    count, labels = edges(shuffled.faces).components
    assert count == 3
    part_of = np.repeat([0, 1, 2], [45, 42, 16])[order]
    assert len({(part_of[face[0]], label) for face, label in zip(shuffled.faces, labels, strict=True)}) == 3


def test_no_faces_have_no_edges() -> None:
    found = edges(np.zeros((0, 3), dtype=int))
    assert len(found) == 0
    assert found.components[0] == 0
    assert found.boundary_loops == 0
    assert rings(np.zeros((0, 3), dtype=int), 4).degrees.tolist() == [0] * 4


def test_the_boundary_curve_of_a_grid_is_its_rim() -> None:
    mesh = grid(3, 2, 3.0, 2.0)
    vertices, along = rings(mesh.faces, len(mesh.vertices)).boundary_curve
    x, y, _ = mesh.vertices.T
    rim = np.flatnonzero((x == 0) | (x == 3) | (y == 0) | (y == 2))
    assert vertices.tolist() == rim.tolist()
    for v, (one, other) in zip(vertices, along, strict=True):
        assert one != other
        for neighbour in (one, other):
            assert neighbour in rim
            assert np.linalg.norm(mesh.vertices[v] - mesh.vertices[neighbour]) == pytest.approx(1)


def test_where_two_boundaries_touch_there_is_no_one_curve() -> None:
    vertices, along = rings([[0, 1, 2], [0, 3, 4]], 5).boundary_curve
    assert vertices.tolist() == [0, 1, 2, 3, 4]
    assert along[0].tolist() == [0, 0]
    assert sorted(along[1].tolist()) == [0, 2]


def test_the_largest_component_is_the_one_with_the_largest_area() -> None:
    small, large = icosphere(2), cube(5.0)
    mesh = joined(small, large)
    part, index = largest_component(mesh)
    assert index.tolist() == list(range(len(small.vertices), len(mesh.vertices)))
    assert (part.vertices == large.vertices).all()
    assert (part.faces == large.faces).all()
    assert (mesh.vertices[index] == part.vertices).all()


def test_of_equal_components_the_first_is_the_largest() -> None:
    _, index = largest_component(joined(cube(), moved(cube(), (4, 0, 0))))
    assert index.tolist() == list(range(8))


def test_a_part_that_touches_at_a_vertex_is_left_out() -> None:
    big = cube(2.0)
    corner = int(np.flatnonzero((big.vertices == 1).all(axis=1))[0])
    vertices = np.concatenate([big.vertices, [[2, 1, 1], [1, 2, 1], [1, 1, 2]]])
    cone = np.array([[corner, 8, 9], [corner, 9, 10], [corner, 10, 8], [8, 10, 9]])
    part, index = largest_component(Mesh(vertices, np.concatenate([cone, big.faces])))
    assert index.tolist() == list(range(8))
    assert (part.faces == big.faces).all()


def test_the_largest_component_of_one_drops_what_no_face_uses() -> None:
    mesh = Mesh(np.concatenate([np.full((2, 3), np.nan), cube().vertices]), cube().faces + 2)
    part, index = largest_component(mesh)
    assert index.tolist() == list(range(2, 10))
    assert (part.faces == cube().faces).all()


def test_the_largest_component_of_nothing_is_refused() -> None:
    with pytest.raises(NoFaces):
        largest_component(Mesh(np.zeros((3, 3)), np.zeros((0, 3), dtype=int)))


def test_genus_of_a_frame() -> None:
    holes = np.ones((7, 3, 1), dtype=bool)
    holes[1, 1] = holes[3, 1] = holes[5, 1] = False
    mesh = voxels(holes)
    euler = len(mesh.vertices) - len(edges(mesh.faces)) + len(mesh.faces)
    assert euler == 2 - 2 * 3
