"""The synthetic set: sound surfaces of the right topology, from a seed, with options that do what they say."""

from __future__ import annotations

from collections import Counter
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from reebase.errors import ComputationError, ParameterError, UnknownName
from reebase.evaluation.synthetic import CLASSES, LabelledMesh, synthetic_set, synthetic_shape
from reebase.evaluation.synthetic.implicit import Ellipsoid, Field, Figure, Limb, is_clear
from reebase.evaluation.synthetic.surface import extract, genus, relax, triangulate
from reebase.mesh.mesh import Mesh

Array = npt.NDArray[np.float64]

GENUS = {label: 2 if label == "spectacles" else 0 for label in CLASSES}

PLAIN = {"rotation": False, "scale": False, "tessellation": False, "vertex_order": False}


@cache
def shape(label: str, index: int = 0, seed: int = 0) -> LabelledMesh:
    return synthetic_shape(label, index, seed)


@cache
def plain(label: str, index: int = 0) -> Mesh:
    return synthetic_shape(label, index, **PLAIN).mesh  # type: ignore[arg-type]


def check_closed_manifold(mesh: Mesh) -> None:
    """Each directed edge once and its reverse once; each vertex one closed fan; nothing unused, one piece."""
    faces = mesh.faces.tolist()
    halves = Counter((face[i], face[(i + 1) % 3]) for face in faces for i in range(3))
    assert set(halves.values()) == {1}
    assert all((b, a) in halves for a, b in halves)
    fans: dict[int, dict[int, int]] = {vertex: {} for vertex in range(len(mesh.vertices))}
    for a, b, c in faces:
        for vertex, start, end in ((a, b, c), (b, c, a), (c, a, b)):
            fans[vertex][start] = end
    for fan in fans.values():
        start = next(iter(fan))
        at, steps = fan[start], 1
        while at != start:
            at, steps = fan[at], steps + 1
        assert steps == len(fan) >= 3
    reached, frontier = {0}, [0]
    while frontier:
        fresh = set(fans[frontier.pop()]) - reached
        reached |= fresh
        frontier += fresh
    assert len(reached) == len(mesh.vertices)


def volume(mesh: Mesh) -> float:
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return float((np.cross(a, b) * c).sum() / 6)


def edge_lengths(mesh: Mesh) -> Array:
    corners = mesh.vertices[mesh.faces]
    return np.sort(np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).ravel())


def as_set(mesh: Mesh) -> set[tuple[tuple[float, ...], ...]]:
    """Faces as triples of positions, each from its smallest corner on: what does not depend on any order."""
    result = set()
    for face in mesh.vertices[mesh.faces].tolist():
        corners = [tuple(corner) for corner in face]
        first = corners.index(min(corners))
        result.add(tuple(corners[first:] + corners[:first]))
    return result


def test_the_classes_are_mcgills() -> None:
    assert CLASSES == (
        "ants", "crabs", "hands", "humans", "octopuses", "pliers", "snakes", "spectacles", "spiders", "teddy-bears",
    )  # fmt: skip


@pytest.mark.parametrize("label", CLASSES)
@pytest.mark.parametrize("index", [0, 1, 2])
def test_each_shape_is_a_closed_manifold_of_its_genus(label: str, index: int) -> None:
    mesh = shape(label, index).mesh
    check_closed_manifold(mesh)
    euler = len(mesh.vertices) - 3 * len(mesh.faces) // 2 + len(mesh.faces)
    assert euler == 2 - 2 * GENUS[label]
    assert volume(mesh) > 0


@pytest.mark.parametrize("label", CLASSES)
def test_each_shape_has_decent_triangles_and_about_the_vertices_asked_for(label: str) -> None:
    mesh = shape(label).mesh
    assert 1500 <= len(mesh.vertices) <= 6000
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    squares = ((corners - np.roll(corners, -1, axis=1)) ** 2).sum(axis=(1, 2))
    quality = 4 * np.sqrt(3) * areas / squares  # 1 for an equilateral triangle, 0 for a flat one
    assert quality.mean() > 0.85
    assert quality.min() > 0.15


@pytest.mark.parametrize("label", ["hands", "snakes", "spectacles"])
def test_more_vertices_are_about_as_many_as_asked_for(label: str) -> None:
    mesh = synthetic_shape(label, 0, vertices=9000).mesh
    assert 6000 <= len(mesh.vertices) <= 14_000
    assert genus(len(mesh.vertices), mesh.faces.astype(np.int64)) == GENUS[label]


def test_the_set_is_named_and_labelled_in_order() -> None:
    made = list(synthetic_set(2, classes=("teddy-bears", "hands")))
    assert [item.name for item in made] == ["teddy-bears-00", "teddy-bears-01", "hands-00", "hands-01"]
    assert [item.label for item in made] == ["teddy-bears", "teddy-bears", "hands", "hands"]


def test_the_set_is_lazy() -> None:
    assert next(iter(synthetic_set(10**6, classes=("pliers",)))).name == "pliers-00"


def test_a_shape_depends_on_nothing_but_its_seed_class_and_index() -> None:
    alone = list(synthetic_set(2, 5, classes=("pliers",)))[1].mesh
    among = next(item.mesh for item in synthetic_set(2, 5, classes=("hands", "pliers")) if item.name == "pliers-01")
    np.testing.assert_array_equal(alone.vertices, among.vertices)
    np.testing.assert_array_equal(alone.faces, among.faces)


@pytest.mark.parametrize("label", CLASSES)
def test_poses_differ_between_indices_and_seeds(label: str) -> None:
    first, second, other = shape(label, 0).mesh, shape(label, 1).mesh, synthetic_shape(label, 0, 1).mesh
    assert first.vertices.shape != second.vertices.shape or not np.allclose(first.vertices, second.vertices)
    assert first.vertices.shape != other.vertices.shape or not np.allclose(first.vertices, other.vertices)


def test_vertex_order_leaves_the_surface_as_it_is() -> None:
    shuffled = synthetic_shape("pliers", 0, **{**PLAIN, "vertex_order": True}).mesh  # type: ignore[arg-type]
    assert as_set(shuffled) == as_set(plain("pliers"))
    assert not np.array_equal(shuffled.vertices, plain("pliers").vertices)
    assert not np.array_equal(shuffled.faces[:, 0], plain("pliers").faces[:, 0])


def test_rotation_keeps_edge_lengths_and_handedness() -> None:
    turned = synthetic_shape("hands", 0, **{**PLAIN, "rotation": True}).mesh  # type: ignore[arg-type]
    np.testing.assert_array_equal(turned.faces, plain("hands").faces)
    np.testing.assert_allclose(edge_lengths(turned), edge_lengths(plain("hands")), rtol=1e-9)
    assert volume(turned) == pytest.approx(volume(plain("hands")))
    assert not np.allclose(turned.vertices, plain("hands").vertices, atol=0.05)


def test_scale_is_one_factor_between_a_tenth_and_ten() -> None:
    factors = []
    for index in range(3):
        scaled = synthetic_shape("pliers", index, **{**PLAIN, "scale": True}).mesh  # type: ignore[arg-type]
        ratio = scaled.vertices / plain("pliers", index).vertices
        assert np.ptp(ratio) < 1e-9 * ratio.max()
        factors.append(float(ratio.flat[0]))
    assert all(0.1 <= factor <= 10 for factor in factors)
    assert len(set(factors)) == 3


def test_tessellation_samples_the_same_surface_anew() -> None:
    other = synthetic_shape("teddy-bears", 0, **{**PLAIN, "tessellation": True}).mesh  # type: ignore[arg-type]
    assert other.vertices.shape != plain("teddy-bears").vertices.shape
    assert volume(other) == pytest.approx(volume(plain("teddy-bears")), rel=0.01)
    np.testing.assert_allclose(other.vertices.max(axis=0), plain("teddy-bears").vertices.max(axis=0), atol=0.03)


def test_noise_moves_vertices_by_its_share_of_the_mean_edge_length() -> None:
    noisy = synthetic_shape("hands", 0, noise=0.3, **PLAIN).mesh  # type: ignore[arg-type]
    np.testing.assert_array_equal(noisy.faces, plain("hands").faces)
    moved = np.linalg.norm(noisy.vertices - plain("hands").vertices, axis=1)
    assert np.sqrt((moved**2).mean()) == pytest.approx(0.3 * edge_lengths(plain("hands")).mean(), rel=0.1)


@pytest.mark.parametrize(
    "options",
    [{"per_class": 0}, {"seed": -1}, {"noise": -0.1}, {"noise": float("nan")}, {"vertices": 10}, {"vertices": 10**9}],
)
def test_parameters_out_of_range_are_refused_at_once(options: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match=next(iter(options))):
        synthetic_set(**options)  # type: ignore[arg-type]


def test_an_unknown_class_is_refused_with_the_known_ones() -> None:
    with pytest.raises(UnknownName, match="teddy-bears"):
        synthetic_set(classes=("ants", "unicorns"))
    with pytest.raises(ParameterError, match="index"):
        synthetic_shape("ants", -1)


def rounded_cone_distance(point: Array, limb: Limb) -> float:
    """The nearest of 20001 balls between the two joints."""
    share = np.linspace(0, 1, 20_001)[:, None]
    centres = limb.joints[0] + share * (limb.joints[1] - limb.joints[0])
    radii = limb.radii[0] + share[:, 0] * (limb.radii[1] - limb.radii[0])
    return float((np.linalg.norm(point - centres, axis=1) - radii).min())


def test_the_distance_to_a_limb_is_that_to_its_nearest_ball() -> None:
    limb = Limb(np.array([[0.0, 0, 0], [1.0, 0.5, -0.3]]), np.array([0.4, 0.1]))
    points = np.random.default_rng(3).normal(size=(40, 3))
    expected = [rounded_cone_distance(point, limb) for point in points]
    np.testing.assert_allclose(Field(Figure((limb,)))(points), expected, atol=1e-6)


def test_a_ball_has_the_distance_of_a_sphere_and_an_ellipsoid_its_own_zero() -> None:
    points = np.random.default_rng(4).normal(size=(50, 3))
    anchor = Limb(np.array([[50.0, 0, 0], [51.0, 0, 0]]), np.array([0.1, 0.1]))
    sphere = Ellipsoid(np.zeros(3), np.full(3, 0.7), np.eye(3))
    expected = np.linalg.norm(points, axis=1) - 0.7
    np.testing.assert_allclose(Field(Figure((sphere, anchor)))(points), expected, atol=1e-9)
    radii = np.array([0.9, 0.5, 0.3])
    on = points / np.linalg.norm(points / radii, axis=1)[:, None]
    egg = Ellipsoid(np.zeros(3), radii, np.eye(3))
    np.testing.assert_allclose(Field(Figure((egg, anchor)))(on), 0, atol=1e-12)


def test_the_blend_is_symmetric_and_swells_by_a_quarter_of_its_width() -> None:
    ends = (np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([[0.0, 1, 0], [1.0, 1, 0]]))
    radii = np.array([0.2, 0.2])
    field = Field(Figure((Limb(ends[0], radii), Limb(ends[1], radii, blend=0.4))))
    middle = np.array([[0.5, 0.5, 0.0], [0.5, 0.2, 0.0], [0.5, 0.8, 0.0]])
    values = field(middle)
    assert values[0] == pytest.approx(0.3 - 0.1)
    assert values[1] == pytest.approx(values[2])


@pytest.mark.parametrize("step", [0.11, 0.06])
def test_a_sphere_is_extracted_with_its_area_and_volume(step: float) -> None:
    def field(points: Array) -> Array:
        return np.linalg.norm(points, axis=1) - 1.0

    corner = np.ones(3)
    vertices, quads = extract(field, -corner, corner, np.full(3, step), np.eye(3), np.full(3, 0.3))
    faces = triangulate(relax(field, vertices, quads, 3), quads)
    mesh = Mesh(relax(field, vertices, quads, 3), faces)
    check_closed_manifold(mesh)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 1, atol=1e-3)
    assert volume(mesh) == pytest.approx(4 * np.pi / 3, rel=step**2)


def test_a_torus_and_two_spheres_are_told_apart() -> None:
    def ring(points: Array) -> Array:
        return np.hypot(np.hypot(points[:, 0], points[:, 1]) - 1, points[:, 2]) - 0.3

    def pair(points: Array) -> Array:
        return np.linalg.norm(np.abs(points) - [0.8, 0, 0], axis=1) - 0.5

    box = np.array([1.4, 1.4, 0.6])
    for field, expected in ((ring, 1), (pair, None)):
        vertices, quads = extract(field, -box, box, np.full(3, 0.1), np.eye(3), np.zeros(3))
        assert genus(len(vertices), triangulate(vertices, quads)) == expected


def test_genus_refuses_what_is_open_doubled_or_unused() -> None:
    closed = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    assert genus(4, closed) == 0
    assert genus(4, closed[:3]) is None
    assert genus(5, closed) is None
    assert genus(4, np.concatenate([closed, closed])) is None
    assert genus(4, closed[:, [0, 2, 1]]) == 0
    assert genus(4, np.concatenate([closed[:3], closed[3:, ::-1]])) is None
    assert genus(0, np.empty((0, 3), dtype=np.int64)) is None


def test_a_field_that_overstates_distances_is_refused() -> None:
    for factor in (3.0, 40.0):

        def field(points: Array, factor: float = factor) -> Array:
            return factor * (np.linalg.norm(points - 0.02, axis=1) - 1.0)

        with pytest.raises(ComputationError, match="overstates"):
            extract(field, -np.ones(3), np.ones(3), np.full(3, 0.07), np.eye(3), np.zeros(3))


def test_limbs_that_touch_others_or_themselves_are_noticed() -> None:
    radii = np.array([0.1, 0.1])
    straight = Limb(np.array([[0.0, 0, 0], [1.0, 0, 0]]), radii)
    near = Limb(np.array([[0.0, 1, 0], [1.0, 0.25, 0]]), radii, free=(0.5, 1.0))
    assert is_clear(Figure((straight, near)), 0.0)
    assert not is_clear(Figure((straight, near)), 0.1)
    turns = np.linspace(0, 2 * np.pi, 25)[:, None]
    ring = np.hstack([np.cos(turns), np.sin(turns), np.zeros_like(turns)])
    helix = ring + np.linspace(0, 0.5, 25)[:, None] * [0, 0, 1]
    thin = np.full(25, 0.1)
    assert not is_clear(Figure((Limb(ring, thin, free=(0.1, 1.0)),)), 0.0)
    assert is_clear(Figure((Limb(helix, thin, free=(0.1, 1.0)),)), 0.0)
