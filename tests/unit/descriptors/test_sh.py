"""Spherical harmonics by shells against the addition theorem, and what must not change them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import eval_legendre

from reebase.descriptors import Surface, sh
from reebase.mesh import Mesh
from tests.shapes import capsule, cube, icosphere, moved, permuted, torus


def lopsided() -> Mesh:
    mesh = capsule(3, nu=16, nv=5, along=10)
    x, y, z = mesh.vertices.T
    return Mesh(np.stack([x * (1.5 + 0.4 * z) + 0.3 * z * z, y * (0.8 - 0.2 * z), z + 0.2 * y], axis=1), mesh.faces)


def by_the_addition_theorem(mesh: Mesh, split: int) -> np.ndarray:
    """sum_m c_lm^2 = (2 l + 1) / 4 pi * sum over pairs of points of w w' P_l(cos of the angle between them)."""
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    centroid = areas @ corners.mean(axis=1) / areas.sum()
    sides = np.linalg.norm((corners + np.roll(corners, 1, axis=1)) / 2 - centroid, axis=2).mean(axis=1)
    size = 16 / (areas @ sides / areas.sum())
    points, weights = [], []
    for (a, b, c), area in zip((corners - centroid) * size, areas / areas.sum(), strict=True):
        for i in range(split):
            for j in range(split - i):
                spots = [(i + 1 / 3, j + 1 / 3)] + [(i + 2 / 3, j + 2 / 3)] * (i + j < split - 1)
                for u, v in np.array(spots) / split:
                    points.append(a + u * (b - a) + v * (c - a))
                    weights.append(area / split**2)
    radii = np.linalg.norm(points, axis=1)
    hats = np.array([np.interp(np.clip(radii, 1, 32), np.arange(1, 33), row) for row in np.eye(32)]) * weights
    cosines = np.clip((points / radii[:, None]) @ (points / radii[:, None]).T, -1, 1)
    energies = [
        (2 * l + 1) / (4 * np.pi) * ((hats @ eval_legendre(l, cosines)) * hats).sum(axis=1) for l in range(16)  # noqa: E741 - the degree
    ]
    return np.sqrt(np.maximum(np.array(energies).T, 0)) / np.arange(1, 33)[:, None]


@pytest.mark.parametrize(("mesh", "split"), [(cube(), 5), (moved(cube(), seed=3), 5), (icosphere(1), 2)])
def test_it_equals_the_addition_theorem(mesh, split, monkeypatch):
    monkeypatch.setattr(sh, "POINTS", (split - 0.5) ** 2 * len(mesh.faces))
    found = sh.describe(Surface(mesh)).reshape(32, 16)
    np.testing.assert_allclose(found, by_the_addition_theorem(mesh, split), atol=1e-9)


def test_a_sphere_is_one_shell_of_degree_zero():
    found = sh.describe(Surface(icosphere(4))).reshape(32, 16)
    assert found[15, 0] * 16 == pytest.approx(1 / np.sqrt(4 * np.pi), rel=0.01)
    found[14:17, 0] = 0
    assert found.max() < 1e-3 / 16


@pytest.mark.parametrize("seed", range(3))
def test_turned_mirrored_scaled_or_in_another_order_it_is_the_same(seed):
    mesh = lopsided()
    expected = sh.describe(Surface(mesh))
    for other in (
        moved(mesh, (1, 2, 3), scale=0.01, seed=seed), permuted(mesh, seed)[0],
        Mesh(mesh.vertices * (-1, 1, 1), mesh.faces[:, ::-1]),
    ):  # fmt: skip
        np.testing.assert_allclose(sh.describe(Surface(other)), expected, atol=1e-12)


def test_tessellation_hardly_matters():
    coarse, fine, other = (sh.describe(Surface(torus(1, r, n, n))) for r, n in ((0.4, 30), (0.4, 80), (0.6, 30)))
    assert np.abs(coarse - fine).sum() < 0.15 * np.abs(coarse - other).sum()
