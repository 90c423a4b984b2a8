"""The lower bound that prunes candidates never exceeds D."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.matching import dissimilarity
from reebase.matching.assignment_kernels import lower_bounds
from reebase.search.bucket import project


@pytest.mark.parametrize(("n", "m"), [(0, 0), (0, 4), (4, 0), (3, 3), (2, 6), (6, 2), (30, 30)])
def test_the_bound_is_below_matching_and_greedy(n, m):
    generator = np.random.default_rng([n, m])
    query = generator.random((n, 3))
    candidates = generator.random((40, m, 3))
    found = np.empty(40)
    lower_bounds(project(query), np.array([project(one) for one in candidates]), found)
    for bound, candidate in zip(found, candidates, strict=True):
        assert bound <= dissimilarity(query, candidate) * (1 + 1e-12)
        assert bound <= dissimilarity(query, candidate, "greedy") * (1 + 1e-12)


def test_the_bound_is_attained_on_a_line_and_zero_for_equal_sets():
    # All endpoints on one ray through zero: the order along it is the optimal matching.
    ray = np.array([0.2, 0.5, 0.4])
    a, b = np.array([[3.0], [1.0]]) * ray, np.array([[2.5], [0.2], [0.1]]) * ray
    found = np.empty(1)
    lower_bounds(project(a), project(b)[None], found)
    assert found[0] == pytest.approx(dissimilarity(a, b), rel=1e-12)
    lower_bounds(project(a), project(a[::-1])[None], found)
    assert found[0] == 0.0
