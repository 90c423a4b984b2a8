"""Patches of a part find the whole: closed forms of discs, a slow twin of the search, and cut shapes."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.descriptors import Surface, descriptor_named
from reebase.descriptors.patches import FACTOR, FARTHEST, RADII, WEIGHTS, place
from reebase.errors import ParameterError
from reebase.mesh import Mesh
from reebase.mesh.topology import largest_component
from tests.shapes import capsule, grid, icosphere, moved, torus

PATCHES = descriptor_named("patches")


def lopsided() -> Mesh:
    mesh = capsule(4, nu=40, nv=16, along=60)
    x, y, z = mesh.vertices.T
    return Mesh(np.stack([x * (1.5 + 0.4 * z) + 0.2 * z * z, y * (1 - 0.3 * z), z], axis=1), mesh.faces)


def cut(mesh: Mesh, keep: np.ndarray) -> Mesh:
    return largest_component(Mesh(mesh.vertices, mesh.faces[keep[mesh.faces].all(axis=1)]))[0]


def values_of(kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(k, 12, 3) without the weights, and which discs are known."""
    discs = np.arange(12)
    known = (kept[:, :1] <= discs) & (discs < kept[:, 1:2])
    return kept[:, 2:-1].reshape(len(kept), 12, 3) / WEIGHTS, known


def test_discs_of_a_plane_are_flat():
    values, known = values_of(PATCHES.describe(grid(60, 60)))
    assert known.sum() > 100
    np.testing.assert_allclose(values[known][:, 0], 1.0, atol=0.12)
    np.testing.assert_allclose(values[known][:, 1], 1.0, atol=1e-12)
    np.testing.assert_allclose(values[known][:, 2], 0.0, atol=1e-12)


def test_discs_of_a_sphere_are_caps():
    # Of angle a: area 2 pi (1 - cos a), mean cosine and 1 + mean height (1 + cos a) / 2, in the radius of the sphere.
    values, known = values_of(PATCHES.describe(icosphere(5, 3.0)))
    assert known.sum(axis=1).min() >= 10
    for disc in np.flatnonzero(known.all(axis=0)):
        radius = RADII[disc]
        angle = radius * np.sqrt(4 * np.pi)
        rise = (1 - np.cos(angle)) / 2
        expected = [2 * (1 - np.cos(angle)) / angle**2, 1 - rise, -rise / angle]
        np.testing.assert_allclose(values[:, disc].mean(axis=0), expected, atol=0.05)


def test_what_the_border_cuts_or_the_mesh_does_not_resolve_is_unknown():
    mesh = grid(30, 30)
    kept = PATCHES.describe(mesh)
    _, known = values_of(kept)
    at = place(Surface(mesh))
    free = np.minimum(at[:, :2], 1 - at[:, :2]).min(axis=1)
    for disc, radius in enumerate(RADII):
        resolved = radius >= 2 * 1.138 / 30  # the mean of two sides and a diagonal is 1.14 sides
        assert (known[:, disc] <= (resolved & (radius <= free + 1e-9))).all()
        # Where two sides meet their fronts run ahead, by 1 / sqrt(2) at most.
        assert (known[:, disc] >= (resolved & (radius <= 0.7 * free))).all()
    assert (kept[:, 2:-1].reshape(-1, 12, 3)[~known] == 0).all()
    np.testing.assert_allclose(kept[:, -1], 0.0, atol=1e-12)


def slowly(part: np.ndarray, whole: np.ndarray, shifts: np.ndarray) -> float:
    """Every patch of the part against every one of the whole, disc by disc."""
    totals = []
    for shift in shifts:
        costs, known = [], []
        for one in part[:32]:
            discs = range(int(one[0]), int(one[1]))
            least = FARTHEST
            for other in whole:
                differences = []
                for disc in discs:
                    low, share = int(np.floor(disc + shift)), (disc + shift) % 1
                    needed = [low] if share == 0 else [low, low + 1]
                    if found := [one_disc for one_disc in needed if other[0] <= one_disc < other[1]]:
                        # Of two discs the one that is known stands for both.
                        ends = [found[0], found[-1]]
                        value = sum(
                            w * other[2 + 3 * d : 5 + 3 * d] for d, w in zip(ends, (1 - share, share), strict=True)
                        )
                        differences.append(np.abs(one[2 + 3 * disc : 5 + 3 * disc] - value).sum())
                if len(differences) >= max(min(3, len(discs)), 1):
                    least = min(least, float(np.mean(differences)))
            costs.append(least)
            known.append(len(discs))
        totals.append(np.average(costs, weights=known))
    return min(totals)


def test_the_search_equals_its_slow_twin():
    mesh = lopsided()
    half = cut(mesh, mesh.vertices[:, 2] > 0.3)
    part, whole = PATCHES.describe(half), PATCHES.describe(mesh)
    assert 2 < part[0, 1] - part[0, 0] < whole[0, 1] - whole[0, 0]
    relative = slowly(part, whole, np.arange(0, -8.5, -0.5))
    assert PATCHES.compare(part, whole, "relative") == pytest.approx(relative, rel=1e-9)
    absolute = slowly(part, whole, [(part[0, -1] - whole[0, -1]) / np.log(FACTOR)])
    assert PATCHES.compare(part, whole, "absolute") == pytest.approx(absolute, rel=1e-9)


@pytest.mark.parametrize("share", [0.5, -0.7])
def test_a_part_is_nearer_to_its_whole_than_to_others(share):
    whole = lopsided()
    part = moved(cut(whole, whole.vertices[:, 2] > share), (3, 4, 5), seed=1)
    others = [capsule(4, nu=30, along=40), torus(1, 0.4, 60, 30), icosphere(4, 0.7), whole]
    kept = [PATCHES.describe(mesh) for mesh in others]
    for measure in ("absolute", "relative"):
        found = PATCHES.distances_to(PATCHES.describe(part), kept, measure)
        assert found.argmin() == 3
        assert found[3] < 0.6 * np.delete(found, 3).min()
    small = Mesh(part.vertices * 0.01, part.faces)
    assert PATCHES.distances_to(PATCHES.describe(small), kept, "relative").argmin() == 3


def test_patches_find_their_own_place():
    whole = lopsided()
    part = cut(whole, whole.vertices[:, 2] > -0.5)
    found = PATCHES.explain(PATCHES.describe(part), PATCHES.describe(whole), "absolute")
    assert sum(pair.distance for pair in found.pairs) + sum(one.charge for one in found.unmatched_first) == (
        pytest.approx(found.dissimilarity)
    )
    here, there = place(Surface(part)), place(Surface(whole))
    apart = [np.linalg.norm(here[pair.first] - there[pair.second]) for pair in found.pairs]
    size = np.linalg.norm(np.ptp(whole.vertices, axis=0))
    assert np.median(apart) < 0.15 * size
    itself = PATCHES.explain(PATCHES.describe(whole), PATCHES.describe(whole), "relative")
    assert itself.dissimilarity == 0.0
    assert all(pair.first == pair.second for pair in itself.pairs)


def test_other_arrays_are_refused():
    good = PATCHES.describe(icosphere(2))
    for bad in (good[:, :-1], np.where(good == good[0, 1], 13, good), good[:0], np.full_like(good, np.nan)):
        with pytest.raises(ParameterError):
            PATCHES.compare(bad, good)
