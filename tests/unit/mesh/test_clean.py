from __future__ import annotations

import itertools

import numpy as np
import pytest

from reebase.errors import DegenerateMesh, MeshError, NoFaces, NonFiniteVertices, ParameterError
from reebase.mesh.clean import clean
from reebase.mesh.geometry import signed_volume
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read
from reebase.mesh.topology import edges
from tests.shapes import (
    capsule,
    cube,
    cylinder,
    flipped,
    grid,
    icosphere,
    joined,
    moebius,
    moved,
    permuted,
    soup,
    tetrahedron,
    torus,
    uv_sphere,
    voxels,
)

SHAPES = {
    "tetrahedron": tetrahedron(), "cube": cube(), "sphere": icosphere(2), "uv_sphere": uv_sphere(),
    "capsule": capsule(), "torus": torus(), "grid": grid(4, 5), "cylinder": cylinder(),
}  # fmt: skip


def same(one: Mesh, other: Mesh) -> bool:
    return np.array_equal(one.vertices, other.vertices) and np.array_equal(one.faces, other.faces)


def triangles(mesh: Mesh) -> list[list[list[float]]]:
    """The oriented triangles as coordinates, in an order of their own."""
    found = []
    for corners in mesh.vertices[mesh.faces].tolist():
        least = corners.index(min(corners))
        found.append(corners[least:] + corners[:least])
    return sorted(found)


@pytest.mark.parametrize("mesh", SHAPES.values(), ids=SHAPES)
def test_a_clean_mesh_stays_as_it_is(mesh: Mesh) -> None:
    cleaned, health = clean(mesh)
    assert same(cleaned, mesh)
    assert health.repairs == {}
    assert (health.vertices_read, health.faces_read) == (len(mesh.vertices), len(mesh.faces))
    assert health.oriented


@pytest.mark.parametrize("mesh", SHAPES.values(), ids=SHAPES)
def test_cleaning_twice_is_cleaning_once(mesh: Mesh) -> None:
    once, _ = clean(soup(flipped(mesh, range(0, len(mesh.faces), 3))))
    twice, health = clean(once)
    assert same(once, twice)
    assert health.repairs == {}


@pytest.mark.parametrize("mesh", SHAPES.values(), ids=SHAPES)
def test_a_soup_is_merged_back(mesh: Mesh) -> None:
    cleaned, health = clean(soup(mesh))
    assert len(cleaned.vertices) == len(mesh.vertices)
    assert triangles(cleaned) == triangles(mesh)
    assert health.repairs == {"merged_vertices": 3 * len(mesh.faces) - len(mesh.vertices)}


@pytest.mark.parametrize("mesh", SHAPES.values(), ids=SHAPES)
@pytest.mark.parametrize("seed", range(2))
def test_any_orientation_is_made_consistent_and_outward(mesh: Mesh, seed: int) -> None:
    minority = np.flatnonzero(np.random.default_rng(seed).random(len(mesh.faces)) < 0.3)
    cleaned, health = clean(flipped(mesh, minority))
    assert same(cleaned, mesh)
    assert health.repairs == ({"reoriented_faces": len(minority)} if len(minority) else {})


def test_closed_parts_face_outward_and_open_parts_keep_what_most_of_their_faces_say() -> None:
    mesh = joined(flipped(cube()), flipped(grid(2, 2)), torus(), flipped(moved(cube(), (9, 0, 0))))
    cleaned, health = clean(mesh)
    assert health.repairs == {"reoriented_faces": 24}
    assert health.components == 4
    assert cleaned.faces[12:20].tolist() == mesh.faces[12:20].tolist()
    assert signed_volume(Mesh(cleaned.vertices, cleaned.faces[:12])) == pytest.approx(1)


def test_health_of_a_cube() -> None:
    _, health = clean(cube(2.0))
    assert (health.vertices, health.edges, health.faces) == (8, 18, 12)
    assert (health.components, health.boundary_edges, health.boundary_loops) == (1, 0, 0)
    assert (health.non_manifold_edges, health.non_manifold_vertices) == (0, 0)
    assert (health.euler_characteristic, health.genus, health.closed, health.oriented) == (2, 0, True, True)
    assert health.area == pytest.approx(24)
    assert health.volume == pytest.approx(8)
    assert health.mean_edge_length == pytest.approx((12 * 2 + 6 * np.sqrt(8)) / 18)
    assert health.largest_component_share == 1
    assert health.flags == ()


@pytest.mark.parametrize("holes", [1, 2, 3])
def test_genus_of_a_block_with_holes(holes: int) -> None:
    block = np.ones((2 * holes + 1, 3, 1), dtype=bool)
    block[1::2, 1] = False
    _, health = clean(soup(voxels(block)))
    assert health.genus == holes
    assert health.volume == pytest.approx(block.sum())


def test_genus_of_several_parts_adds_up() -> None:
    _, health = clean(joined(torus(), moved(torus(), (9, 0, 0)), moved(cube(), (0, 9, 0))))
    assert (health.components, health.genus) == (3, 2)
    assert health.flags == ("several_components",)
    assert health.largest_component_share == pytest.approx(health.area**-1 * (health.area - 6) / 2)


def test_an_open_surface_is_flagged_and_has_no_volume() -> None:
    _, health = clean(cylinder())
    assert (health.closed, health.volume, health.genus) == (False, None, None)
    assert (health.boundary_loops, health.boundary_edges) == (2, 48)
    assert health.flags == ("open_surface",)


def test_a_moebius_strip_is_not_oriented_and_stays_as_read() -> None:
    cleaned, health = clean(moebius())
    assert same(cleaned, moebius())
    assert not health.oriented
    assert "non_manifold" in health.flags
    assert health.genus is None
    assert health.boundary_loops == 1


def test_a_klein_bottle_is_closed_and_has_no_volume() -> None:
    nu, nv = 12, 8
    i, j = np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij")
    here, up = i * nv + j, i * nv + (j + 1) % nv
    turn = i == nu - 1
    right = np.where(turn, (-j) % nv, (i + 1) * nv + j)
    across = np.where(turn, (-j - 1) % nv, (i + 1) * nv + (j + 1) % nv)
    faces = np.stack([here, right, across, here, across, up], axis=-1).reshape(-1, 3)
    mesh = Mesh(np.random.default_rng(0).standard_normal((nu * nv, 3)), faces)
    cleaned, health = clean(mesh)
    assert (health.closed, health.oriented, health.volume, health.genus) == (True, False, None, None)
    assert health.euler_characteristic == 0
    assert same(cleaned, mesh)


def test_repeated_corners_duplicates_and_unused_vertices_go_and_are_counted() -> None:
    base = cube()
    vertices = np.concatenate([[[7.0, 7, 7]], base.vertices, [[np.nan, 0, 0], [np.inf, 0, 0]]])
    extra = [[1, 1, 2], [3, 3, 3], (base.faces[0] + 1).tolist(), (base.faces[5] + 1)[::-1].tolist()]
    cleaned, health = clean(Mesh(vertices, np.concatenate([extra[:2], base.faces + 1, extra[2:]])))
    assert same(cleaned, base)
    assert health.repairs == {
        "removed_unreferenced_vertices": 3, "removed_degenerate_faces": 2, "removed_duplicate_faces": 2,
    }  # fmt: skip
    assert (health.vertices_read, health.faces_read) == (11, 16)


def test_negative_zero_is_zero() -> None:
    mesh = soup(grid(2, 2))
    vertices = mesh.vertices.copy()
    vertices[::2][vertices[::2] == 0] = -0.0
    assert clean(Mesh(vertices, mesh.faces))[0].vertices.shape == (9, 3)


def test_vertices_that_stay_keep_their_order() -> None:
    mesh = permuted(torus(), seed=4)[0]
    doubled = Mesh(np.repeat(mesh.vertices, 2, axis=0), 2 * mesh.faces + np.arange(3) % 2)
    cleaned, health = clean(doubled)
    assert np.array_equal(cleaned.vertices, mesh.vertices)
    assert np.array_equal(cleaned.faces, mesh.faces)
    assert sum(health.repairs.values()) == len(mesh.vertices)


@pytest.mark.parametrize("scale", [1e-60, 1e-12, 1.0, 1e12, 1e60])
def test_nothing_depends_on_the_unit(scale: float) -> None:
    mesh = joined(soup(flipped(torus(), range(0, 500, 2))), moved(cube(), (5, 0, 0)))
    _, expected = clean(mesh)
    _, found = clean(moved(mesh, scale=scale))
    assert found.repairs == expected.repairs
    assert (found.genus, found.vertices, found.flags) == (expected.genus, expected.vertices, expected.flags)
    assert found.area == pytest.approx(expected.area * scale**2)
    assert found.volume == pytest.approx(expected.volume * scale**3)
    assert found.mean_edge_length == pytest.approx(expected.mean_edge_length * scale)


@pytest.mark.parametrize("offset", [1e3, 1e6, 1e9])
def test_nothing_depends_on_the_place(offset: float) -> None:
    mesh = moved(torus(), (offset, -offset, offset))
    _, health = clean(soup(flipped(mesh)))
    assert health.repairs["reoriented_faces"] == len(mesh.faces)
    assert (health.genus, health.components, health.closed) == (1, 1, True)
    assert health.area == pytest.approx(clean(torus())[1].area, rel=1e-14 * offset)
    assert health.volume == pytest.approx(clean(torus())[1].volume, rel=1e-14 * offset)


def test_bodies_of_different_size_far_apart_are_all_outward() -> None:
    small = flipped(icosphere(1, radius=1e-4))
    cleaned, health = clean(joined(cube(), moved(small, (1000, 1000, 1000)), moved(small, (-1000, 0, 0))))
    assert health.repairs == {"reoriented_faces": 160}
    assert signed_volume(Mesh(cleaned.vertices, cleaned.faces[12:92])) > 0


def test_two_cubes_that_share_an_edge() -> None:
    cells = np.zeros((2, 2, 1), dtype=bool)
    cells[0, 0] = cells[1, 1] = True
    _, health = clean(soup(flipped(voxels(cells))))
    assert (health.non_manifold_edges, health.components, health.genus) == (1, 1, None)
    assert health.closed
    assert health.oriented
    assert health.volume == pytest.approx(2)
    assert health.flags == ("non_manifold",)


def test_two_cubes_that_share_a_corner_stay_joined_there_and_are_two_components() -> None:
    cells = np.zeros((2, 2, 2), dtype=bool)
    cells[0, 0, 0] = cells[1, 1, 1] = True
    cleaned, health = clean(soup(voxels(cells)))
    assert len(cleaned.vertices) == 15
    assert (health.non_manifold_vertices, health.non_manifold_edges, health.components) == (1, 0, 2)
    assert health.volume == pytest.approx(2)
    assert health.genus is None


def test_a_double_sided_sheet_becomes_one_sheet() -> None:
    sheet = grid(3, 3)
    cleaned, health = clean(joined(sheet, flipped(sheet)))
    assert same(cleaned, sheet)
    assert health.repairs == {"merged_vertices": 16, "removed_duplicate_faces": 18}


def with_fin(mesh: Mesh, size: float, times: int = 2) -> Mesh:
    """The mesh with a triangle, so many times, that stands on the first side of its first face."""
    a, b, _ = mesh.faces[0].tolist()
    tip = mesh.vertices[[a, b]].mean(axis=0) * (1 + size)
    sides = [[a, b, len(mesh.vertices)], [b, a, len(mesh.vertices)]]
    return Mesh(np.concatenate([mesh.vertices, [tip]]), np.concatenate([mesh.faces, (2 * sides)[:times]]))


def test_a_small_fin_goes_as_a_whole_so_that_the_surface_is_closed() -> None:
    cleaned, health = clean(with_fin(icosphere(2), 0.05))
    assert same(cleaned, icosphere(2))
    assert health.repairs == {"removed_fin_faces": 2, "removed_unreferenced_vertices": 1}


@pytest.mark.parametrize(
    ("mesh", "duplicates"),
    [(with_fin(icosphere(2), 2.0), 1), (with_fin(icosphere(2), 0.05, times=3), 2)],
    ids=["large", "odd"],
)
def test_what_may_be_more_than_a_fin_keeps_one_of_its_faces(mesh: Mesh, duplicates: int) -> None:
    _, health = clean(mesh)
    assert health.repairs == {"removed_duplicate_faces": duplicates}
    assert (health.non_manifold_edges, health.boundary_edges) == (1, 2)


def test_a_fin_that_alone_joins_two_parts_stays_once() -> None:
    one, other = cube(10.0), moved(cube(10.0), (10.1, 0, 0))
    a, b = 1, 3  # an upright edge of the first, x = 5, and the corner of the second beside it
    fin = [[a, b, 8], [b, a, 8], [b, 10, 8], [8, 10, b]]
    mesh = joined(one, other)
    _, health = clean(Mesh(mesh.vertices, np.concatenate([mesh.faces, fin])))
    assert health.components == 1
    assert health.repairs == {"removed_duplicate_faces": 2}


def test_a_doubled_face_that_fills_a_hole_stays_once() -> None:
    mesh = icosphere(3)
    cleaned, health = clean(Mesh(mesh.vertices, np.concatenate([mesh.faces, mesh.faces[7:8, ::-1]])))
    assert same(cleaned, mesh)
    assert health.repairs == {"removed_duplicate_faces": 1}


def with_cap(mesh: Mesh) -> Mesh:
    """The mesh with face 0 = (a, b, c) cut in two at the middle d of ab, and a flat face (a, b, d) there."""
    a, b, c = mesh.faces[0].tolist()
    middle = (mesh.vertices[a] + mesh.vertices[b]) / 2
    d = len(mesh.vertices)
    halves = [[a, d, c], [d, b, c], [a, b, d]]
    return Mesh(np.concatenate([mesh.vertices, [middle]]), np.concatenate([halves, mesh.faces[1:]]))


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
@pytest.mark.parametrize("seed", range(3))
def test_a_flat_face_is_flipped_away_and_the_surface_stays_closed(seed: int, scale: float) -> None:
    mesh = moved(with_cap(icosphere(1)), (0.3, 0.1, 0.2), seed=seed)
    cleaned, health = clean(Mesh(scale * mesh.vertices, mesh.faces))
    assert health.repairs == {"flipped_edges": 1}
    assert (health.closed, health.oriented, health.genus) == (True, True, 0)
    assert health.volume == pytest.approx(clean(icosphere(1))[1].volume * scale**3)
    assert len(cleaned.faces) == len(mesh.faces)


def test_a_row_of_flat_faces_is_flipped_away() -> None:
    """One side of a tetrahedron is cut at nine places; a fan of flat faces closes the gap beside it."""
    base = tetrahedron()
    a, b, c = base.faces[0].tolist()
    share = np.linspace(0, 1, 11)[1:-1, None]
    vertices = np.concatenate([base.vertices, base.vertices[a] * (1 - share) + base.vertices[b] * share])
    path = [a, *range(4, 13), b]
    fan = [[p, q, c] for p, q in itertools.pairwise(path)]
    flat = [[q, p, b] for p, q in itertools.pairwise(path[:-1])]
    mesh = Mesh(vertices, np.concatenate([fan, flat, base.faces[1:]]))
    assert len(edges(mesh.faces).boundary) == 0
    _, health = clean(mesh)
    assert (health.closed, health.genus) == (True, 0)
    assert health.volume == pytest.approx(8 / 3)
    assert "removed_degenerate_faces" not in health.repairs


def test_a_needle_is_closed_by_merging_its_ends() -> None:
    """An edge of a sphere is split by a vertex within rounding of one end."""
    mesh = icosphere(1)
    a, b, c = mesh.faces[0].tolist()
    d = len(mesh.vertices)
    near = mesh.vertices[a] + 2e-16 * (mesh.vertices[b] - mesh.vertices[a])
    near = np.where(near == mesh.vertices[a], np.nextafter(near, 2.0), near)
    pairs = edges(mesh.faces)
    e = int(np.flatnonzero((pairs.vertices == sorted((a, b))).all(axis=1))[0])
    sides = pairs.sides[pairs.starts[e] : pairs.starts[e + 1]]
    other = int(sides[sides // 3 != 0][0])
    face = mesh.faces[other // 3].tolist()
    o = next(v for v in face if v not in (a, b))
    rest = np.delete(mesh.faces, [0, other // 3], axis=0)
    split = [[a, d, c], [d, b, c], [b, d, o], [d, a, o]]
    _, health = clean(Mesh(np.concatenate([mesh.vertices, [near]]), np.concatenate([split, rest])))
    assert (health.closed, health.genus, health.vertices) == (True, 0, 42)
    assert health.repairs["collapsed_edges"] == 1


def test_a_flat_face_alone_is_dropped() -> None:
    line = [[5.0, 0, 0], [6, 0, 0], [7, 0, 0]]
    faces = np.concatenate([cube().faces, [[8, 9, 10]]])
    cleaned, health = clean(Mesh(np.concatenate([cube().vertices, line]), faces))
    assert same(cleaned, cube())
    assert health.repairs == {"removed_degenerate_faces": 1, "removed_unreferenced_vertices": 3}


def test_a_thin_triangle_with_area_stays() -> None:
    mesh = Mesh(np.array([[0, 0, 0], [1, 0, 0], [0.5, 1e-9, 0]]), np.array([[0, 1, 2]]))
    cleaned, health = clean(mesh)
    assert same(cleaned, mesh)
    assert health.area == pytest.approx(5e-10)


def test_vertices_within_the_tolerance_are_merged() -> None:
    random = np.random.default_rng(0)
    mesh = soup(cube())
    shaken = Mesh(mesh.vertices + random.uniform(-1e-6, 1e-6, mesh.vertices.shape), mesh.faces)
    assert clean(shaken)[1].components == 12
    cleaned, health = clean(shaken, merge_tolerance=1e-5)
    assert (health.components, health.closed, health.vertices) == (1, True, 8)
    assert health.repairs == {"merged_vertices": 28}
    assert {tuple(v) for v in cleaned.vertices.tolist()} <= {tuple(v) for v in shaken.vertices.tolist()}


def test_kept_vertices_are_farther_apart_than_the_tolerance() -> None:
    mesh = icosphere(3)
    cleaned, _ = clean(mesh, merge_tolerance=0.05)
    kept = cleaned.vertices
    gaps = np.linalg.norm(kept[:, None] - kept, axis=2) + 9 * np.eye(len(kept))
    width = 0.05 * np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    assert gaps.min() > width * (1 - 1e-12)
    moves = np.linalg.norm(mesh.vertices[:, None] - kept, axis=2).min(axis=1)
    assert moves.max() <= width * (1 + 1e-12)


def test_a_long_fan_takes_no_quadratic_time() -> None:
    """100,000 triangles round one vertex, and as many flat ones along one side."""
    count = 100_000
    angle = np.linspace(0, 6, count + 1)
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(count + 1)], axis=1)
    line = np.stack([np.linspace(5, 6, count + 1), np.zeros(count + 1), np.zeros(count + 1)], axis=1)
    fan = np.stack([np.zeros(count, dtype=int), np.arange(1, count + 1), np.arange(2, count + 2)], axis=1)
    flat = np.stack([np.full(count, 1), np.arange(count) + count + 2, np.arange(count) + count + 3], axis=1)
    mesh = Mesh(np.concatenate([[[0, 0, 0]], rim, line]), np.concatenate([fan, flat]))
    _, health = clean(mesh)
    assert health.faces == count


@pytest.mark.parametrize("tolerance", [-1e-3, 0.2, float("nan"), 1e-20])
def test_a_wrong_tolerance_is_refused(tolerance: float) -> None:
    with pytest.raises(ParameterError, match="merge_tolerance"):
        clean(cube(), merge_tolerance=tolerance)


def test_no_faces_are_refused() -> None:
    with pytest.raises(NoFaces):
        clean(Mesh(np.zeros((4, 3)), np.zeros((0, 3), dtype=int)))


@pytest.mark.parametrize(
    "vertices",
    [np.zeros((3, 3)), [[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0.1, 0, 0], [0.2, 0, 0], [0.3, 0, 0]]],
    ids=["one point", "diagonal", "line"],
)
def test_no_area_is_refused_with_the_counts(vertices: list[list[float]]) -> None:
    with pytest.raises(DegenerateMesh) as refusal:
        clean(Mesh(np.array(vertices), np.array([[0, 1, 2], [2, 1, 0]])))
    assert refusal.value.details["faces_read"] == 2
    assert refusal.value.details["repairs"]["removed_degenerate_faces"] >= 1


@pytest.mark.parametrize("scale", [1e-200, 1e-80, 1e80, 1e200])
def test_an_extent_that_cannot_be_squared_is_refused(scale: float) -> None:
    with pytest.raises(MeshError, match="Rescale"):
        clean(moved(cube(), scale=scale))


def test_a_mesh_refuses_only_the_nan_that_a_face_uses() -> None:
    vertices = cube().vertices.copy()
    vertices[3, 1] = np.nan
    with pytest.raises(NonFiniteVertices, match="vertex 3"):
        Mesh(vertices, cube().faces)


def test_a_file_whose_only_nan_is_in_an_unused_vertex_is_read_and_cleaned() -> None:
    mesh = read(b"v 0 0 0\nv nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 3 4\n", "obj")
    cleaned, health = clean(mesh)
    assert cleaned.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert health.repairs == {"removed_unreferenced_vertices": 1}
