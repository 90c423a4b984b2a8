"""Medial surfaces of shapes whose middle is known, and thinning against what topology says."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import label
from scipy.sparse.csgraph import connected_components

from reebase.descriptors import Surface, ms
from reebase.descriptors.ms_kernels import outward_flux, part_of, thin
from reebase.mesh import Mesh
from reebase.mesh.geometry import face_areas
from tests.shapes import capsule, icosphere, moved, torus

CORNERS = np.ones((3, 3, 3))


def padded(solid: np.ndarray) -> np.ndarray:
    return np.pad(solid.astype(bool), 2)


def euler(solid: np.ndarray) -> int:
    """Cells of the union of closed voxels: corners - edges + faces - voxels."""
    grown = np.pad(solid, 1)
    total = 0
    for free in np.ndindex(2, 2, 2):  # along which axes the cell is thin
        cells = grown
        for axis, thin_axis in enumerate(free):
            if thin_axis:
                cells = np.maximum(np.take(cells, range(1, cells.shape[axis]), axis),
                                   np.take(cells, range(cells.shape[axis] - 1), axis))  # fmt: skip
        total += int(cells.sum()) * (-1) ** (3 - sum(free))
    return total


def thinned(solid: np.ndarray, kept: np.ndarray | None = None) -> np.ndarray:
    out = solid.copy()
    cells = np.argwhere(solid)
    thin(cells, np.zeros(len(cells), bool) if kept is None else kept[solid], out)
    return out


@pytest.mark.parametrize("seed", range(8))
def test_thinning_keeps_the_topology(seed):
    random = np.random.default_rng(seed)
    solid = padded(random.random((7, 8, 9)) < 0.6 + 0.04 * seed)
    found = thinned(solid)
    assert (found <= solid).all()
    assert euler(found) == euler(solid)
    assert label(found, CORNERS)[1] == label(solid, CORNERS)[1]
    assert label(~found)[1] == label(~solid)[1]
    np.testing.assert_array_equal(thinned(found), found)


def test_a_block_thins_to_a_voxel_and_a_ring_to_a_ring():
    assert thinned(padded(np.ones((5, 6, 7)))).sum() == 1
    ring = np.ones((9, 9, 3), dtype=bool)
    ring[3:6, 3:6] = False
    found = thinned(padded(ring))
    assert euler(found) == euler(padded(ring)) == 0
    assert found.sum() < 30
    corner = np.zeros_like(padded(ring))
    corner[2, 2, 2] = True
    assert thinned(padded(ring), corner)[2, 2, 2]


def test_flux_is_negative_in_the_middle_of_a_plate():
    from scipy.ndimage import distance_transform_edt

    plate = padded(np.ones((21, 21, 7)))
    nearest = distance_transform_edt(plate, return_distances=False, return_indices=True)
    cells = np.argwhere(plate)
    flux = np.full(plate.shape, np.nan)
    flux[plate] = outward_flux(cells, nearest, plate)
    middle = flux[12, 12, 2:-2]
    # Of the 9 neighbours on either side the cosines with the normal are 1, and four times 1 / sqrt 2 and 1 / sqrt 3.
    inward = 1 + 4 / np.sqrt(2) + 4 / np.sqrt(3)
    assert middle[3] == pytest.approx(-2 * inward / 26)
    np.testing.assert_allclose(middle[[1, 5]], 0.0, atol=1e-12)


def test_parts_end_where_it_narrows_and_meet_where_there_is_no_neck():
    def parts(radii):
        cells = np.array([[2, 2, 2 + i] for i in range(len(radii))])
        order = np.argsort(-np.array(radii), kind="stable")
        grid = np.full((5, 5, len(radii) + 4), -1, np.int32)
        grid[tuple(cells[order].T)] = np.arange(len(radii))
        found = np.empty(len(radii), int)
        found[order] = part_of(cells[order], np.array(radii, float)[order], grid, 0.6, 0.8)
        return np.unique(found, return_inverse=True)[1].tolist()

    assert len(set(parts([10, 9, 8, 7, 6]))) == 1
    assert parts([10, 8, 5, 4, 5]) in ([0, 0, 1, 1, 1], [1, 1, 0, 0, 0])
    assert len(set(parts([9, 8, 9]))) == 1
    assert len(set(parts([9, 7, 9]))) == 2


def of_two_balls() -> Mesh:
    """Balls of radii 1 and 0.8 at -2 and 2, and a rod of radius 0.3 between them."""
    z = np.linspace(-3, 2.8, 121)
    balls = [np.sqrt(np.maximum(r * r - (z - at) ** 2, 0)) for at, r in ((-2, 1), (2, 0.8))]
    radii = np.maximum(np.maximum(*balls), np.where(np.abs(z) < 2, 0.3, 0))
    rows, around = 120, 48
    angles = 2 * np.pi * np.arange(around) / around
    inner = np.stack([np.outer(radii[1:-1], np.cos(angles)), np.outer(radii[1:-1], np.sin(angles)),
                      np.repeat(z[1:-1, None], around, 1)], axis=-1).reshape(-1, 3)  # fmt: skip
    index = np.arange((rows - 1) * around).reshape(rows - 1, around) + 1
    right = np.roll(index, -1, axis=1)
    faces = [
        np.stack([index[:-1], right[:-1], index[1:]], -1).reshape(-1, 3),
        np.stack([right[:-1], right[1:], index[1:]], -1).reshape(-1, 3),
        np.stack([np.zeros(around, int), right[0], index[0]], -1),
        np.stack([np.full(around, len(inner) + 1), index[-1], right[-1]], -1),
    ]
    return Mesh(np.vstack([[0, 0, z[0]], inner, [0, 0, z[-1]]]), np.vstack(faces))


def test_two_balls_and_a_rod_are_three_parts_in_a_row():
    mesh = moved(of_two_balls(), (1, 2, 3), seed=4)
    size = np.sqrt(face_areas(mesh).sum())
    found = ms.medial_parts(mesh)
    large = np.argsort(-found.shares)[:3]
    # Near a ball's surface its voxels make small parts of their own: 0.16 of the volume at this resolution.
    np.testing.assert_allclose(found.shares[large], np.array([4.19, 2.14, 0.6]) / 6.9, atol=0.13)
    assert found.shares[large].sum() > 0.8
    rod = large[2]
    assert found.touch[rod].any()
    assert not found.touch[large[0], large[1]]
    assert connected_components(found.touch, directed=False)[0] == 1
    assert found.radii[rod] * size == pytest.approx(0.3, abs=0.09)  # a voxel is 0.08
    between = np.linalg.norm(found.centres[large[0]] - found.centres[large[1]]) * size
    assert between == pytest.approx(4, abs=0.2)


def test_the_middle_of_a_ball_of_a_ring_and_of_a_capsule():
    ball = ms.medial_parts(icosphere(4))
    assert ball.shares.max() == 1.0
    ring = ms.medial_parts(torus(1, 0.4))
    size = np.sqrt(face_areas(torus(1, 0.4)).sum())
    assert ring.radii[0] * size == pytest.approx(0.4, abs=0.07)  # a voxel is 0.06
    assert ring.spreads[0] * size == pytest.approx(1.0, abs=0.05)
    rod = ms.medial_parts(capsule(4, 0.5))
    assert rod.shares[0] > 0.99
    size = np.sqrt(face_areas(capsule(4, 0.5)).sum())
    assert rod.radii[0] * size == pytest.approx(0.5, abs=0.12)  # less towards its round ends


def test_nothing_enclosed_is_as_thick_as_its_voxels():
    triangle = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0]]), np.array([[0, 1, 2]]))
    rows = ms.describe(Surface(triangle))
    assert rows.shape == (1, 6)
    assert np.isfinite(rows).all()
