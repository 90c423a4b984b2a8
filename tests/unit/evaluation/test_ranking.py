"""Measures of one ranked list, worked by hand and from the literature."""

from __future__ import annotations

from math import log2

import numpy as np
import pytest

from reebase.evaluation import ranking


def ranks(*relevant, of):
    found = np.zeros(of, dtype=bool)
    found[np.array(relevant, dtype=int) - 1] = True
    return found


def test_a_list_worked_by_hand():
    found = ranks(1, 3, of=5)
    np.testing.assert_allclose(ranking.precision(found), [1, 1 / 2, 2 / 3, 2 / 4, 2 / 5])
    np.testing.assert_allclose(ranking.recall(found), [1 / 2, 1 / 2, 1, 1, 1])
    assert ranking.nearest_neighbour(found) == 1
    assert ranking.tier(found, 1) == 1 / 2
    assert ranking.tier(found, 2) == 1
    assert ranking.e_measure(found) == pytest.approx(2 / (5 / 2 + 1))
    assert ranking.average_precision(found) == pytest.approx((1 + 2 / 3) / 2)
    assert ranking.discounted_gain(found) == pytest.approx((1 + 1 / log2(3)) / 2)
    np.testing.assert_allclose(ranking.interpolated_precision(found, 2), [1, 1, 2 / 3])


def test_the_eleven_points_of_a_published_list():
    # Baeza-Yates and Ribeiro-Neto, Modern Information Retrieval, 1999, section 3.2: relevant at 3, 8, 15
    # give 33.3 % up to recall 0.3, 25 % up to 0.6 and 20 % up to 1.
    found = ranking.interpolated_precision(ranks(3, 8, 15, of=15), 10)
    np.testing.assert_allclose(found, [1 / 3] * 4 + [1 / 4] * 3 + [1 / 5] * 4)


def test_interpolation_looks_ahead():
    np.testing.assert_allclose(ranking.interpolated_precision(ranks(3, 4, 5, of=6), 3), [3 / 5] * 4)


def test_recall_levels_are_not_moved_by_rounding():
    # 0.7 * 10 is 7.000000000000001 in floating point, which would ask for the eighth shape.
    found = ranks(*range(1, 8), 20, 30, 40, of=50)
    assert ranking.interpolated_precision(found, 10)[7] == 1.0


@pytest.mark.parametrize("total", [1, 2, 7, 40])
def test_a_perfect_list(total):
    found = ranks(*range(1, total + 1), of=60)
    for value in (
        ranking.nearest_neighbour(found), ranking.tier(found, 1), ranking.tier(found, 2),
        ranking.average_precision(found), ranking.discounted_gain(found),
    ):  # fmt: skip
        assert value == pytest.approx(1.0, rel=1e-15)
    np.testing.assert_array_equal(ranking.interpolated_precision(found, 10), 1.0)
    p, r = min(total, 32) / 32, min(32 / total, 1)
    assert ranking.e_measure(found) == pytest.approx(2 / (1 / p + 1 / r))


def test_the_worst_list():
    found = ranks(99, 100, of=100)
    for value in (
        ranking.nearest_neighbour(found), ranking.tier(found, 1), ranking.tier(found, 2),
        ranking.e_measure(found),
    ):  # fmt: skip
        assert value == 0.0
    assert ranking.average_precision(found) == pytest.approx((1 / 99 + 2 / 100) / 2)
    assert ranking.discounted_gain(found) == pytest.approx((1 / log2(99) + 1 / log2(100)) / 2)


def test_the_second_place_has_the_discount_of_the_first():
    # log2(2) = 1, in the formula of the Princeton Shape Benchmark.
    assert ranking.discounted_gain(ranks(2, of=9)) == 1.0


@pytest.mark.parametrize("found", [np.zeros(4, dtype=bool), np.zeros(0, dtype=bool)])
def test_nothing_relevant_scores_nothing(found):
    for measure in (ranking.nearest_neighbour, ranking.e_measure, ranking.average_precision):
        assert measure(found) == 0.0
    assert ranking.discounted_gain(found) == ranking.tier(found, 1) == 0.0
    np.testing.assert_array_equal(ranking.interpolated_precision(found, 10), np.zeros(11))
    np.testing.assert_array_equal(ranking.recall(found), np.zeros(len(found)))
