"""The measures of D against straight loops, brute force and scipy's assignment."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.errors import ParameterError, UnknownName
from reebase.matching import MEASURES, dissimilarities, dissimilarity, measure_named
from tests.oracles import matching as oracle


def features(generator, count):
    return generator.random((count, 3)) * [0.1, 1.5, 0.4]


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize("seed", range(8))
def test_measures_equal_straight_loops(measure, seed):
    generator = np.random.default_rng(seed)
    for n in range(6):
        for m in range(6):
            a, b = features(generator, n), features(generator, m)
            expected = oracle.MEASURES[measure](a.tolist(), b.tolist())
            assert dissimilarity(a, b, measure) == pytest.approx(expected, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("seed", range(5))
def test_matching_is_the_least_of_all_partial_pairings(seed):
    generator = np.random.default_rng(seed)
    for n, m in [(0, 0), (0, 3), (1, 1), (2, 4), (4, 4), (5, 3)]:
        a, b = features(generator, n).tolist(), features(generator, m).tolist()
        least = oracle.brute_force(a, b)
        assert oracle.maximum_matching(a, b) == pytest.approx(least, rel=1e-12)
        assert oracle.free_matching(a, b) == pytest.approx(least, rel=1e-12)
        assert dissimilarity(a, b) == pytest.approx(least, rel=1e-12)


@pytest.mark.parametrize(("n", "m"), [(40, 40), (60, 25), (25, 60), (300, 300), (200, 350)])
def test_many_endpoints_equal_scipys_assignment(n, m):
    generator = np.random.default_rng(n + m)
    a, b = features(generator, n), features(generator, m)
    assert dissimilarity(a, b) == pytest.approx(oracle.maximum_matching(a, b), rel=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_ties_on_a_lattice_do_not_spoil_the_optimum(seed):
    generator = np.random.default_rng(seed)
    for _ in range(40):
        n, m = generator.integers(0, 9, size=2)
        a, b = (generator.integers(0, 3, size=(count, 3)) / 4 for count in (n, m))
        assert dissimilarity(a, b) == pytest.approx(oracle.maximum_matching(a, b), rel=1e-12, abs=1e-14)


def test_charges_decide_which_endpoint_of_the_larger_set_is_left_over():
    # By distance alone (0.5, 0, 0) goes with (0.4, 0, 0); then (0.7, 0, 0) would be left over, at 0.1 + 0.7.
    assert dissimilarity([[0.5, 0, 0]], [[0.4, 0, 0], [0.7, 0, 0]]) == pytest.approx(0.2 + 0.4)


def test_greedy_is_not_symmetric_and_never_below_matching():
    a = [[0.9, 0, 0], [0.5, 0, 0]]
    b = [[0.6, 0, 0], [0.1, 0, 0]]
    assert dissimilarity(a, b, "greedy") == pytest.approx(0.3 + 0.4)
    assert dissimilarity(a, [[0.8, 0, 0]], "greedy") == pytest.approx(0.1 + 0.5)
    # (0.5, 0.2, 0) comes first and takes the free one that (0.5, 0.3, 0) is nearer to.
    c, d = [[0.5, 0.2, 0], [0.5, 0.3, 0]], [[0.5, 0.25, 0], [0.5, 0, 0]]
    assert dissimilarity(c, d, "greedy") == pytest.approx(0.05 + 0.3)
    assert dissimilarity(d, c, "greedy") == pytest.approx(0.2 + 0.05)
    assert dissimilarity(c, d) == pytest.approx(0.2 + 0.05)


def test_literal_of_a_set_with_itself_is_not_zero():
    a = [[0.1, 0.2, 0.3], [0.1, 0.2, 0.7]]
    assert dissimilarity(a, a, "literal") == pytest.approx(0.8)


def test_empty_sets():
    a = [[0.3, 0, 0.4], [0, 1, 0]]
    for measure, one_empty in [("matching", 1.5), ("matching_mean", 0.75), ("greedy", 1.5), ("literal", 0)]:
        assert dissimilarity([], [], measure) == 0.0
        assert dissimilarity(a, [], measure) == pytest.approx(one_empty)
        assert dissimilarity([], a, measure) == pytest.approx(one_empty)


@pytest.mark.parametrize("measure", [name for name, measure in MEASURES.items() if measure.reflexive])
def test_the_dissimilarity_to_itself_is_exactly_zero(measure):
    generator = np.random.default_rng(0)
    for n in (1, 2, 7, 50):
        a = features(generator, n)
        a[n // 2 :] = a[: n - n // 2]
        assert dissimilarity(a, a[generator.permutation(n)], measure) == 0.0


@pytest.mark.parametrize("measure", MEASURES)
def test_one_with_many_has_the_bits_of_one_with_one(measure):
    generator = np.random.default_rng(1)
    sets = [features(generator, n) for n in generator.integers(0, 12, size=60)]
    offsets = np.cumsum([0, *map(len, sets)])
    for query in sets[:6]:
        found = dissimilarities(query, offsets, np.vstack(sets), measure)
        assert found.tolist() == [dissimilarity(query, other, measure) for other in sets]


def test_one_with_none():
    assert dissimilarities([[0.1, 0.2, 0.3]], [0], []).shape == (0,)


@pytest.mark.parametrize("offsets", [[], [0], [0, 1], [1, 2], [0, 3], [0, 2, 1, 2], [[0, 2]], [0, 2.7], ["0", "2"]])
def test_offsets_that_do_not_cover_the_rows_are_refused(offsets):
    with pytest.raises(ParameterError, match="offsets"):
        dissimilarities([[0.1, 0.2, 0.3]], offsets, np.ones((2, 3)))


def test_an_unknown_measure_is_refused_with_the_choices():
    for call in (lambda: dissimilarity([], [], "sum"), lambda: dissimilarities([], [0], [], "sum")):
        with pytest.raises(UnknownName, match="greedy, literal, matching, matching_mean"):
            call()


def test_measures_carry_the_codes_of_the_kernels():
    from reebase.matching import assignment_kernels as kernels

    for name in MEASURES:
        assert measure_named(name).code == getattr(kernels, name.upper())
        assert measure_named(name).to_json()["name"] == name


def test_read_only_features_do():
    a = np.ones((2, 3))
    a.flags.writeable = False
    assert dissimilarity(a, a) == 0.0
