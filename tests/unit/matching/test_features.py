"""Endpoint features against closed forms and straight loops."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.errors import ComputationError, ParameterError, UnknownName
from reebase.matching import as_features, endpoint_features
from reebase.skeleton.graph import Skeleton
from tests.oracles import matching as oracle


def skeleton(positions, edges, root, areas=None, ring_areas=None):
    positions = np.asarray(positions, dtype=float)
    edges = np.asarray(edges, dtype=np.int32).reshape(-1, 2)
    count = len(positions)
    areas = np.ones(count) if areas is None else np.asarray(areas, dtype=float)
    degree = np.bincount(edges.ravel(), minlength=count)
    ends = np.flatnonzero(degree == 1)
    return Skeleton(
        positions=positions,
        areas=areas,
        ring_areas=areas / 10 if ring_areas is None else np.asarray(ring_areas, dtype=float),
        bands=np.zeros(count, dtype=np.int32),
        edges=edges,
        lengths=np.linalg.norm(positions[edges[:, 0]] - positions[edges[:, 1]], axis=1),
        endpoints=ends[np.argsort(-areas[ends], kind="stable")].astype(np.int32),
        root=root,
    )


def random_tree(seed, nodes=30, extra=4):
    """A tree with some cycles, embedded at random."""
    generator = np.random.default_rng(seed)
    edges = [(i, int(generator.integers(0, i))) for i in range(1, nodes)]
    inner = np.unique([b for _, b in edges])
    for _ in range(extra):
        a, b = sorted(map(int, generator.choice(inner, 2, replace=False)))
        if (b, a) not in edges and (a, b) not in edges:
            edges.append((a, b))
    return skeleton(
        generator.normal(size=(nodes, 3)), edges, int(generator.integers(0, nodes)),
        generator.random(nodes) + 0.1, generator.random(nodes),
    )  # fmt: skip


def test_a_star_of_equal_arms_in_closed_form():
    # Three arms of length 2 from the root: paths between ends are 4, from the root 2; sum from the root is 6.
    angles = 2 * np.pi * np.arange(3) / 3
    ends = 2 * np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    star = skeleton([[0, 0, 0], *ends], [(0, 1), (0, 2), (0, 3)], root=0, areas=[7, 1, 1, 1])
    np.testing.assert_allclose(endpoint_features(star), [[0.1, 8 / 6, 2 / 6]] * 3, rtol=1e-15)


def test_a_straight_line_in_closed_form():
    # Ends at distances 1 and 3 from the root, so 4 apart; the larger end comes first.
    line = skeleton([[0, 0, 0], [1, 0, 0], [4, 0, 0]], [(0, 1), (1, 2)], root=1, areas=[1, 5, 2])
    np.testing.assert_allclose(
        endpoint_features(line), [[2 / 8, 4 / 4, 3 / 4], [1 / 8, 4 / 4, 1 / 4]], rtol=1e-15
    )


def test_the_ring_area_is_that_of_the_extremal_vertex_over_the_whole_area():
    line = skeleton(
        [[0, 0, 0], [1, 0, 0], [4, 0, 0]], [(0, 1), (1, 2)], root=1, areas=[1, 5, 2], ring_areas=[0.4, 9, 0.8]
    )
    np.testing.assert_allclose(endpoint_features(line, area="ring")[:, 0], [0.1, 0.05], rtol=1e-15)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("area", ["band", "ring"])
def test_features_equal_straight_loops(seed, area):
    graph = random_tree(seed)
    found = endpoint_features(graph, area)
    np.testing.assert_allclose(found, oracle.endpoint_features(graph, area), rtol=1e-12)
    assert found[:, 2].sum() == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(4))
def test_features_do_not_depend_on_units_place_or_turn(seed):
    graph = random_tree(seed)
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    moved = skeleton(
        3.7 * graph.positions @ turn + [1, -2, 5], graph.edges, graph.root,
        3.7**2 * graph.areas, 3.7**2 * graph.ring_areas,
    )  # fmt: skip
    np.testing.assert_allclose(endpoint_features(moved), endpoint_features(graph), rtol=1e-12)


def test_an_edge_given_twice_counts_once():
    once = skeleton([[0, 0, 0], [1, 0, 0], [4, 0, 0]], [(0, 1), (1, 2)], root=1)
    twice = Skeleton(
        once.positions, once.areas, once.ring_areas, once.bands,
        np.array([(0, 1), (1, 0), (1, 2)], dtype=np.int32), np.array([1.0, 1.0, 3.0]), once.endpoints, 1,
    )  # fmt: skip
    np.testing.assert_array_equal(endpoint_features(twice), endpoint_features(once))


def test_nodes_at_one_place_are_connected_by_an_edge_of_length_zero():
    line = skeleton([[0, 0, 0], [1, 0, 0], [1, 0, 0], [4, 0, 0]], [(0, 1), (1, 2), (2, 3)], root=1)
    np.testing.assert_allclose(endpoint_features(line)[:, 1:], [[1, 1 / 4], [1, 3 / 4]], rtol=1e-15)


@pytest.mark.parametrize(
    "graph",
    [
        skeleton([[0, 0, 0]], [], root=0),
        skeleton([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [(0, 1), (1, 2), (2, 0)], root=0),
        skeleton([[0, 0, 0], [0, 0, 0]], [(0, 1)], root=0),
    ],
    ids=["single node", "cycle", "no path lengths"],
)
def test_without_endpoints_or_lengths_there_are_no_features(graph):
    assert endpoint_features(graph).shape == (0, 3)


def test_a_skeleton_in_two_pieces_is_refused():
    pieces = skeleton([[0, 0, 0], [1, 0, 0], [5, 0, 0], [6, 0, 0]], [(0, 1), (2, 3)], root=0)
    with pytest.raises(ComputationError, match="not connected"):
        endpoint_features(pieces)


def test_an_unknown_area_is_refused_with_the_choices():
    with pytest.raises(UnknownName, match="band, ring"):
        endpoint_features(random_tree(0), area="face")


@pytest.mark.parametrize(
    "value",
    [[1.0, 2.0, 3.0], [[1.0, 2.0]], np.ones((2, 3, 1)), [[0.1, np.nan, 0.2]], [[0.1, np.inf, 0.2]],
     [[0.1, 1e200, 0.2]], [[0.1, -1e-9, 0.2]], "abc", [["a", "b", "c"]], [[1.0, 2.0, 3.0], [1.0]], None],
    ids=["vector", "two columns", "axes", "nan", "inf", "overflow", "negative", "text", "letters", "ragged", "none"],
)  # fmt: skip
def test_what_are_not_endpoint_features_is_refused(value):
    with pytest.raises(ParameterError, match="the query must"):
        as_features(value, "the query")


@pytest.mark.parametrize("value", [[], [[]], np.empty((0, 3)), np.empty((0, 7))])
def test_nothing_stands_for_no_endpoints(value):
    assert as_features(value).shape == (0, 3)


def test_a_skeleton_stands_for_its_features():
    graph = random_tree(3)
    np.testing.assert_array_equal(as_features(graph), endpoint_features(graph))
