"""The Reeb graph: equal to straight loops, exact in area, right in topology, even in the field."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from reebase import skeleton
from reebase.errors import DegenerateMesh, LimitError, MeshError, NoFaces, ParameterError
from reebase.mesh.mesh import Mesh
from reebase.skeleton import MAX_BANDS, Skeleton, reeb_graph, reeb_nodes
from reebase.spectrum import eigenpairs, operator
from tests.oracles import reeb as oracle
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
    tetrahedron,
    torus,
    uv_sphere,
    voxels,
)


def face_areas(mesh):
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def area(mesh):
    return face_areas(mesh).sum()


def shuffled(mesh, values, seed):
    other, order = permuted(mesh, seed)
    return other, values[order]


def double_torus():
    filled = np.ones((5, 3, 2), dtype=bool)
    filled[1, 1] = filled[3, 1] = False
    return voxels(filled)


def direction(mesh, seed=0):
    """A height in a direction in which no two vertices tie."""
    return mesh.vertices @ np.random.default_rng(seed).standard_normal(3)


def same_graph(first: Skeleton, second: Skeleton, *, tolerance=1e-10):
    """Equal up to the numbering of nodes."""
    nodes = list(zip(second.bands, second.areas, second.positions, second.ring_areas, strict=True))
    equal_to_nodes(first, nodes, {tuple(e) for e in second.edges.tolist()}, tolerance)


def equal_to_nodes(skeleton, nodes, edges, tolerance=1e-10):
    assert len(skeleton.areas) == len(nodes)
    scale = max(1.0, float(np.abs(skeleton.positions).max()))
    partner = {}
    for n, (band, node_area, position, ring) in enumerate(nodes):
        gap = np.linalg.norm(skeleton.positions - position, axis=1) / scale
        gap += np.abs(skeleton.areas - node_area) / skeleton.areas.sum() + np.abs(skeleton.ring_areas - ring)
        gap[skeleton.bands != band] = np.inf
        near = [int(i) for i in np.flatnonzero(gap < tolerance) if i not in partner.values()]
        assert near, f"no node like {n} in band {band}"
        partner[n] = near[0]
    assert {tuple(sorted((partner[a], partner[b]))) for a, b in edges} == {
        tuple(sorted(e)) for e in skeleton.edges.tolist()
    }


SURFACES = {
    "tetrahedron": tetrahedron(), "cube": moved(cube(), seed=1), "sphere": icosphere(2),
    "torus": torus(nu=12, nv=8), "double torus": moved(double_torus(), seed=2),
    "rectangle": grid(5, 4), "tube": cylinder(nu=8, along=5), "moebius": moebius(nu=16, nv=3),
    "poles": uv_sphere(9, 6),
}  # fmt: skip


@pytest.mark.parametrize("bands", [2, 5, 16])
@pytest.mark.parametrize("name", SURFACES)
def test_equals_the_straight_loops_on_a_rough_field(name, bands):
    mesh = SURFACES[name]
    values = np.random.default_rng(bands).standard_normal(len(mesh.vertices))
    equal_to_nodes(reeb_graph(mesh, values, bands), *oracle.reeb_graph(mesh, values.tolist(), bands))


@pytest.mark.parametrize("bands", [2, 3, 4, 6])
@pytest.mark.parametrize("name", SURFACES)
def test_equals_the_straight_loops_when_vertices_edges_and_faces_lie_on_levels(name, bands):
    mesh = moved(SURFACES[name], seed=7)
    values = np.random.default_rng(bands).integers(0, 4, len(mesh.vertices)).astype(float)
    values[:2] = 0, 3
    for sign in (1, -1):
        graph = reeb_graph(mesh, sign * values, bands)
        equal_to_nodes(graph, *oracle.reeb_graph(mesh, (sign * values).tolist(), bands))


@pytest.mark.parametrize("seed", range(40))
def test_equals_the_straight_loops_on_random_complexes(seed):
    """Faces put together at random: edges with many faces, sheets that pass through each other."""
    random = np.random.default_rng(seed)
    faces = {tuple(sorted(random.choice(9, 3, replace=False))) for _ in range(random.integers(12, 40))}
    mesh = Mesh(random.standard_normal((9, 3)), np.array(sorted(faces)))
    values = random.integers(0, 4, 9).astype(float) if seed % 2 else random.standard_normal(9)
    values[0], values[8] = values.min() - 1, values.max() + 1
    used, index = np.unique(mesh.faces, return_inverse=True)
    mesh, values = Mesh(mesh.vertices[used], index.reshape(-1, 3)), values[used]
    nodes, edges = oracle.reeb_graph(mesh, values.tolist(), 4)
    reached, frontier = {0}, [0]
    while frontier:
        node = frontier.pop()
        new = {b for e in edges for a, b in (e, e[::-1]) if a == node} - reached
        reached |= new
        frontier += new
    if len(reached) == len(nodes):  # else it hangs together at vertices, which the loops do not know
        equal_to_nodes(reeb_graph(mesh, values, 4), nodes, edges)
    graph = reeb_graph(mesh, values, 4)
    assert graph.areas.sum() == pytest.approx(area(mesh), rel=1e-12)
    same_graph(reeb_graph(*shuffled(mesh, values, seed), 4), graph)


@pytest.mark.parametrize("bands", [2, 7, 64, MAX_BANDS])
@pytest.mark.parametrize("name", SURFACES)
def test_areas_sum_to_that_of_the_surface_and_centroids_to_its_own(name, bands):
    mesh = SURFACES[name]
    graph = reeb_graph(mesh, direction(mesh), bands)
    each = face_areas(mesh)
    centroid = (each[:, None] * mesh.vertices[mesh.faces].mean(axis=1)).sum(axis=0) / each.sum()
    assert graph.areas.sum() == pytest.approx(each.sum(), rel=1e-12)
    np.testing.assert_allclose(graph.centroid, centroid, atol=1e-12)
    nearest = np.linalg.norm(graph.positions - centroid, axis=1)
    assert nearest[graph.root] == pytest.approx(nearest.min(), rel=1e-12)
    assert len(graph.edges) - len(graph.areas) + 1 == graph.cycles >= 0
    np.testing.assert_array_equal(np.abs(np.diff(graph.bands[graph.edges], axis=1)), 1)
    ends = graph.positions[graph.edges]
    np.testing.assert_allclose(graph.lengths, np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1))


def test_bands_of_a_rectangle_are_rectangles():
    mesh = grid(7, 3, width=2.0, height=0.5)
    graph = reeb_graph(mesh, mesh.vertices[:, 0], 10)
    np.testing.assert_allclose(graph.areas, 0.1, rtol=1e-12)
    expected = np.stack([np.arange(10) * 0.2 + 0.1, np.full(10, 0.25), np.zeros(10)], axis=1)
    np.testing.assert_allclose(graph.positions, expected, atol=1e-14)
    np.testing.assert_array_equal(graph.edges, [[i, i + 1] for i in range(9)])


def test_bands_of_a_triangle_are_trapezia():
    """One right triangle, x in [0, 1], height 1 - x: what lies between x = a and b is a trapezium."""
    mesh = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    graph = reeb_graph(mesh, mesh.vertices[:, 0], 8)
    a, b = np.arange(8) / 8, np.arange(1, 9) / 8
    areas = (b - a) - (b**2 - a**2) / 2
    np.testing.assert_allclose(graph.areas, areas, rtol=1e-13)
    np.testing.assert_allclose(graph.positions[:, 0], ((b**2 - a**2) / 2 - (b**3 - a**3) / 3) / areas)
    np.testing.assert_allclose(graph.positions[:, 1], ((1 - a) ** 3 - (1 - b) ** 3) / 6 / areas)


def test_zones_of_a_sphere_have_equal_area():
    """Archimedes: the area of a zone depends on its height only."""
    mesh = icosphere(5)
    graph = reeb_graph(mesh, direction(mesh), 16)
    np.testing.assert_allclose(graph.areas, 4 * np.pi / 16, rtol=3e-3)
    assert len(graph.endpoints) == 2 and graph.cycles == 0


def holed(holes):
    """A bar of unit cubes with so many square holes in a row: genus by construction."""
    filled = np.ones((2 * holes + 1, 3, 2), dtype=bool)
    filled[1 : 2 * holes : 2, 1] = False
    return voxels(filled)


@pytest.mark.parametrize("holes", range(6))
def test_cycles_are_the_genus_from_0_to_5(holes):
    mesh = holed(holes)
    assert (len(mesh.vertices) - len(mesh.faces) // 2) == 2 - 2 * holes  # Euler: V - E + F, E = 3F/2
    phi_2 = eigenpairs(operator(mesh)).fiedler
    for values in (phi_2, direction(mesh), direction(mesh, 5)):
        for levels in ("width", "area"):
            assert reeb_graph(mesh, values, 128, levels).cycles == holes
    assert skeleton(mesh).cycles == holes


@pytest.mark.parametrize("bands", [24, 64, 257])
@pytest.mark.parametrize(
    ("mesh", "genus"), [(icosphere(3), 0), (capsule(), 0), (torus(), 1), (double_torus(), 2)], ids="0012"
)
def test_cycles_are_handles(mesh, genus, bands):
    for height in ((1, 0.13, 0.07), (1, 0.5, -0.2), (-1, -0.3, 0.4)):
        assert reeb_graph(mesh, mesh.vertices @ height, bands).cycles == genus


@pytest.mark.parametrize(
    "mesh", [capsule(), cylinder(), grid(20, 3, 4.0, 1.0)], ids=["capsule", "tube", "strip"]
)
def test_what_is_long_has_two_endpoints_at_its_ends(mesh):
    axis = int(np.argmax(np.ptp(mesh.vertices, axis=0)))
    graph = reeb_graph(mesh, mesh.vertices[:, axis], 64)
    assert len(graph.areas) == 64 and graph.cycles == 0
    low, high = mesh.vertices[:, axis].min(), mesh.vertices[:, axis].max()
    np.testing.assert_allclose(
        np.sort(graph.positions[graph.endpoints, axis]), [low, high], atol=(high - low) / 64
    )


@pytest.mark.parametrize("bands", [5, 64])
@pytest.mark.parametrize("name", SURFACES)
def test_invariant_to_order_motion_scale_orientation_and_sign(name, bands):
    mesh = SURFACES[name]
    values = np.random.default_rng(3).standard_normal(len(mesh.vertices))
    graph = reeb_graph(mesh, values, bands)
    same_graph(reeb_graph(*shuffled(mesh, values, 5), bands), graph)
    same_graph(reeb_graph(flipped(mesh), values, bands), graph)
    same_graph(reeb_graph(mesh, 1e-6 * values + 3e-6, bands), graph, tolerance=1e-8)

    turned = reeb_graph(moved(mesh, [1, 2, 3], seed=4), values, bands)
    positions = moved(Mesh(graph.positions, np.empty((0, 3), int)), [1, 2, 3], seed=4).vertices
    nodes = zip(graph.bands, graph.areas, positions, graph.ring_areas, strict=True)
    equal_to_nodes(turned, list(nodes), {tuple(e) for e in graph.edges.tolist()})

    large = reeb_graph(moved(mesh, scale=1e3), values, bands)
    np.testing.assert_allclose(large.areas, 1e6 * graph.areas, rtol=1e-9)
    np.testing.assert_allclose(large.lengths, 1e3 * graph.lengths, rtol=1e-9)

    mirrored = reeb_graph(mesh, -values, bands)
    swapped = [
        (bands - 1 - b, a, p, r)
        for b, a, p, r in zip(graph.bands, graph.areas, graph.positions, graph.ring_areas, strict=True)
    ]
    equal_to_nodes(mirrored, swapped, {tuple(e) for e in graph.edges.tolist()})
    assert mirrored.areas[mirrored.root] == pytest.approx(graph.areas[graph.root])


@pytest.mark.parametrize("name", ["torus", "double torus", "moebius"])
def test_a_finer_tessellation_of_the_same_surface_and_field_changes_nothing(name):
    mesh = SURFACES[name]
    values = direction(mesh)
    edges = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    unique, inverse = np.unique(edges, axis=0, return_inverse=True)
    ab, bc, ca = inverse.reshape(-1, 3).T + len(mesh.vertices)
    a, b, c = mesh.faces.T
    fine = Mesh(
        np.concatenate([mesh.vertices, mesh.vertices[unique].mean(axis=1)]),
        np.concatenate([np.stack(f, axis=1) for f in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))]),
    )
    first = reeb_graph(mesh, values, 32)
    second = reeb_graph(fine, np.concatenate([values, values[unique].mean(axis=1)]), 32)
    # Up to the numbering of nodes with equal areas; the rings of vertices are smaller.
    rings = np.zeros(len(first.areas))
    same_graph(replace(first, ring_areas=rings), replace(second, ring_areas=rings), tolerance=1e-9)


def test_the_extremal_vertex_of_an_endpoint_is_its_tip():
    """Of a tip that points towards the middle of the range, too."""
    mesh = uv_sphere(8, 16)
    values = np.where(mesh.vertices[:, 2] > 0, mesh.vertices[:, 2], -mesh.vertices[:, 2] * 0.5)
    graph = reeb_graph(mesh, values, 32)  # a valley round the equator, a peak of half the height at the south
    rings = np.zeros(len(mesh.vertices))
    np.add.at(rings, mesh.faces.ravel(), np.repeat(face_areas(mesh), 3))
    tips = graph.endpoints[np.argsort(graph.positions[graph.endpoints, 2])]
    np.testing.assert_allclose(graph.ring_areas[tips], rings[[len(rings) - 1, 0]])


def test_a_constant_field_gives_one_node():
    for value in (0.0, 1.0, -1e9):
        graph = reeb_graph(torus(), np.full(len(torus().vertices), value), 64)
        assert (len(graph.areas), len(graph.edges), len(graph.endpoints), graph.root) == (1, 0, 0, 0)
        assert graph.areas[0] == pytest.approx(area(torus()))


def test_a_plateau_within_a_level_is_shared_by_both_sides():
    """A cube on its face: top and bottom are at the ends of the range; a step in the middle is halved."""
    mesh = cube(2.0)
    graph = reeb_graph(mesh, mesh.vertices[:, 2], 4)
    np.testing.assert_allclose(graph.areas, [8, 4, 4, 8])
    stair = grid(3, 1, 3.0, 1.0)
    graph = reeb_graph(stair, np.clip(stair.vertices[:, 0], 1, 2), 2)
    np.testing.assert_allclose(graph.areas, [1.5, 1.5])
    flat_middle = reeb_graph(stair, np.array([0, 0, 1, 1, 1, 1, 2, 2.0]), 2)
    np.testing.assert_allclose(flat_middle.areas, [1.5, 1.5])
    assert len(flat_middle.edges) == 1


def test_a_crease_within_a_level_joins_its_sides_as_an_edge_of_the_graph():
    """No face crosses the level: the two halves of a folded strip meet in the crease alone."""
    strip = grid(2, 1, 2.0, 1.0)
    graph = reeb_graph(strip, strip.vertices[:, 0], 2)
    np.testing.assert_allclose(graph.areas, [1.0, 1.0])
    np.testing.assert_array_equal(graph.edges, [[0, 1]])


@pytest.mark.parametrize("bands", [2, 3, 64])
def test_parts_that_hang_together_at_a_vertex_make_one_graph(bands):
    """Two cones tip to tip, the tip inside a band or on a level."""
    cone = Mesh([[0, 0, 0], [1, 0, 1], [0, 1, 1], [-1, -1, 1]], [[0, 2, 1], [0, 3, 2], [0, 1, 3], [1, 2, 3]])
    vertices = np.concatenate([cone.vertices, -cone.vertices[1:]])
    mesh = Mesh(vertices, np.concatenate([cone.faces, np.where(cone.faces == 0, 0, cone.faces + 3)]))
    graph = reeb_graph(mesh, mesh.vertices[:, 2], bands)
    assert graph.cycles == 0 and len(graph.areas) == bands


def test_faces_without_area_leave_everything_finite():
    mesh = grid(3, 3)
    vertices = mesh.vertices.copy()
    vertices[5] = vertices[6]
    mesh = Mesh(vertices, mesh.faces)
    graph = reeb_graph(mesh, np.random.default_rng(0).standard_normal(16), 32)
    assert np.isfinite(graph.positions).all() and np.isfinite(graph.areas).all()
    assert graph.areas.sum() == pytest.approx(area(mesh), rel=1e-12)


@pytest.mark.parametrize("bands", [1, 0, -3, MAX_BANDS + 1, 64.5])
def test_refuses_a_bad_number_of_bands(bands):
    with pytest.raises(ParameterError, match="number of bands"):
        reeb_graph(tetrahedron(), np.arange(4.0), bands)


def test_refuses_fields_that_do_not_fit():
    with pytest.raises(ParameterError, match=r"shape \(4,\)"):
        reeb_graph(tetrahedron(), np.arange(5.0))
    with pytest.raises(ParameterError, match="NaN"):
        reeb_graph(tetrahedron(), np.array([0, 1, np.nan, 2]))


def test_refuses_what_is_not_one_surface():
    two = joined(tetrahedron(), moved(tetrahedron(), [9, 0, 0]))
    with pytest.raises(MeshError, match="2 separate parts"):
        reeb_graph(two, two.vertices[:, 0])
    with pytest.raises(NoFaces):
        reeb_graph(Mesh(np.zeros((3, 3)), np.empty((0, 3), int)), np.arange(3.0))
    with pytest.raises(DegenerateMesh):
        reeb_graph(Mesh(np.zeros((3, 3)), [[0, 1, 2]]), np.arange(3.0))


def test_more_pieces_than_memory_should_hold_are_refused(monkeypatch):
    mesh = icosphere(2)
    heights = mesh.vertices[:, 2]
    monkeypatch.setattr(import_module("reebase.skeleton.reeb"), "MAX_PIECES", len(mesh.faces))
    assert len(reeb_graph(mesh, np.zeros(len(heights)), 16).positions) == 1  # one piece a face
    with pytest.raises(LimitError, match="fewer bands"):
        reeb_graph(mesh, heights, 64)


@pytest.mark.parametrize("seed", range(6))
def test_every_vertex_lies_in_its_node_or_just_above(seed):
    mesh = [torus(1, 0.4, 16, 9), icosphere(2)][seed % 2]
    values = np.random.default_rng(seed).integers(0, 9, len(mesh.vertices)) / (1 if seed < 3 else 7.3)
    graph, nodes = reeb_nodes(mesh, values, 8)
    same_graph(graph, reeb_graph(mesh, values, 8))
    u = (values - values.min()) / np.ptp(values) * 8
    band = graph.bands[nodes]
    lowest = np.array([u[mesh.faces[(mesh.faces == v).any(axis=1)]].min() for v in range(len(u))])
    inside = (band <= u + 1e-9) & (u <= band + 1 + 1e-9)
    assert inside.all()
    below = lowest < u - 1e-9  # something lies below the vertex: the piece just below it is there
    np.testing.assert_array_equal(band[below], np.ceil(u - 1e-9)[below] - 1)


def test_maxima_further_apart_than_a_band_have_nodes_of_their_own():
    mesh = grid(60, 6)
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    values = np.cos(6 * np.pi * x) - 0.3 * x - y
    graph, nodes = reeb_nodes(mesh, values, 16)
    tops = [int(np.argmin(np.hypot(x - at, y))) for at in (0.0, 1 / 3, 2 / 3, 1.0)]
    found = nodes[tops]
    assert len(set(found.tolist())) == 4
    assert (graph.degrees[found] == 1).all()
    np.testing.assert_allclose(graph.positions[found, 0], [0, 1 / 3, 2 / 3, 1], atol=0.06)
