"""D of endpoints with charges: a metric, the least over all pairings, with parts whose squares add up."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from reebase.errors import ParameterError
from reebase.matching.charged import charged_matrix, match_charged


def sets(seed: int, count: int, most: int = 4, width: int = 3) -> list[np.ndarray]:
    random = np.random.default_rng(seed)
    return [
        np.column_stack([random.normal(size=(k, width - 1)), random.uniform(0.1, 1.0, k)])
        for k in random.integers(0, most + 1, count)
    ]


def by_trying_all(a: np.ndarray, b: np.ndarray) -> float:
    best = (a[:, -1] ** 2).sum() + (b[:, -1] ** 2).sum()
    for size in range(1, min(len(a), len(b)) + 1):
        for left in itertools.combinations(range(len(a)), size):
            for right in itertools.permutations(range(len(b)), size):
                paired = sum(((a[i] - b[j]) ** 2).sum() for i, j in zip(left, right, strict=True))
                alone = (np.delete(a[:, -1], left) ** 2).sum() + (np.delete(b[:, -1], right) ** 2).sum()
                best = min(best, paired + alone)
    return np.sqrt(best)


def test_it_is_the_least_over_all_pairings():
    shapes = sets(0, 14)
    D = charged_matrix(shapes)
    for i, j in itertools.product(range(14), repeat=2):
        assert D[i, j] == pytest.approx(by_trying_all(shapes[i], shapes[j]), abs=1e-12)


def test_it_is_a_metric():
    shapes = sets(1, 40)
    D = charged_matrix(shapes)
    np.testing.assert_array_equal(D, D.T)
    np.testing.assert_array_equal(np.diag(D), 0.0)
    assert (D[:, None, :] <= D[:, :, None] + D[None, :, :] + 1e-12).all()
    # Zero for equal multisets only; two empty sets are equal.
    same = np.array([[len(a) == len(b) == 0 or a is b for b in shapes] for a in shapes])
    assert ((D == 0) == same).all()


def test_the_order_of_endpoints_makes_no_difference_to_the_bit():
    shapes = sets(2, 12, most=7, width=9)
    shuffled = [np.random.default_rng(i).permutation(shape) for i, shape in enumerate(shapes)]
    np.testing.assert_array_equal(charged_matrix(shapes), charged_matrix(shuffled))
    assert all(D == 0 for D in map(lambda a, b: match_charged(a, b).dissimilarity, shapes, shuffled))


def test_the_squares_of_the_parts_add_up():
    shapes = sets(3, 12, most=6)
    D = charged_matrix(shapes)
    for i, j in itertools.product(range(12), repeat=2):
        found = match_charged(shapes[i], shapes[j])
        assert found.dissimilarity == D[i, j]
        parts = [p.distance for p in found.pairs]
        parts += [u.charge for u in (*found.unmatched_first, *found.unmatched_second)]
        assert np.linalg.norm(parts) == pytest.approx(D[i, j], abs=1e-12)
        assert sorted([p.first for p in found.pairs] + [u.endpoint for u in found.unmatched_first]) == list(
            range(len(shapes[i]))
        )
        assert sorted([p.second for p in found.pairs] + [u.endpoint for u in found.unmatched_second]) == list(
            range(len(shapes[j]))
        )


def test_two_that_have_nothing_in_common_stay_alone():
    found = match_charged([[0.0, 0.2]], [[9.0, 0.3]])
    assert found.pairs == ()
    assert found.dissimilarity == pytest.approx(np.hypot(0.2, 0.3))


@pytest.mark.parametrize("bad", [[1.0, 2.0], [[1.0]], [[1.0, 0.0]], [[1.0, -1.0]], [[np.nan, 1.0]], [[1e200, 1.0]]])
def test_refuses_what_are_no_endpoints_with_charges(bad):
    with pytest.raises(ParameterError):
        charged_matrix([bad])


def test_refuses_features_of_another_kind():
    with pytest.raises(ParameterError, match="same number"):
        charged_matrix([[[1.0, 1.0]], [[1.0, 1.0, 1.0]]])
    with pytest.raises(ParameterError, match="columns"):
        match_charged([[1.0, 1.0]], [[1.0, 1.0, 1.0]])


def test_of_no_shapes():
    assert charged_matrix([]).shape == (0, 0)
