"""Triangulation: areas add up, nothing overlaps, nothing flat, whatever the polygon."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reebase.errors import (
    FaceIndexOutOfRange,
    NoFaces,
    NonFiniteVertices,
    TooManyFaces,
    TooManyVertices,
    UnsupportedFeature,
)
from reebase.mesh.read import Limits
from reebase.mesh.read.polygons import MOST_CORNERS, build, clip_ears, strips, triangulate

L_SHAPE = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)
COMB = np.array([[0, 0], [7, 0], [7, 3], [6, 1], [5, 3], [4, 1], [3, 3], [2, 1], [1, 3], [0, 1]], dtype=float)
SPIRAL_TURNS = np.linspace(0, 5 * np.pi, 200)
SPIRAL = np.concatenate([
    np.stack([(radius + t) * np.cos(t), (radius + t) * np.sin(t)], axis=1)
    for radius, t in ((1, SPIRAL_TURNS), (0.4, SPIRAL_TURNS[::-1]))
])  # fmt: skip


def shoelace(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return float(0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum())


def areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Signed areas in the plane."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def lifted(polygon: np.ndarray, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """The polygon somewhere in space, and the rotation that took it there."""
    rotation = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    return np.column_stack([polygon, np.zeros(len(polygon))]) @ rotation.T + [10, -20, 5], rotation


def one_polygon(points: np.ndarray) -> np.ndarray:
    return triangulate(points, np.arange(len(points)), np.array([len(points)]))


@pytest.mark.parametrize("polygon", [L_SHAPE, COMB, SPIRAL], ids=["L", "comb", "spiral"])
@pytest.mark.parametrize("shift", [0, 1, 3])
def test_concave_polygons_are_covered_exactly_once(polygon: np.ndarray, shift: int) -> None:
    polygon = np.roll(polygon, shift, axis=0)
    polygon = polygon if shoelace(polygon) > 0 else polygon[::-1]
    points, _ = lifted(polygon)
    found = areas(polygon, one_polygon(points))
    # All positive and of the right sum: the triangles cannot overlap or reach outside.
    assert len(found) == len(polygon) - 2
    assert (found > 0).all()
    assert found.sum() == pytest.approx(shoelace(polygon), rel=1e-12)


def test_clockwise_polygons_keep_their_orientation() -> None:
    points, rotation = lifted(L_SHAPE[::-1])
    a, b, c = (points[one_polygon(points)[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    assert (normals @ rotation[:, 2] < 0).all()


@pytest.mark.parametrize("reflex", range(4))
def test_a_concave_quad_is_split_at_its_reflex_corner(reflex: int) -> None:
    dart = np.roll(np.array([[0.2, 0.2], [1, 0], [0, 0], [0, 1]])[::-1], reflex, axis=0)
    dart = dart if shoelace(dart) > 0 else dart[::-1]
    points, _ = lifted(dart)
    found = areas(dart, one_polygon(points))
    assert (found > 0).all()
    assert found.sum() == pytest.approx(shoelace(dart))


def test_a_convex_polygon_is_a_fan() -> None:
    angle = np.linspace(0, 2 * np.pi, 7)[:-1]
    points, _ = lifted(np.stack([np.cos(angle), np.sin(angle)], axis=1))
    assert one_polygon(points).tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]


@pytest.mark.parametrize("shift", range(6))
def test_a_corner_on_a_straight_side_gives_no_flat_triangle(shift: int) -> None:
    # A flat triangle would be removed in cleaning and leave the neighbour's edge open.
    square = np.array([[0, 0], [0.5, 0], [1, 0], [1, 1], [0.5, 1], [0, 1]], dtype=float)
    square = np.roll(square, shift, axis=0)
    points, _ = lifted(square)
    found = areas(square, one_polygon(points))
    assert found.min() > 0.1
    assert found.sum() == pytest.approx(1)


def test_a_hole_that_is_bridged_stays_a_hole() -> None:
    outer = [[0, 0], [4, 0], [4, 4], [0, 4], [0, 0]]
    inner = [[1, 1], [1, 3], [3, 3], [3, 1], [1, 1]]
    ring = np.array([*outer, *inner], dtype=float)
    found = areas(ring, np.array(clip_ears(ring)))
    assert found.sum() == pytest.approx(12)
    assert (found >= 0).all()


@given(st.integers(3, 40), st.integers(0, 10_000))
def test_star_shaped_polygons(size: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    # Gaps below half a turn keep the polygon simple, with the centre inside.
    gaps = rng.uniform(0.5, 1.0, size)
    angle = np.cumsum(gaps / gaps.sum() * 2 * np.pi)
    polygon = np.stack([np.cos(angle), np.sin(angle)], axis=1) * rng.uniform(0.2, 1, size)[:, None]
    points, _ = lifted(polygon, seed)
    found = areas(polygon, one_polygon(points))
    assert len(found) == size - 2
    assert found.min() > -1e-12
    assert found.sum() == pytest.approx(shoelace(polygon), rel=1e-9)


@given(st.integers(3, 12), st.integers(0, 1000))
def test_any_corners_at_all_give_their_number_of_triangles(size: int, seed: int) -> None:
    # Crossing itself, folded, out of plane, repeated: never an endless loop, never a corner from elsewhere.
    points = np.random.default_rng(seed).integers(-1, 2, (size, 3)).astype(float)
    found = one_polygon(points)
    assert found.shape == (size - 2, 3)
    assert set(found.ravel().tolist()) <= set(range(size))


def test_mixed_sizes_keep_the_order_of_the_file() -> None:
    points, _ = lifted(np.concatenate([L_SHAPE, L_SHAPE + 5, L_SHAPE + 10]))
    corners = np.array([0, 1, 2, 6, 7, 8, 9, 10, 11, 12, 13, 1, 0])
    found = triangulate(points, corners, np.array([3, 6, 2, 2]))
    assert found[0].tolist() == [0, 1, 2]
    assert set(found[1:].ravel().tolist()) == set(range(6, 12))
    assert len(found) == 5


def test_strips_alternate_and_restart() -> None:
    assert strips(np.array([0, 1, 2, 3, 4])).tolist() == [[0, 1, 2], [3, 2, 1], [2, 3, 4]]
    assert strips(np.array([0, 1, 2, -1, 3, 4, 5]), restart=-1).tolist() == [[0, 1, 2], [3, 4, 5]]
    assert strips(np.array([0, 1, 2, 2, 3, 3, 3, 4, 5])).tolist() == [[0, 1, 2], [3, 4, 5]]
    assert strips(np.array([0, 1])).shape == (0, 3)


@pytest.mark.parametrize("seed", range(5))
def test_strips_equal_a_walk(seed: int) -> None:
    indices = np.random.default_rng(seed).integers(-1, 6, size=400)
    expected, place = [], 0
    for i in range(len(indices) - 2):
        place = 0 if indices[i] == -1 else place + 1
        a, b, c = indices[i : i + 3].tolist()
        if -1 not in (a, b, c) and len({a, b, c}) == 3:
            expected.append([a, b, c] if place % 2 else [c, b, a])
    assert strips(indices, restart=-1).tolist() == expected


def test_a_million_restarts_take_no_walk() -> None:
    began = time.process_time()
    assert strips(np.full(1_000_000, -1), restart=-1).shape == (0, 3)
    assert time.process_time() - began < 2


def test_refusals_name_what_was_found() -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
    with pytest.raises(FaceIndexOutOfRange, match="Face 2 refers to vertex 5, but there are only 4") as caught:
        build(square, np.array([0, 1, 2, 3, 2, 4]), np.array([3, 3]), Limits(), base=1)
    assert caught.value.details == {"face": 2, "vertex": 5, "vertices": 4}
    with pytest.raises(NonFiniteVertices, match="the first is vertex 1"):
        build(np.array([[0, 0, 0], [np.nan, 0, 0], [0, 1, 0]]), np.arange(3), np.array([3]), Limits())
    with pytest.raises(NoFaces):
        build(square, np.array([0, 1]), np.array([2]), Limits())
    with pytest.raises(TooManyFaces):
        build(square, np.arange(4), np.array([4]), Limits(faces=1))
    with pytest.raises(TooManyVertices):
        build(square, np.arange(4), np.array([4]), Limits(vertices=3))


def test_a_concave_polygon_of_unreasonable_size_is_refused() -> None:
    size = MOST_CORNERS + 2
    angle = np.linspace(0, 2 * np.pi, size, endpoint=False)
    radius = np.where(np.arange(size) % 2, 1.0, 0.9)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1)
    with pytest.raises(UnsupportedFeature, match="not convex"):
        one_polygon(points)
