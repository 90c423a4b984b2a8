"""Global descriptors against closed forms and slow twins."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.descriptors import Surface, d2, gps, hks, shape_dna, wks
from reebase.descriptors.vectors import distances, vector_distance, weighted_quantiles
from tests.shapes import grid, icosphere, tetrahedron, torus

SPHERE = Surface(icosphere(4))


def test_eigenvalues_of_the_sphere():
    # l (l + 1), 2 l + 1 times, over the area 4 pi.
    exact = np.concatenate([[4 * np.pi * l * (l + 1)] * (2 * l + 1) for l in range(1, 5)])[:20]  # noqa: E741 - the degree
    np.testing.assert_allclose(shape_dna.describe(SPHERE), np.log(exact), atol=0.02)


def test_eigenvalues_of_a_rectangle():
    # pi^2 (i^2 / a^2 + j^2 / b^2) with a free boundary, times the area a b.
    exact = sorted(np.pi**2 * (i * i / 9 + j * j) * 3 for i in range(40) for j in range(20))[1:21]
    np.testing.assert_allclose(shape_dna.describe(Surface(grid(90, 30, 3, 1))), np.log(exact), atol=0.02)


def test_eigenvalues_that_a_small_mesh_lacks_go_on_by_weyls_law():
    found = np.exp(shape_dna.describe(Surface(tetrahedron())))
    np.testing.assert_allclose(found[3:] / found[2], np.arange(4, 21) / 3)


def test_heat_is_even_on_a_sphere():
    found = hks.describe(SPHERE).reshape(10, 16)
    trace = np.log(np.exp(-np.outer(hks.TIMES, SPHERE.spectrum().eigenvalues)).sum(axis=1))
    np.testing.assert_allclose(found, np.broadcast_to(trace, found.shape), atol=0.02)


def test_the_mean_of_the_quantiles_is_about_the_mean():
    surface = Surface(torus())
    assert wks.describe(surface).reshape(10, 16).mean(axis=0) == pytest.approx(np.ones(16), abs=0.02)


def test_gps_of_a_sphere_is_a_sphere_of_its_own():
    # |GPS|^2 = sum phi^2 / lambda is the same everywhere, so the largest distance is at most twice its root.
    found = gps.describe(SPHERE)
    values = SPHERE.spectrum().eigenvalues[1 : gps.DIMENSIONS + 1]
    radius = np.sqrt((1 / values).sum())
    assert (np.diff(found) >= 0).all()
    assert radius < found[-1] < 2 * radius
    assert np.sqrt((found**2).mean()) == pytest.approx(np.sqrt(2) * radius, rel=0.02)


def test_d2_of_a_sphere():
    # The density of the distance r of two points of the unit sphere is r / 2 on [0, 2]; the mean is 4 / 3.
    edges = np.linspace(0, d2.FARTHEST, d2.BINS + 1) * 4 / 3
    exact = np.diff(np.minimum(edges, 2) ** 2 / 4)
    assert np.abs(d2.describe(SPHERE) - exact).sum() < 0.05


def test_points_fall_on_the_surface_by_area():
    mesh = grid(1, 1, 4, 2)
    points = d2.surface_points(mesh, 4000)
    assert (points[:, 2] == 0).all()
    np.testing.assert_allclose(points.mean(axis=0), [2, 1, 0], atol=0.05)
    np.testing.assert_allclose(points.var(axis=0), [16 / 12, 4 / 12, 0], rtol=0.05)


def test_weighted_quantiles():
    values = np.array([[3.0], [1.0], [2.0]])
    np.testing.assert_allclose(weighted_quantiles(values, np.ones(3), np.array([0.5]))[0], 2.0)
    # A value of weight 3 is the same as the value three times, at the middles of their steps.
    heavy = weighted_quantiles(values, np.array([1.0, 3.0, 1.0]), np.array([0.3, 0.7, 0.9]))[:, 0]
    np.testing.assert_allclose(heavy, [1.0, 2.0, 3.0])
    # The order of the rows does not matter.
    order, weights = np.array([2, 0, 1]), np.array([1.0, 3.0, 1.0])
    np.testing.assert_array_equal(
        weighted_quantiles(values[order], weights[order]), weighted_quantiles(values, weights)
    )


def test_vectors_are_compared_entry_by_entry():
    a, b = np.array([0.0, 3.0]), np.array([4.0, 0.0])
    assert vector_distance(a, b, "l1") == 7.0
    assert vector_distance(a, b, "l2") == 5.0
    np.testing.assert_array_equal(distances([a, b], "l2"), [[0, 5], [5, 0]])
