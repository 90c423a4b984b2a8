"""Boundaries that lie on each other but for rounding are one; all others stay."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.mesh.clean import clean
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read
from reebase.mesh.write import to_bytes
from tests.shapes import capsule, grid, icosphere, joined, moved, soup, torus


def shaken(mesh: Mesh, size: float) -> Mesh:
    """Every vertex moved by up to ``size`` along each axis."""
    noise = np.random.default_rng(0).uniform(-size, size, mesh.vertices.shape)
    return Mesh(mesh.vertices + noise, mesh.faces)


@pytest.mark.parametrize("mesh", [icosphere(2), torus(), capsule()])
@pytest.mark.parametrize("size", [1e-16, 1e-12, 1e-8])
def test_a_soup_whose_corners_differ_in_their_last_digits_is_closed(mesh: Mesh, size: float) -> None:
    whole, expected = clean(mesh)
    cleaned, health = clean(shaken(soup(mesh), size))
    assert health.closed and health.components == 1
    assert (health.vertices, health.faces, health.genus) == (len(whole.vertices), len(whole.faces), expected.genus)
    repairs = health.repairs
    assert repairs.get("merged_vertices", 0) + repairs["sewn_vertices"] == 3 * len(mesh.faces) - len(mesh.vertices)
    assert clean(cleaned)[1].repairs == {}


def test_text_of_seven_digits_far_from_the_origin() -> None:
    mesh = moved(icosphere(2), np.array([300.0, -200.0, 100.0]))
    cleaned, health = clean(shaken(read(to_bytes(mesh, "stl"), "stl"), 1e-5))
    assert health.closed and len(cleaned.vertices) == len(mesh.vertices)


@pytest.mark.parametrize("gap", [1e-4, 1e-2])
def test_gaps_that_can_be_seen_stay(gap: float) -> None:
    sheet = grid(4, 5)
    apart = joined(sheet, moved(sheet, np.array([0.0, 0.0, gap])))
    cleaned, health = clean(apart)
    assert np.array_equal(cleaned.vertices, apart.vertices) and np.array_equal(cleaned.faces, apart.faces)
    assert health.repairs == {}


def test_a_small_feature_at_a_boundary_stays() -> None:
    """A flap far smaller than single precision: its own corners are not merged."""
    sheet = grid(4, 5)
    a, b = sheet.vertices[0], sheet.vertices[1]
    small = a + 1e-8 * (b - a)
    vertices = np.vstack([sheet.vertices, small, small + np.array([0.0, 0.0, 1e-8])])
    count = len(sheet.vertices)
    cleaned, health = clean(Mesh(vertices, np.vstack([sheet.faces, [[0, count, count + 1]]])))
    assert "sewn_vertices" not in health.repairs
    assert len(cleaned.vertices) == len(vertices)


def test_nothing_is_sewn_where_an_edge_would_get_three_faces() -> None:
    page = Mesh(np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0.0]]), np.array([[0, 1, 2]]))
    turned = [page.vertices @ [[np.cos(t), 0, np.sin(t)], [0, 1, 0], [-np.sin(t), 0, np.cos(t)]] for t in (0, 2, 4)]
    book = joined(*(Mesh(one + 1e-12 * i, page.faces) for i, one in enumerate(turned)))
    _, health = clean(book)
    assert health.non_manifold_edges == 0
    assert health.components == 3
