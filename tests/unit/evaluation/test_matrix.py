"""The dissimilarity matrix: every entry is D of its two shapes."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.errors import ParameterError, UnknownName
from reebase.evaluation import dissimilarity_matrix
from reebase.matching import MEASURES, dissimilarity


def drawn(count=15):
    generator = np.random.default_rng(0)
    return [generator.random((n, 3)) for n in generator.integers(0, 8, size=count)]


@pytest.mark.parametrize("measure", MEASURES)
def test_every_entry_is_the_dissimilarity(measure):
    shapes = drawn()
    expected = [[dissimilarity(query, other, measure) for other in shapes] for query in shapes]
    np.testing.assert_array_equal(dissimilarity_matrix(shapes, measure), expected)


@pytest.mark.parametrize("measure", MEASURES)
def test_progress_rises_to_one(measure):
    seen = []
    dissimilarity_matrix(drawn(), measure, progress=seen.append)
    assert seen == sorted(seen)
    assert len(seen) == 15
    assert seen[-1] == 1.0


def test_no_shapes_make_an_empty_matrix():
    assert dissimilarity_matrix([]).shape == (0, 0)


def test_refusals_name_the_shape():
    with pytest.raises(ParameterError, match=r"shapes\[1\]"):
        dissimilarity_matrix([[], [[1.0, 2.0]]])
    with pytest.raises(UnknownName):
        dissimilarity_matrix([], "nearest")
