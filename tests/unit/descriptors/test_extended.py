"""Persistent maxima against a slow twin, and the endpoints of ``extended`` on shapes with known limbs."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.descriptors import Surface, descriptor_named
from reebase.descriptors.extended import LEAST, endpoints
from reebase.descriptors.maxima import persistent_maxima
from reebase.descriptors.moments import moments_at, spread_points
from reebase.mesh import Mesh
from tests.oracles.persistence import maxima_by_flooding
from tests.shapes import capsule, grid, icosphere, moved, permuted, torus, voxels


def star(arms: int, length: int = 6) -> Mesh:
    """``arms`` bars of square section out of one cube: as many limbs as there are arms, 2 to 6, of one length."""
    size = 2 * length + 1
    solid = np.zeros((size, size, size), dtype=bool)
    solid[length, length, length] = True
    for arm in range(arms):
        place = [length, length, length]
        axis, forward = arm // 2, arm % 2 == 0
        for step in range(1, length + 1):
            place[axis] = length + step if forward else length - step
            solid[tuple(place)] = True
    # Split in eight, so that a bar is two voxels wide.
    return voxels(solid.repeat(2, 0).repeat(2, 1).repeat(2, 2))


@pytest.mark.parametrize("seed", range(5))
def test_maxima_equal_those_found_by_flooding(seed):
    mesh = [torus(1, 0.4, 12, 8), grid(7, 6), icosphere(1), capsule(2, nu=8, along=6, nv=3)][seed % 4]
    random = np.random.default_rng(seed)
    # Few distinct values: plateaus and ties are the rule.
    values = random.integers(0, 6, len(mesh.vertices)) / 2 if seed % 2 else random.normal(size=len(mesh.vertices))
    found = persistent_maxima(mesh, values)
    of_vertex = dict(zip(found.vertices.tolist(), found.persistence.tolist(), strict=True))
    assert of_vertex == maxima_by_flooding(mesh, values)
    assert (np.diff(found.persistence) <= 0).all()


def test_persistence_of_hills_on_a_line():
    mesh = grid(8, 1)
    x = mesh.vertices[:, 0] * 8
    values = np.interp(x, [0, 2, 3, 5, 6, 8], [0, 3, 1, 5, 4.5, 4.9]) - 0.001 * mesh.vertices[:, 1]
    found = persistent_maxima(mesh, values)
    np.testing.assert_allclose(found.persistence, [5.001, 2.0, 0.4], atol=2e-3)
    np.testing.assert_allclose(x[found.vertices], [5, 2, 8])
    assert len(persistent_maxima(mesh, values, 1.0).vertices) == 2
    assert len(persistent_maxima(mesh, values, 99.0).vertices) == 1


def test_a_constant_has_one_maximum():
    # As any maximum that does not persist: the highest is always there.
    found = persistent_maxima(icosphere(1), np.ones(42), 1e-9)
    assert (found.vertices.tolist(), found.persistence.tolist()) == ([0], [0.0])


def arms_of(tips: np.ndarray) -> list[int]:
    """The arms in whose directions the tips lie, ascending."""
    axes = np.abs(tips).argmax(axis=1)
    return sorted((2 * axes + (tips[np.arange(len(tips)), axes] < 0)).tolist())


@pytest.mark.parametrize("arms", [2, 3, 4, 5, 6])
def test_every_limb_ends_in_one_endpoint(arms):
    mesh = star(arms)
    found = endpoints(Surface(mesh))
    tips = mesh.vertices[found.vertices] - 13.0
    assert arms_of(tips) == list(range(arms))
    assert (np.abs(tips).max(axis=1) > 11).all()
    assert (found.persistence > 5 * LEAST).all()


def test_a_limb_more_costs_about_its_charge():
    extended = descriptor_named("extended")
    kept = {arms: extended.describe(star(arms)) for arms in (4, 5, 6)}
    assert [kept[arms].shape for arms in (4, 5, 6)] == [(4, 78), (5, 78), (6, 78)]
    D = extended.distances(list(kept.values()))
    assert D[0, 1] > kept[5][:, -1].min()
    assert D[0, 2] > max(D[0, 1], D[1, 2])


def test_its_columns_are_what_they_are_said_to_be():
    surface = Surface(star(3))
    kept = descriptor_named("extended").describe(surface)
    values, vectors = surface.spectrum().eigenvalues, surface.spectrum().eigenvectors
    times = np.geomspace(0.002, 0.3, 16)
    trace = np.array([surface.weights @ np.log((vectors**2 * np.exp(-values * t)).sum(axis=1)) for t in times])
    tips = endpoints(surface).vertices
    at_top = [np.log((vectors[tips[0]] ** 2 * np.exp(-values * t)).sum()) for t in times]
    np.testing.assert_allclose(kept[0, :16], 0.75 * (at_top - trace) / 4, rtol=1e-9)
    at, around = moments_at(surface, tips), moments_at(surface, spread_points(surface))
    np.testing.assert_allclose(kept[:, 16:34], 2 * np.sqrt(at.spread).reshape(3, 18) / np.sqrt(6), rtol=1e-9)
    np.testing.assert_allclose(kept[:, 34:40], 2 * at.facing / np.sqrt(6), rtol=1e-9)
    np.testing.assert_allclose(kept[2, 49:58], 0.5 * around.extent[:, :3].mean(axis=0).ravel() / np.sqrt(3), rtol=1e-9)
    np.testing.assert_array_equal(kept[:, 40:77], np.tile(kept[:1, 40:77], (3, 1)))
    np.testing.assert_allclose(kept[:, 77], np.clip(1.5 * endpoints(surface).persistence, 0.6, 1.5))


def test_endpoints_follow_the_shape():
    mesh = star(4)
    turned, order = permuted(moved(mesh, (1, 2, 3), scale=0.01, seed=3), seed=5)
    first, second = endpoints(Surface(mesh)), endpoints(Surface(turned))
    # The last eigenvalue read may be one of several equal ones, and any of their eigenvectors will do.
    np.testing.assert_allclose(first.persistence, second.persistence, atol=1e-3)
    assert arms_of(mesh.vertices[order[second.vertices]] - 13.0) == [0, 1, 2, 3]
