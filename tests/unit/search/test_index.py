"""The index against the obvious loop: compare all, filter, sort."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from reebase.errors import ParameterError, UnknownName
from reebase.matching import MEASURES, dissimilarity
from reebase.search import Hit, Index


def drawn(count, seed=0, most=7):
    generator = np.random.default_rng(seed)
    return {
        f"s{i:05}": generator.random((generator.integers(0, most + 1), 3)) * [0.1, 1.5, 0.4]
        for i in generator.permutation(count)
    }


def filled(shapes):
    index = Index()
    for name, features in shapes.items():
        index.add(name, features)
    return index


def loop(shapes, query, *, k=10, tolerance=2, measure="matching", among=None, max_dissimilarity=None):
    hits = [
        Hit(name, dissimilarity(query, features, measure), len(features))
        for name, features in shapes.items()
        if (tolerance is None or abs(len(features) - len(query)) <= tolerance)
        and (among is None or name in among)
    ]
    if max_dissimilarity is not None:
        hits = [hit for hit in hits if hit.dissimilarity <= max_dissimilarity]
    return sorted(hits, key=lambda hit: (hit.dissimilarity, hit.id))[:k]


@pytest.fixture(scope="module")
def shapes():
    return drawn(1500)


@pytest.fixture(scope="module")
def index(shapes):
    return filled(shapes)


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("tolerance", [None, 0, 2])
@pytest.mark.parametrize("k", [1, 10, 100_000])
def test_queries_equal_the_loop(shapes, index, measure, tolerance, k):
    among = frozenset(list(shapes)[::5])
    for count in (0, 1, 4, 9):
        query = np.random.default_rng(count).random((count, 3))
        for options in ({}, {"among": among}, {"max_dissimilarity": 0.9}):
            asked = {"k": k, "tolerance": tolerance, "measure": measure, **options}
            assert index.query(query, **asked) == loop(shapes, query, **asked)


def test_the_nearest_of_a_shape_in_the_index_is_itself_at_zero(shapes, index):
    for name in list(shapes)[:40]:
        if len(shapes[name]):
            assert index.query(shapes[name], k=1) == [Hit(name, 0.0, len(shapes[name]))]


def test_equally_near_shapes_come_by_id_even_across_the_cut():
    one, other = np.full((3, 3), 0.2), np.full((4, 3), 0.2)
    names = [f"{i:03}" for i in np.random.default_rng(0).permutation(300)]
    index = filled(dict.fromkeys(names, one) | dict.fromkeys([f"x{name}" for name in names], other))
    assert [hit.id for hit in index.query(one, k=7)] == [f"{i:03}" for i in range(7)]
    assert [hit.id for hit in index.query(other, k=2, tolerance=None)] == ["x000", "x001"]


def test_shapes_without_endpoints_are_found_by_their_like():
    index = filled({"b": [], "a": [], "c": [[0.1, 0.2, 0.3]], "d": [[0.1, 0.2, 0.3]] * 4})
    hits = index.query([])
    assert [(hit.id, hit.endpoint_count) for hit in hits] == [("a", 0), ("b", 0), ("c", 1)]
    assert [hit.dissimilarity for hit in hits] == pytest.approx([0, 0, np.sqrt(0.14)])


def test_an_empty_index_finds_nothing():
    index = Index()
    assert index.query([[0.1, 0.2, 0.3]], tolerance=None) == []
    assert (len(index), index.counts()) == (0, {})
    assert index.query([[0.1, 0.2, 0.3]], among=frozenset()) == []


def test_any_order_of_adding_removing_and_replacing_ends_in_the_same_answers(shapes):
    generator = np.random.default_rng(5)
    index, kept = filled(shapes), dict(shapes)
    for name in generator.permutation(list(shapes))[:900]:
        assert index.remove(str(name))
        assert not index.remove(str(name))
        del kept[str(name)]
    for name in generator.permutation(list(shapes))[:500]:
        kept[str(name)] = generator.random((generator.integers(0, 8), 3))
        index.add(str(name), kept[str(name)])
    assert len(index) == len(kept)
    assert sum(index.counts().values()) == len(kept)
    for name, features in kept.items():
        assert name in index
        np.testing.assert_array_equal(index.features_of(name), features)
    query = generator.random((4, 3))
    for k in (10, 100_000):
        assert index.query(query, k=k, tolerance=None) == loop(kept, query, k=k, tolerance=None)


def test_what_is_added_is_copied_and_what_is_given_out_too():
    mine = np.full((2, 3), 0.5)
    index = filled({"a": mine})
    mine[:] = 0.1
    index.features_of("a")[:] = 0.2
    np.testing.assert_array_equal(index.features_of("a"), np.full((2, 3), 0.5))


def test_counts_and_considered(shapes, index):
    counts = index.counts()
    assert list(counts) == sorted(counts)
    assert counts == {n: sum(len(f) == n for f in shapes.values()) for n in range(8)}
    assert index.considered(3, tolerance=1) == {n: counts[n] for n in (2, 3, 4)}
    assert index.considered(20) == {}
    assert index.considered(20, tolerance=None) == counts
    some = frozenset(list(shapes)[:10])
    assert sum(index.considered(3, tolerance=None, among=some | {"unknown"}).values()) == 10


@pytest.mark.parametrize(
    ("options", "parameter"),
    [({"k": 0}, "k"), ({"k": -1}, "k"), ({"k": 2.5}, "k"),
     ({"tolerance": -1}, "tolerance"), ({"tolerance": np.nan}, "tolerance"),
     ({"max_dissimilarity": -0.1}, "max_dissimilarity"),
     ({"max_dissimilarity": np.nan}, "max_dissimilarity")],
)  # fmt: skip
def test_senseless_questions_are_refused(index, options, parameter):
    with pytest.raises(ParameterError) as refusal:
        index.query([[0.1, 0.2, 0.3]], **options)
    assert refusal.value.details["parameter"] == parameter


def test_unknown_names_are_refused(index):
    with pytest.raises(UnknownName):
        index.query([], measure="nearest")
    with pytest.raises(UnknownName, match="nobody"):
        index.features_of("nobody")
    with pytest.raises(ParameterError):
        index.add("bad", [[1.0, 2.0]])
    assert "bad" not in index


def test_readers_see_whole_snapshots_while_writers_write():
    # "pair" is replaced again and again; a reader must find it once, never in both versions or in none.
    steady = drawn(200, seed=1)
    index = filled(steady)
    versions = [np.full((3, 3), 0.2), np.full((4, 3), 0.2)]
    index.add("pair", versions[0])
    stop, wrong = threading.Event(), []

    def write():
        for turn in range(400):
            index.add("pair", versions[turn % 2])
            index.add(f"new{turn:03}", np.full((3, 3), 5.0))
            if turn >= 5:
                index.remove(f"new{turn - 5:03}")
        stop.set()

    def read():
        while not stop.is_set():
            hits = index.query(versions[0], k=100_000, tolerance=None)
            names = [hit.id for hit in hits]
            if names.count("pair") != 1 or len(set(names)) != len(names) or not set(steady) <= set(names):
                wrong.append(names)

    threads = [threading.Thread(target=target) for target in (write, read, read)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
    assert len(index) == 200 + 1 + 5
