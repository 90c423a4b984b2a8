"""Endpoints of the geodesic integral."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.descriptors import Surface, rgpd
from reebase.mesh import Mesh
from tests.shapes import capsule, icosphere, torus, voxels


def star(arms: int, length: int = 6) -> Mesh:
    """``arms`` bars of square section out of one cube, 3 to 6, all of one length."""
    size = 2 * length + 1
    solid = np.zeros((size, size, size), dtype=bool)
    for arm in range(arms):
        place: list[slice | int] = [length, length, length]
        place[arm // 2] = slice(length, None) if arm % 2 == 0 else slice(None, length + 1)
        solid[tuple(place)] = True
    return voxels(solid.repeat(2, 0).repeat(2, 1).repeat(2, 2))


@pytest.mark.parametrize("arms", [3, 4, 5, 6])
def test_every_limb_has_its_endpoint(arms):
    features = rgpd.describe(Surface(star(arms)))
    assert features.shape == (arms, 3)
    # All limbs are alike; where they lie opposite each other the root is in the middle of them.
    np.testing.assert_allclose(features[:, 2], 1 / arms, atol=0.03 if arms % 2 == 0 else 0.3 / arms)


def test_the_two_ends_of_a_capsule():
    features = rgpd.describe(Surface(capsule()))
    np.testing.assert_allclose(features[:, 1:], [[1, 0.5], [1, 0.5]], atol=0.02)


def test_it_does_not_end_in_the_middle():
    for mesh in (torus(), icosphere(3)):
        assert np.isfinite(rgpd.describe(Surface(mesh))).all()
