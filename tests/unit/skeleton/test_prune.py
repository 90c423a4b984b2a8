"""Pruning: equal to a loop that looks at everything each round, and its stated invariants."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.errors import ParameterError, UnknownName
from reebase.skeleton import SALIENCIES, Skeleton, prune, prune_to, reeb_graph
from tests.oracles import reeb as oracle
from tests.shapes import icosphere, torus


def graph_of(edges, areas=None, positions=None, seed=0):
    random = np.random.default_rng(seed)
    n = int(np.max(edges)) + 1
    areas = random.random(n) if areas is None else np.asarray(areas, float)
    positions = random.standard_normal((n, 3)) if positions is None else np.asarray(positions, float)
    return Skeleton.assembled(
        positions, areas, np.arange(n) / n, np.arange(n, dtype=np.int32), np.array(edges, np.int32), root=0
    )


def random_graph(seed):
    """A tree with long and short branches, then a few cycles."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, 60))
    reach = int(random.integers(1, 8))
    edges = {(int(random.integers(max(0, i - reach), i)), i) for i in range(1, n)}
    for _ in range(seed % 3):
        a, b = sorted(random.integers(0, n, 2).tolist())
        if a < b:
            edges.add((a, b))
    return graph_of(sorted(edges), seed=seed)


@pytest.mark.parametrize("saliency", SALIENCIES)
@pytest.mark.parametrize("threshold", [0.01, 0.05, 0.2, 0.9])
@pytest.mark.parametrize("seed", range(25))
def test_equals_the_loop_that_looks_at_everything(seed, threshold, saliency):
    graph = random_graph(seed)
    kept = oracle.prune(graph.areas.tolist(), graph.edges.tolist(), graph.lengths.tolist(), threshold, saliency)
    pruned = prune(graph, threshold, saliency)
    np.testing.assert_array_equal(pruned.positions, graph.positions[sorted(kept)])
    np.testing.assert_allclose(pruned.areas, [kept[node] for node in sorted(kept)], rtol=1e-12)
    np.testing.assert_array_equal(pruned.ring_areas, graph.ring_areas[sorted(kept)])
    assert pruned.areas.sum() == pytest.approx(graph.areas.sum(), rel=1e-12)
    assert pruned.cycles == graph.cycles
    assert len(pruned.endpoints) >= min(2, len(graph.endpoints))
    again = prune(pruned, threshold, "area")
    assert saliency == "length" or len(again.areas) == len(pruned.areas)


STAR = [[0, 1], [0, 2], [0, 3], [3, 4]]
"""Three arms at node 0, the last of two nodes."""


def test_the_smallest_branch_goes_and_its_area_goes_to_the_junction():
    graph = graph_of(STAR, areas=[10, 4, 1, 1, 0.5])
    pruned = prune(graph, 0.07)
    np.testing.assert_array_equal(pruned.areas, [11, 4, 1, 0.5])
    np.testing.assert_array_equal(pruned.edges, [[0, 1], [0, 2], [2, 3]])
    np.testing.assert_array_equal(pruned.bands, [0, 1, 3, 4])


def test_the_threshold_itself_stays():
    graph = graph_of(STAR, areas=[4, 2, 1, 0.5, 0.5])
    assert prune(graph, 1 / 8) is graph
    assert len(prune(graph, 1 / 8 + 1e-9).endpoints) == 2


def test_a_junction_that_dissolves_lets_the_branch_grow():
    """Two twigs on a twig: the pair is one branch of twice the area once one of them is gone."""
    edges = [[0, 1], [0, 2], [0, 3], [3, 4], [3, 5]]
    areas = [50, 20, 20, 6, 1, 3]
    assert len(prune(graph_of(edges, areas), 0.02).endpoints) == 3
    assert prune(graph_of(edges, areas), 0.05).areas.tolist() == [50, 20, 20, 7, 3]
    assert prune(graph_of(edges, areas), 0.11).areas.tolist() == [60, 20, 20]


def test_length_counts_the_edge_to_the_junction():
    positions = [[0, 0, 0], [5, 0, 0], [-4, 0, 0], [0, 1, 0]]
    graph = graph_of([[0, 1], [0, 2], [0, 3]], areas=[1, 1, 1, 100], positions=positions)
    assert len(prune(graph, 0.1, "length").endpoints) == 3
    pruned = prune(graph, 0.100001, "length")
    np.testing.assert_array_equal(pruned.positions, positions[:3])


def test_the_last_two_endpoints_and_cycles_stay():
    path = graph_of([[0, 1], [1, 2]])
    assert prune(path, 0.99) is path
    lollipop = graph_of([[0, 1], [1, 2], [2, 0], [2, 3]])
    assert prune(lollipop, 0.99) is lollipop
    ring = reeb_graph(torus(), torus().vertices[:, 0], 16)
    assert prune(ring, 0.99).cycles == 1
    point = reeb_graph(torus(), np.ones(len(torus().vertices)))
    assert prune(point, 0.5) is point
    loop = graph_of([[0, 1], [1, 2], [2, 0]])
    assert prune(loop, 0.5) is loop


def test_the_root_stays_or_moves_to_the_nearest_to_the_centroid_of_all():
    positions = [[0, 0, 0], [5, 0, 0], [-5, 0, 0], [0, 1, 0]]
    graph = graph_of([[0, 1], [0, 2], [0, 3]], areas=[1, 9, 9, 1], positions=positions)
    assert prune(graph, 0.2).root == 0
    moved = Skeleton.assembled(graph.positions, graph.areas, graph.ring_areas, graph.bands, graph.edges, root=3)
    assert prune(moved, 0.2).root == 0


def test_endpoints_come_by_decreasing_area_then_length_then_index():
    positions = [[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3], [0, 0, -3]]
    graph = graph_of([[0, 1], [0, 2], [0, 3], [0, 4]], areas=[1, 7, 5, 5, 5], positions=positions)
    assert graph.endpoints.tolist() == [1, 3, 4, 2]
    assert graph.endpoints.dtype == np.int32


def test_nothing_is_salient_enough_on_a_rough_field_but_two_endpoints():
    mesh = icosphere(3)
    rough = reeb_graph(mesh, np.random.default_rng(0).standard_normal(len(mesh.vertices)), 64)
    assert len(rough.endpoints) > 20
    assert len(prune(rough, 0.999).endpoints) == 2


@pytest.mark.parametrize("threshold", [-0.1, 1.0, 7, float("nan")])
def test_refuses_a_threshold_that_is_no_share(threshold):
    with pytest.raises(ParameterError, match="threshold"):
        prune(graph_of(STAR), threshold)


def test_refuses_an_unknown_saliency():
    with pytest.raises(UnknownName, match="area, length"):
        prune(graph_of(STAR), 0.1, "beauty")


@pytest.mark.parametrize("seed", range(25))
def test_pruned_to_its_ends_it_has_no_other(seed):
    graph = random_graph(seed)
    random = np.random.default_rng(seed)
    ends = random.permutation(graph.endpoints)[: max(2, len(graph.endpoints) // 2)]
    if len(ends) < 2:
        return
    found = prune_to(graph, ends)
    np.testing.assert_array_equal(found.positions[found.endpoints], graph.positions[ends])
    leaves = np.flatnonzero(found.degrees == 1)
    assert set(leaves) == set(found.endpoints)
    assert found.cycles == graph.cycles
    assert found.areas.sum() == pytest.approx(graph.areas.sum())
    # Leaf by leaf, whichever comes first, leaves the same.
    edges = {tuple(edge) for edge in graph.edges.tolist()}
    while stray := [n for n in {n for e in edges for n in e} - set(ends.tolist()) if sum(n in e for e in edges) == 1]:
        edges = {edge for edge in edges if stray[0] not in edge}
    assert found.lengths.sum() == pytest.approx(sum(np.linalg.norm(np.subtract(*graph.positions[[*e]])) for e in edges))


def test_a_single_end_keeps_the_path_to_the_lowest_band():
    graph = graph_of([[0, 1], [1, 2], [2, 3], [2, 4], [4, 5]])
    found = prune_to(graph, [5])
    np.testing.assert_array_equal(found.positions, graph.positions[[0, 1, 2, 4, 5]])
    np.testing.assert_array_equal(found.endpoints, [4])
    assert found.areas[2] == graph.areas[2] + graph.areas[3]


@pytest.mark.parametrize("ends", [[], [0, 0], [6], [-1]])
def test_what_is_no_end_is_refused(ends):
    with pytest.raises(ParameterError, match="0 to 5"):
        prune_to(graph_of([[0, 1], [1, 2], [2, 3], [2, 4], [4, 5]]), ends)
