"""The skeleton of ``extended``: its endpoints are the rows that are matched."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.descriptors import Surface, descriptor_named, limb_skeleton
from reebase.mesh import Mesh
from tests.shapes import capsule, icosphere, torus, voxels


def cross() -> Mesh:
    """Four bars that meet at right angles, of lengths 5, 6, 7 and 8."""
    solid = np.zeros((13, 15, 1), dtype=bool)
    solid[:, 8, 0] = solid[5, :, 0] = True
    return voxels(solid.repeat(2, 0).repeat(2, 1).repeat(2, 2))


@pytest.mark.parametrize("mesh", [cross(), capsule(), torus(), icosphere(2)], ids=["cross", "capsule", "torus", "ball"])
def test_its_endpoints_are_those_of_extended_in_their_order(mesh):
    surface = Surface(mesh)
    graph = limb_skeleton(surface)
    places = descriptor_named("extended").place(surface)
    assert len(graph.endpoints) == len(places)
    assert graph.areas.sum() == pytest.approx(surface.operator.area)
    assert graph.cycles == (1 if len(mesh.vertices) == len(torus().vertices) else 0)
    if graph.cycles == 0 and len(places) > 1:
        np.testing.assert_array_equal(np.sort(graph.endpoints), np.flatnonzero(graph.degrees == 1))


def test_limbs_end_at_their_tips_and_meet_in_the_middle():
    surface = Surface(cross())
    graph = limb_skeleton(surface)
    places = descriptor_named("extended").place(surface)
    assert len(places) == 4
    # An end is the middle of the last slice of its bar, which is 2 wide.
    np.testing.assert_allclose(graph.positions[graph.endpoints], places, atol=2.0)
    junction = graph.positions[graph.degrees > 2]
    assert (np.abs(junction - [11, 17, 1]).max(axis=1) < 3).any()
