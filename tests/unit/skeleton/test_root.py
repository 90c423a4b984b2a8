"""The root: the median by its definition, in trees and in graphs with cycles; pose does not matter to it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.sparse import csgraph

from reebase import skeleton
from reebase.errors import UnknownName
from reebase.skeleton import Skeleton, root, rooted
from reebase.warm import sample
from tests.shapes import torus


def random_graph(seed: int, cycles: int, nodes: int = 40) -> Skeleton:
    random = np.random.default_rng(seed)
    tree = [(random.integers(0, node), node) for node in range(1, nodes)]
    more = {tuple(sorted(random.choice(nodes, 2, replace=False).tolist())) for _ in range(cycles)} - set(tree)
    return Skeleton.assembled(
        random.random((nodes, 3)), random.random(nodes), np.ones(nodes), np.zeros(nodes, np.int32),
        np.array([*tree, *sorted(more)], dtype=np.int32), 0,
    )  # fmt: skip


@pytest.mark.parametrize("cycles", [0, 3])
@pytest.mark.parametrize("seed", range(12))
def test_the_median_has_the_shortest_way_to_everything(seed: int, cycles: int) -> None:
    graph = random_graph(seed, cycles)
    reach = np.full((40, 40), np.inf)
    np.fill_diagonal(reach, 0)
    for (a, b), length in zip(graph.edges, graph.lengths, strict=True):
        reach[a, b] = reach[b, a] = length
    for middle in range(40):  # Floyd and Warshall
        reach = np.minimum(reach, reach[:, middle, None] + reach[None, middle])
    np.testing.assert_allclose(graph.path_lengths(np.arange(40)), reach)
    assert rooted(graph).root == int(np.argmin(reach @ graph.areas))


@pytest.mark.parametrize("seed", range(6))
def test_of_a_graph_with_many_cycles_few_nodes_are_measured(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    graph = random_graph(seed, 100, 600)
    sums = graph.path_lengths(np.arange(600)) @ graph.areas
    measured = []
    dijkstra = csgraph.dijkstra

    def counted(*args: Any, indices: Any, **options: Any) -> Any:
        measured.append(np.size(indices))
        return dijkstra(*args, indices=indices, **options)

    monkeypatch.setattr(csgraph, "dijkstra", counted)
    assert rooted(graph).root == int(np.argmin(sums))
    assert sum(measured) < 300
    assert max(measured) == 1


@pytest.mark.parametrize("seed", range(6))
def test_what_is_too_large_has_a_root_that_is_nearly_the_median(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    graph = random_graph(seed, 100, 600)
    sums = graph.path_lengths(np.arange(600)) @ graph.areas
    monkeypatch.setattr(root, "MOST_VISITS", 30 * 600)
    assert sums[rooted(graph).root] < 1.05 * sums.min()


def test_the_centroid_stays_by_name() -> None:
    graph = random_graph(1, 0)
    assert rooted(graph, "centroid") is graph
    mesh = sample()
    found = skeleton(mesh, root="centroid")
    nearest = np.linalg.norm(found.positions - found.centroid, axis=1)
    assert nearest[found.root] <= nearest.min() + 1e-3


def test_a_single_node_and_a_ring_have_a_root() -> None:
    one = Skeleton.assembled(np.zeros((1, 3)), np.ones(1), np.ones(1), np.zeros(1, np.int32), np.empty((0, 2), int), 0)
    assert rooted(one).root == 0
    ring = skeleton(torus(2.0, 0.5, 48, 16))
    assert 0 <= ring.root < len(ring.positions)


def test_another_root_is_refused() -> None:
    with pytest.raises(UnknownName):
        rooted(random_graph(0, 0), "tree")
