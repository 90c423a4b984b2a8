"""Moments in windows of heat against closed forms and a slow twin."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.descriptors import Surface, descriptor_named
from reebase.descriptors.moments import TIMES, moments_at, spread_points
from reebase.mesh import Mesh
from reebase.mesh.geometry import vertex_normals
from tests.shapes import capsule, grid, icosphere, moved, torus


def test_on_a_ball():
    # On the unit sphere heat takes a linear function to exp(-2 t) times itself, and the traceless part of n n^T, which
    # is of degree 2, to exp(-6 t): with t = 4 pi times the time over the area, and a point at n = e3.
    found = moments_at(Surface(icosphere(4)), np.array([5]))
    t = 4 * np.pi * TIMES
    large = (1 + 2 * np.exp(-6 * t)) / 3
    np.testing.assert_allclose(found.spread[0, :, 2], large, rtol=5e-3)
    np.testing.assert_allclose(found.spread[0, :, 0], (1 - large) / 2, rtol=2e-2, atol=2e-3)
    np.testing.assert_allclose(found.facing[0], np.exp(-2 * t), rtol=5e-3)
    away = np.exp(-2 * t) * (1 - np.exp(-2 * t)) / np.sqrt(t)
    np.testing.assert_allclose(found.bulge[0], away, rtol=1e-2)
    across = np.sqrt((1 - large) / 2 / t)
    np.testing.assert_allclose(found.extent[0, 1:, 2], np.log(across[1:]), atol=2e-2)


def test_on_a_plate_a_tube_and_a_ball():
    plate = Surface(grid(30, 30))
    middle = int(np.argmin(np.linalg.norm(plate.body.vertices - plate.body.vertices.mean(axis=0), axis=1)))
    np.testing.assert_allclose(moments_at(plate, np.array([middle])).spread[0], np.tile([0, 0, 1], (6, 1)), atol=1e-7)
    tube = Surface(capsule(12, nu=24, nv=8, along=80))
    middle = int(np.argmin(np.linalg.norm(tube.body.vertices[:, 2:] - tube.body.vertices[:, 2:].mean(), axis=1)))
    at = moments_at(tube, np.array([middle]))
    np.testing.assert_allclose(at.spread[0, 2], [0, 0.5, 0.5], atol=0.02)
    ball = moments_at(Surface(icosphere(3)), np.array([0]))
    np.testing.assert_allclose(ball.spread[0, -1], [1 / 3] * 3, atol=0.02)


def test_it_is_the_mean_under_the_heat_kernel():
    surface = Surface(torus(1, 0.4, 20, 12))
    points = np.array([3, 100])
    found = moments_at(surface, points)
    normals = vertex_normals(surface.body, "area")
    values, vectors = surface.spectrum().eigenvalues, surface.spectrum().eigenvectors
    for i, point in enumerate(points):
        for k, t in enumerate(TIMES):
            window = surface.weights * (vectors * np.exp(-values * t) @ vectors[point])
            assert window.sum() == pytest.approx(1.0)
            spread = np.linalg.eigvalsh(np.einsum("m,mi,mj->ij", window, normals, normals))
            np.testing.assert_allclose(found.spread[i, k], np.maximum(spread, 0), atol=1e-7)
            assert found.facing[i, k] == pytest.approx(np.linalg.norm(window @ normals))


def test_inside_out_is_the_same_shape():
    mesh = capsule(3, nu=14, nv=5, along=16)
    turned = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    points = np.array([0, 17, 40])
    for first, second in zip(moments_at(Surface(mesh), points), moments_at(Surface(turned), points), strict=True):
        np.testing.assert_allclose(first, second, atol=1e-6)


def test_points_follow_the_area():
    surface = Surface(moved(capsule(3, nu=14, nv=5, along=16), (0, 0, 1), scale=3.0, seed=2))
    counts = np.bincount(spread_points(surface), minlength=len(surface.weights))
    assert counts.sum() == 400
    assert (np.abs(counts - 400 * surface.weights) <= 1.0 + 1e-9).all()


def test_a_flat_limb_is_told_from_a_round_one():
    round_one = capsule(8, nu=20, nv=6, along=60)
    flat = Mesh(round_one.vertices * [1.6, 0.25, 1.0], round_one.faces)
    longer = capsule(9, nu=20, nv=6, along=60)
    moments = descriptor_named("moments")
    first, second, third = (moments.describe(mesh) for mesh in (round_one, flat, longer))
    assert first.shape == (384,)
    assert moments.compare(first, second) > 3 * moments.compare(first, third)
