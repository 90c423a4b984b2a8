"""Maps: groups stay together, what a plane can show it shows, and the same distances give the same map."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from reebase.embedding import MOST, neighbours_kept, plane
from reebase.errors import ParameterError

Array = npt.NDArray[np.float64]


def distances(points: Array) -> Array:
    return np.asarray(np.sqrt(((points[:, None] - points[None]) ** 2).sum(axis=2)))


def groups(count: int, size: int, dimensions: int = 8, apart: float = 6.0) -> tuple[Array, npt.NDArray[np.int64]]:
    dice = np.random.default_rng(1)
    centres = dice.standard_normal((count, dimensions)) * apart
    labels = np.arange(count * size) % count
    return distances(centres[labels] + dice.standard_normal((len(labels), dimensions))), labels


def purity(points: Array, labels: npt.NDArray[np.int64]) -> float:
    """The share of points whose nearest other point is of their group."""
    apart = distances(points)
    np.fill_diagonal(apart, np.inf)
    return float((labels[apart.argmin(axis=1)] == labels).mean())


@pytest.mark.parametrize(("count", "size"), [(3, 4), (8, 12), (12, 60)])
def test_groups_stay_together(count: int, size: int) -> None:
    matrix, labels = groups(count, size)
    points = plane(matrix)
    assert points.shape == (count * size, 2)
    assert purity(points, labels) > 0.97
    assert np.abs(points).max() == pytest.approx(1.0)


@pytest.mark.parametrize("size", [3, 6, 8])
def test_a_few_points_of_a_plane_come_back_as_they_lie(size: int) -> None:
    flat = np.random.default_rng(2).random((size, 2))
    points = plane(distances(flat))
    # Up to a motion, a mirror and a scale: the distances are proportional.
    assert distances(points) == pytest.approx(distances(flat) * distances(points).max() / distances(flat).max())


def test_neighbours_are_kept_better_than_by_scaling_alone() -> None:
    from reebase.embedding.plane import _scaled

    matrix, _ = groups(6, 25)
    assert neighbours_kept(matrix, plane(matrix)) > neighbours_kept(matrix, _scaled(matrix)) + 0.05
    flat = np.random.default_rng(3).random((60, 2))
    assert neighbours_kept(distances(flat), flat) == 1.0
    assert neighbours_kept(distances(flat), plane(distances(flat))) > 0.75


def test_the_same_distances_give_the_same_map_in_any_unit() -> None:
    matrix, _ = groups(4, 10)
    assert np.array_equal(plane(matrix), plane(matrix.copy()))
    assert plane(matrix * 1e6) == pytest.approx(plane(matrix), abs=0.2)


def test_twins_lie_on_one_another() -> None:
    matrix, _ = groups(4, 10)
    twice = np.repeat(np.repeat(matrix, 2, axis=0), 2, axis=1)
    points = plane(twice)
    assert np.abs(points[::2] - points[1::2]).max() < 0.02


def test_more_than_are_arranged_lie_among_those() -> None:
    matrix, labels = groups(10, 80)
    assert purity(plane(matrix), labels) > 0.97


@pytest.mark.parametrize("size", [0, 1, 2])
def test_nearly_nothing(size: int) -> None:
    points = plane(1.0 - np.eye(size))
    assert points.shape == (size, 2) and np.isfinite(points).all()
    assert neighbours_kept(1.0 - np.eye(size), points) == 1.0


def test_shapes_that_are_all_alike_or_all_apart() -> None:
    for matrix in (np.zeros((20, 20)), 1.0 - np.eye(20)):
        assert np.isfinite(plane(matrix)).all()


def test_a_direction_does_not_matter() -> None:
    matrix, _ = groups(4, 10)
    lopsided = matrix + np.triu(np.random.default_rng(4).random(matrix.shape), 1) * 0.1
    assert plane(lopsided) == pytest.approx(plane(lopsided.T), abs=1e-9)


@pytest.mark.parametrize(
    "matrix",
    [np.zeros((2, 3)), np.full((2, 2), np.nan), -np.ones((3, 3)), np.zeros((MOST + 1, MOST + 1)), np.zeros(4)],
)
def test_refusals(matrix: Array) -> None:
    with pytest.raises(ParameterError):
        plane(matrix)
