"""Leave-one-out evaluation against straight loops, hand-worked figures and what chance gives."""

from __future__ import annotations

import json
from math import log2

import numpy as np
import pytest

from reebase.errors import ParameterError
from reebase.evaluation import SCORES, dissimilarity_matrix, evaluate
from tests.oracles import evaluation as oracle


def drawn(seed, sizes=(7, 4, 2, 1, 3), unlabelled=2, values=12):
    """An asymmetric matrix with many ties, classes of several sizes, some without label, ids out of order."""
    generator = np.random.default_rng(seed)
    labels = [f"class{c}" for c, size in enumerate(sizes) for _ in range(size)] + [None] * unlabelled
    labels = [labels[i] for i in generator.permutation(len(labels))]
    ids = [f"{i:03}" for i in generator.permutation(len(labels))]
    return generator.integers(0, values, (len(labels), len(labels))).astype(float), labels, ids


@pytest.mark.parametrize("seed", range(10))
def test_evaluation_equals_straight_loops(seed):
    D, labels, ids = drawn(seed)
    found, expected = evaluate(D, labels, ids, bootstrap=0), oracle.evaluate(D.tolist(), labels, ids)
    for part in ("overall", "class_mean"):
        assert dict(getattr(found, part)) == pytest.approx(expected[part], rel=1e-12)
    assert set(found.per_class) == set(expected["per_class"])
    for label, means in found.per_class.items():
        assert dict(means) == pytest.approx(expected["per_class"][label], rel=1e-12)
    curve = found.precision_recall
    np.testing.assert_allclose(curve.precision, expected["precision"], rtol=1e-12)
    np.testing.assert_allclose(curve.eleven_point, expected["eleven_point"], rtol=1e-12)
    np.testing.assert_allclose(curve.recall, np.arange(1, 7) / 6)


def test_six_shapes_worked_by_hand():
    # On a line; A at 0, 1, 10, B at 2, 3, C at 11. From 1, A at 0 and B at 2 are equally near, from 2, A at 1
    # and B at 3: A comes first by id. Lists, 1 = relevant: 10010 10010 00011 / 01000 10000.
    places = np.array([0, 1, 10, 2, 3, 11])
    D = np.abs(places[:, None] - places[None])
    found = evaluate(D, ["A", "A", "A", "B", "B", "C"], ["a", "b", "c", "d", "e", "f"])
    assert found.queries.tolist() == [0, 1, 2, 3, 4]
    expected = {
        "nn": [1, 1, 0, 0, 1],
        "first_tier": [1 / 2, 1 / 2, 0, 0, 1],
        "second_tier": [1, 1, 1 / 2, 1, 1],
        "e_measure": [4 / 7, 4 / 7, 4 / 7, 1 / 3, 1 / 3],
        "dcg": [3 / 4, 3 / 4, (1 / 2 + 1 / log2(5)) / 2, 1, 1],
        "map": [3 / 4, 3 / 4, (1 / 4 + 2 / 5) / 2, 1 / 2, 1],
    }
    for name, values in expected.items():
        np.testing.assert_allclose(found.scores[name], values, rtol=1e-14)
        assert found.overall[name] == pytest.approx(sum(values) / 5)
        assert found.class_mean[name] == pytest.approx((sum(values[:3]) / 3 + sum(values[3:]) / 2) / 2)
        assert found.per_class["B"][name] == pytest.approx(sum(values[3:]) / 2)
    assert found.left_out == ("C",)
    np.testing.assert_allclose(found.precision_recall.recall, [1 / 2, 1])
    np.testing.assert_allclose(found.precision_recall.precision, [0.78, 0.58])


def test_a_perfect_matrix():
    labels = [c for c in "abcde" for _ in range(9)]
    D = np.array([[float(x != y) for y in labels] for x in labels])
    found = evaluate(D, labels)
    for name in set(SCORES) - {"e_measure"}:
        assert found.overall[name] == pytest.approx(1.0)
        assert found.intervals[name] == pytest.approx((1.0, 1.0))
    assert found.overall["e_measure"] == pytest.approx(2 / (32 / 8 + 1))
    np.testing.assert_array_equal(found.precision_recall.precision, np.ones(8))
    np.testing.assert_array_equal(found.precision_recall.eleven_point, np.ones(11))


def test_chance_finds_the_share_of_the_class():
    # Of 199 others 9 are relevant, so each rank is relevant with probability 9 / 199, whatever the class.
    generator = np.random.default_rng(0)
    labels = [str(i % 20) for i in range(200)]
    runs = [evaluate(generator.random((200, 200)), labels, bootstrap=0).overall for _ in range(20)]
    prior = 9 / 199
    # Standard errors over 4000 queries: about 0.0033, 0.0011 and 0.0015.
    assert np.mean([run["nn"] for run in runs]) == pytest.approx(prior, abs=0.012)
    assert np.mean([run["first_tier"] for run in runs]) == pytest.approx(prior, abs=0.004)
    assert np.mean([run["second_tier"] for run in runs]) == pytest.approx(2 * prior, abs=0.005)


def test_only_the_order_within_a_row_counts():
    D, labels, ids = drawn(3, values=10_000)
    found = evaluate(D, labels, ids)
    scaled = np.random.default_rng(0).random((len(D), 1)) * np.sqrt(D) + 5
    np.fill_diagonal(scaled, 1e9)
    assert evaluate(scaled, labels, ids).to_json() == found.to_json()


def test_the_order_of_the_shapes_does_not_matter():
    D, labels, ids = drawn(4)
    order = np.random.default_rng(0).permutation(len(D))
    shuffled = evaluate(
        D[np.ix_(order, order)], [labels[i] for i in order], [ids[i] for i in order], bootstrap=0
    )
    found = evaluate(D, labels, ids, bootstrap=0)
    assert dict(shuffled.overall) == pytest.approx(dict(found.overall), rel=1e-12)
    np.testing.assert_allclose(shuffled.precision_recall.precision, found.precision_recall.precision)


def test_the_row_is_the_query():
    # From a the other of its class is nearest, but from b the stranger is.
    D = [[0, 1, 2], [5, 0, 1], [1, 1, 0]]
    assert evaluate(D, ["x", "x", "y"], bootstrap=0).scores["nn"].tolist() == [1, 0]


def test_shapes_without_label_take_no_part_and_classes_of_one_only_as_candidates():
    D, labels, ids = drawn(5)
    found = evaluate(D, labels, ids)
    known = [i for i, label in enumerate(labels) if label is not None]
    without = evaluate(D[np.ix_(known, known)], [labels[i] for i in known], [ids[i] for i in known])
    assert {**found.to_json(True), "left_out": 0} == {**without.to_json(True), "left_out": 0}
    assert found.to_json()["left_out"] == {"unlabelled": 2, "classes_of_one": 1, "labels": ["class3"]}
    assert len(found.queries) == 16
    # A shape that is all by itself and nearest to everyone spoils every first place.
    lonely = labels.index("class3")
    D[:, lonely] = -1.0
    assert evaluate(D, labels, ids).overall["nn"] == 0.0


def test_intervals_are_those_of_the_mean_over_queries():
    D, labels, ids = drawn(6, sizes=(40, 40, 40))
    found = evaluate(D, labels, ids, bootstrap=4000, seed=1)
    for name, (low, high) in found.intervals.items():
        values = found.scores[name]
        assert low <= found.overall[name] <= high
        # The normal approximation, which 120 queries justify.
        assert high - low == pytest.approx(2 * 1.96 * values.std() / np.sqrt(len(values)), rel=0.1)
    assert evaluate(D, labels, ids, bootstrap=4000, seed=1).intervals == found.intervals
    assert evaluate(D, labels, ids, bootstrap=4000, seed=2).intervals != found.intervals
    assert evaluate(D, labels, ids, bootstrap=0).intervals == {}


def test_intervals_of_classes_are_those_of_their_own_queries_and_their_mean_is_stratified():
    D, labels, ids = drawn(8, sizes=(60, 20), unlabelled=0)
    found = evaluate(D, labels, ids, bootstrap=4000)
    spread = []
    for label, bounds in found.class_intervals.items():
        own = found.scores["map"][[labels[row] == label for row in found.queries]]
        error = own.std() / np.sqrt(len(own))
        spread.append(error)
        assert bounds["map"][1] - bounds["map"][0] == pytest.approx(2 * 1.96 * error, rel=0.1)
    low, high = found.class_mean_intervals["map"]
    # The mean of two independent means.
    assert high - low == pytest.approx(2 * 1.96 * np.hypot(*spread) / 2, rel=0.1)
    assert low < found.class_mean["map"] < high
    none = evaluate(D, labels, ids, bootstrap=0)
    assert (none.class_intervals, none.class_mean_intervals) == ({}, {})


def test_the_ranked_list_of_a_query_breaks_ties_by_id():
    D = [[0, 1, 1, 0.5], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
    assert evaluate(D, ["x"] * 4, ["a", "c", "b", "d"], bootstrap=0).ranked(0).tolist() == [3, 2, 1]
    assert evaluate(D, ["x"] * 4, bootstrap=0).ranked(0).tolist() == [3, 1, 2]


def test_the_report_is_json_and_holds_the_matrix_when_asked():
    D, labels, ids = drawn(7)
    found = evaluate(D, labels, ids)
    report = json.loads(json.dumps(found.to_json()))
    assert set(report) == {
        "queries", "classes", "left_out", "overall", "intervals", "class_mean", "class_mean_intervals", "per_class",
        "precision_recall",
    }  # fmt: skip
    assert report["queries"] == 16
    assert report["classes"] == 4
    assert list(report["overall"]) == ["nn", "first_tier", "second_tier", "e_measure", "dcg", "map"]
    assert report["per_class"]["class0"]["count"] == 7
    assert set(report["precision_recall"]) == {"recall", "precision", "eleven_point"}
    matrix = found.to_json(matrix=True)["matrix"]
    known = [i for i, label in enumerate(labels) if label is not None]
    assert matrix["ids"] == [ids[i] for i in known]
    assert matrix["labels"] == [labels[i] for i in known]
    assert matrix["values"] == D[np.ix_(known, known)].tolist()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[0.0, 1.0]], ["a", "a"]), r"shape \(n, n\)"),
        ((np.zeros((2, 2)), ["a"]), "label"),
        ((np.zeros((2, 2)), ["a", "a"], ["1"]), "ids"),
        (([[0, np.nan], [1, 0]], ["a", "a"]), r"finite; found nan at \[0, 1\]"),
        ((np.zeros((2, 2)), ["a", "b"]), "nothing to evaluate"),
        ((np.zeros((2, 2)), [None, None]), "nothing to evaluate"),
        ((np.zeros((0, 0)), []), "nothing to evaluate"),
        ((np.zeros((2, 2)), ["a", "a"], None, -1), "bootstrap"),
        ((np.zeros((2, 2)), ["a", "a"], None, 1.5), "bootstrap"),
        ((np.zeros((2, 2)), ["a", "a"], None, 10, -1), "seed"),
    ],
)
def test_what_cannot_be_evaluated_is_refused(arguments, message):
    with pytest.raises(ParameterError, match=message):
        evaluate(*arguments)


def test_the_matrix_of_features_goes_straight_in():
    generator = np.random.default_rng(0)
    shapes = [generator.random((4, 3)) * 0.01 + 0.1 * (i % 3) for i in range(12)]
    found = evaluate(dissimilarity_matrix(shapes), [str(i % 3) for i in range(12)])
    assert found.overall["map"] == 1.0
