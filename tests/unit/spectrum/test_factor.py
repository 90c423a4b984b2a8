"""The factorisation: solves, counts negative eigenvalues, keeps L sparse, and refuses what is singular."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from scipy.sparse import csr_matrix, diags_array

from reebase.errors import ComputationError
from reebase.mesh.mesh import Mesh
from reebase.spectrum import operator
from reebase.spectrum.factor import Elimination
from tests.shapes import capsule, grid, icosphere, joined, moved, permuted, tetrahedron, torus

HUB = Mesh(
    np.vstack([[[0, 0, 1]], np.stack([np.cos(np.arange(600) / 95), np.sin(np.arange(600) / 95), np.zeros(600)], 1)]),
    [[0, 1 + i, 2 + i] for i in range(599)],
)
"""A fan: one vertex beside all others."""

SHAPES = {
    "tetrahedron": tetrahedron(), "sphere": icosphere(3), "torus": torus(), "square": grid(25, 25), "hub": HUB,
    "two": joined(icosphere(2), moved(icosphere(2), [3, 0, 0])), "shuffled": permuted(capsule())[0],
    "one point": Mesh(np.zeros((162, 3)), icosphere(2).faces),
}  # fmt: skip


def stiff(mesh):
    """The graph's Laplacian, which any mesh has."""
    edges = np.vstack([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    m = len(mesh.vertices)
    A = csr_matrix((np.ones(2 * len(edges)), np.vstack([edges, edges[:, ::-1]]).T), shape=(m, m))
    A.sort_indices()
    return csr_matrix(diags_array(np.asarray(A.sum(axis=1)).ravel()) - A)


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("known", [True, False], ids=["points", "graph"])
@pytest.mark.parametrize("sigma", [-1e-3, 0.137, 2.2])
def test_solves_and_counts(name, known, sigma):
    mesh = SHAPES[name]
    C, m = stiff(mesh), len(mesh.vertices)
    factor = Elimination(C, mesh.vertices if known else None).factor(np.full(m, -sigma))
    random = np.random.default_rng(1)
    b, scale = random.standard_normal((7, m)), random.uniform(0.5, 2.0, m)
    x = factor.solve(b, scale) / scale
    np.testing.assert_allclose(x @ C.toarray() - sigma * x, b * scale, atol=1e-8)
    assert factor.negative == np.count_nonzero(scipy.linalg.eigvalsh(C.toarray()) < sigma)


def test_the_factor_of_a_surface_stays_sparse():
    """L has O(m log m) entries; m^2 / 2 without an order, and 100 per row by bands."""
    for mesh in (icosphere(4), permuted(icosphere(4))[0], grid(50, 50)):
        C = operator(mesh).C
        for points in (mesh.vertices, None):
            factor = Elimination(C, points).factor(np.ones(C.shape[0]))
            assert factor.entries < 80 * C.shape[0]


def test_vertices_that_lie_anywhere_do_not_fill_the_factor():
    """A sphere whose vertices were thrown about: its edges run across the whole, and planes cut thousands of them."""
    sphere = icosphere(4)
    thrown = np.random.default_rng(0).random(sphere.vertices.shape)
    assert Elimination(stiff(sphere), thrown).entries < 2 * Elimination(stiff(sphere), sphere.vertices).entries


def test_a_hub_does_not_fill_the_factor():
    assert Elimination(stiff(HUB), HUB.vertices).factor(np.ones(601)).entries < 40 * 601


def test_a_drum_with_two_hubs_does_not_fill_the_factor():
    """Two rims of 2,000 corners, a lid on each that meets in one of them: the first plane parts rim from rim."""
    n = 2000
    turn = 2 * np.pi * np.arange(n) / n
    rims = [np.column_stack([np.cos(turn), np.sin(turn), np.full(n, z)]) for z in (-1.0, 1.0)]
    i = np.arange(n)
    j = (i + 1) % n
    wall = np.concatenate([np.column_stack([i, j, j + n]), np.column_stack([i, j + n, i + n])])
    lid = np.column_stack([np.zeros(n - 2, int), i[1:-1], j[1:-1]])
    drum = Mesh(np.concatenate(rims), np.concatenate([wall, lid[:, ::-1], lid + n]))
    assert Elimination(operator(drum).C, drum.vertices).entries < 3 * len(drum.vertices) * np.log2(len(drum.vertices))


def test_a_factor_that_no_memory_holds_is_refused_before_it_is_made(monkeypatch):
    monkeypatch.setattr("reebase.spectrum.factor.MOST_ENTRIES", 100)
    with pytest.raises(ComputationError, match="100 are allowed"):
        Elimination(stiff(icosphere(2))).factor(np.ones(162))


def test_a_vertex_without_neighbours_is_singular():
    lonely = Mesh(np.concatenate([icosphere(2).vertices, [[9, 9, 9]]]), icosphere(2).faces)
    with pytest.raises(ComputationError, match="vertex 162"):
        Elimination(stiff(lonely), lonely.vertices).factor(np.append(np.ones(162), 0.0))
