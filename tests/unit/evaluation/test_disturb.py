"""Copies that are the same shape: what must not change does not, and what must change does."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.denoise.distance import distances_to_surface
from reebase.evaluation.collapse import decimated, remeshed
from reebase.evaluation.disturb import COPIES, DISTURBANCES
from reebase.mesh import Mesh, clean
from reebase.mesh.geometry import face_areas, mean_edge_length, signed_volume
from reebase.mesh.topology import edges
from tests.shapes import grid, icosphere, torus


def euler(mesh: Mesh) -> int:
    return len(mesh.vertices) - len(edges(mesh.faces)) + len(mesh.faces)


@pytest.mark.parametrize("which", ["half", "other"])
def test_fewer_or_other_triangles_on_the_same_closed_surface(which: str) -> None:
    mesh = torus(nu=36, nv=18)
    copy = decimated(mesh, 324) if which == "half" else remeshed(mesh, np.random.default_rng(0))
    assert len(copy.vertices) == (324 if which == "half" else 648)
    joined = edges(copy.faces)
    assert (joined.face_counts == 2).all()
    assert joined.oriented
    assert euler(copy) == 0
    assert distances_to_surface(copy.vertices, mesh).max() < 0.25 * mean_edge_length(mesh)
    assert face_areas(copy).sum() == pytest.approx(face_areas(mesh).sum(), rel=0.02)
    assert signed_volume(copy) == pytest.approx(signed_volume(mesh), rel=0.03)


def test_a_remeshed_surface_has_none_of_the_old_vertices() -> None:
    mesh = icosphere(3)
    copy = remeshed(mesh, np.random.default_rng(0))
    apart = np.linalg.norm(copy.vertices[:, None] - mesh.vertices[None], axis=2).min(axis=1)
    assert (apart < 0.01 * mean_edge_length(mesh)).mean() < 0.05


def test_a_plane_stays_plane_and_keeps_its_corners() -> None:
    copy = decimated(grid(10, 10), 40)
    assert len(copy.vertices) == 40
    assert np.abs(copy.vertices[:, 2]).max() < 1e-12
    assert face_areas(copy).sum() == pytest.approx(1, rel=1e-3)


def test_nothing_is_left_to_collapse_of_a_tetrahedron() -> None:
    assert len(decimated(icosphere(0), 1).vertices) == 4


@pytest.mark.parametrize("name", ["exported", "shuffled", "moved", "mirrored", "in_inches", "rescaled", "copies"])
def test_lengths_are_kept_up_to_one_factor(name: str) -> None:
    mesh = torus(nu=20, nv=10)
    copy = clean(DISTURBANCES[name](mesh, np.random.default_rng(2)))[0]
    times = COPIES if name == "copies" else 1
    assert len(copy.faces) == times * len(mesh.faces)
    factor = np.sqrt(face_areas(copy).sum() / times / face_areas(mesh).sum())
    if name not in {"in_inches", "rescaled"}:
        assert factor == pytest.approx(1, rel=1e-6)
    assert mean_edge_length(copy) == pytest.approx(factor * mean_edge_length(mesh), rel=1e-6)
    assert signed_volume(copy) == pytest.approx(times * factor**3 * signed_volume(mesh), rel=1e-5)


def test_each_is_the_same_for_the_same_seed() -> None:
    mesh = torus(nu=16, nv=8)
    for disturb in DISTURBANCES.values():
        first, second = (disturb(mesh, np.random.default_rng(7)) for _ in range(2))
        np.testing.assert_array_equal(first.vertices, second.vertices)
        np.testing.assert_array_equal(first.faces, second.faces)
