"""What must hold of D for any endpoints at all."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reebase.matching import MEASURES, dissimilarity, match
from reebase.search import Index

# A lattice beside the reals makes ties and equal endpoints common; no magnitude is lost when squared.
ENTRY = st.one_of(st.integers(0, 4).map(lambda n: n / 4), st.floats(1e-6, 2.0))
OMEGA = st.tuples(ENTRY, ENTRY, ENTRY).filter(any)
ENDPOINTS = st.lists(OMEGA, max_size=7)
MEASURE = st.sampled_from(list(MEASURES))
TOLERANCE = 1e-12


@given(ENDPOINTS, ENDPOINTS, MEASURE)
def test_never_negative(a, b, measure):
    assert dissimilarity(a, b, measure) >= 0.0


@given(ENDPOINTS, st.randoms(use_true_random=False))
def test_zero_to_itself_in_any_order(a, random):
    shuffled = random.sample(a, len(a))
    for name, measure in MEASURES.items():
        if measure.reflexive:
            assert dissimilarity(a, shuffled, name) == 0.0


@given(ENDPOINTS, ENDPOINTS)
def test_zero_only_for_equal_multisets(a, b):
    assert (dissimilarity(a, b) == 0.0) == (sorted(a) == sorted(b))


@given(ENDPOINTS, ENDPOINTS)
def test_symmetric_to_the_bit(a, b):
    for name, measure in MEASURES.items():
        if measure.symmetric:
            assert dissimilarity(a, b, name) == dissimilarity(b, a, name)


@given(ENDPOINTS, ENDPOINTS, ENDPOINTS)
def test_triangle_inequality(a, b, c):
    for name, measure in MEASURES.items():
        if measure.metric:
            detour = dissimilarity(a, b, name) + dissimilarity(b, c, name)
            assert dissimilarity(a, c, name) <= detour + TOLERANCE


@given(ENDPOINTS, ENDPOINTS, MEASURE, st.randoms(use_true_random=False))
def test_the_order_of_the_endpoints_does_not_matter(a, b, measure, random):
    shuffled = dissimilarity(random.sample(a, len(a)), random.sample(b, len(b)), measure)
    assert shuffled == dissimilarity(a, b, measure)


@given(ENDPOINTS, ENDPOINTS)
def test_between_the_bounds_that_charges_give(a, b):
    def weigh(side):
        return sum(float(np.linalg.norm(omega)) for omega in side)

    optimal = dissimilarity(a, b)
    assert abs(weigh(a) - weigh(b)) <= optimal + TOLERANCE
    assert optimal <= dissimilarity(a, b, "greedy") + TOLERANCE
    assert optimal <= weigh(a) + weigh(b) + TOLERANCE


@given(ENDPOINTS, ENDPOINTS, OMEGA)
def test_an_endpoint_that_both_have_costs_nothing(a, b, shared):
    assert dissimilarity([*a, shared], [*b, shared]) == pytest.approx(dissimilarity(a, b), abs=TOLERANCE)


@given(ENDPOINTS, ENDPOINTS, MEASURE)
def test_the_explanation_adds_up(a, b, measure):
    found = match(a, b, measure)
    unmatched = (*found.unmatched_first, *found.unmatched_second)
    total = sum(p.distance for p in found.pairs) + sum(u.charge for u in unmatched)
    factor = max(len(a), len(b)) if measure == "matching_mean" else 1
    assert total == pytest.approx(found.dissimilarity * factor, abs=TOLERANCE)
    assert found.dissimilarity == dissimilarity(a, b, measure)


@given(st.lists(ENDPOINTS, max_size=90), ENDPOINTS, MEASURE, st.integers(1, 5))
def test_the_index_finds_what_comparing_all_finds(shapes, query, measure, k):
    index = Index()
    for number, shape in enumerate(shapes):
        index.add(f"{number:02}", shape)
    expected = sorted((dissimilarity(query, shape, measure), f"{n:02}") for n, shape in enumerate(shapes))
    hits = index.query(query, k=k, tolerance=None, measure=measure)
    assert [(hit.dissimilarity, hit.id) for hit in hits] == expected[:k]
