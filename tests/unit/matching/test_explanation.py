"""The explanation of a match: its parts add up to D, and it is a one-to-one pairing."""

from __future__ import annotations

import json

import numpy as np
import pytest

from reebase.errors import UnknownName
from reebase.matching import MEASURES, Pair, Unmatched, dissimilarity, match

SIZES = [(0, 0), (0, 3), (3, 0), (1, 1), (4, 4), (3, 7), (7, 3), (20, 12)]


def drawn(n, m, seed=0):
    generator = np.random.default_rng([seed, n, m])
    return generator.random((n, 3)), generator.random((m, 3))


def parts(found):
    unmatched = (*found.unmatched_first, *found.unmatched_second)
    return sum(p.distance for p in found.pairs) + sum(u.charge for u in unmatched)


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize(("n", "m"), SIZES)
def test_the_parts_add_up(measure, n, m):
    a, b = drawn(n, m)
    found = match(a, b, measure)
    assert found.measure == measure
    assert found.dissimilarity == dissimilarity(a, b, measure)
    factor = max(n, m) if measure == "matching_mean" else 1
    assert parts(found) == pytest.approx(found.dissimilarity * factor, rel=1e-12)


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize(("n", "m"), SIZES)
def test_every_endpoint_appears_and_distances_are_those_of_the_rows_named(measure, n, m):
    a, b = drawn(n, m)
    found = match(a, b, measure)
    for pair in found.pairs:
        assert pair.distance == pytest.approx(np.linalg.norm(a[pair.first] - b[pair.second]), rel=1e-14)
    sides = [("first", a, found.unmatched_first), ("second", b, found.unmatched_second)]
    for side, features, chosen in sides:
        paired = [getattr(pair, side) for pair in found.pairs]
        assert {*paired, *(u.endpoint for u in chosen)} == set(range(len(features)))
        if measure == "literal":
            assert all(u.charge == 0 for u in chosen)
            continue
        assert len(paired) == len(set(paired)) == min(n, m)
        for one in chosen:
            assert one.charge == pytest.approx(np.linalg.norm(features[one.endpoint]), rel=1e-14)


@pytest.mark.parametrize("measure", ["matching", "matching_mean"])
def test_a_match_read_backwards_is_the_match_of_the_sets_swapped(measure):
    for n, m in SIZES:
        a, b = drawn(n, m)
        there, back = match(a, b, measure), match(b, a, measure)
        assert there.dissimilarity == back.dissimilarity
        assert {(p.first, p.second, p.distance) for p in there.pairs} == {
            (p.second, p.first, p.distance) for p in back.pairs
        }
        assert there.unmatched_first == back.unmatched_second


def test_pairs_name_the_rows_as_given_not_in_canonical_order():
    a = [[0.1, 0, 0], [0.9, 0, 0], [0.5, 0, 0]]
    b = [[0.52, 0, 0], [0.91, 0, 0]]
    for measure in ("matching", "greedy"):
        found = match(a, b, measure)
        assert [(p.first, p.second) for p in found.pairs] == [(1, 1), (2, 0)]
        assert found.unmatched_first == (Unmatched(0, pytest.approx(0.1)),)
        assert found.unmatched_second == ()


def test_equal_endpoints_are_paired_in_order():
    a = [[0.1, 0.2, 0.3]] * 3
    assert match(a, a).pairs == (Pair(0, 0, 0.0), Pair(1, 1, 0.0), Pair(2, 2, 0.0))


def test_literal_lists_all_pairs_and_says_so():
    found = match(*drawn(2, 3), "literal")
    assert [(p.first, p.second) for p in found.pairs] == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2)]
    assert "all pairs" in found.note


@pytest.mark.parametrize("measure", MEASURES)
def test_the_json_round_trips(measure):
    found = match(*drawn(3, 2), measure)
    record = json.loads(json.dumps(found.to_json()))
    assert record["dissimilarity"] == found.dissimilarity
    assert [Pair(**pair) for pair in record["pairs"]] == list(found.pairs)
    assert [Unmatched(**one) for one in record["unmatched_first"]] == list(found.unmatched_first)
    assert [Unmatched(**one) for one in record["unmatched_second"]] == list(found.unmatched_second)
    assert record["note"] == found.note


def test_an_unknown_measure_is_refused():
    with pytest.raises(UnknownName):
        match([], [], "best")
