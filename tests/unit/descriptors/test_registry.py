"""Descriptors by name."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.descriptors import DESCRIPTORS, descriptor_named
from reebase.errors import UnknownName
from reebase.matching import dissimilarity, endpoint_features
from reebase.skeleton.graph import Skeleton

LINE = Skeleton(
    np.array([[0.0, 0, 0], [1, 0, 0], [4, 0, 0]]), np.array([2.0, 5, 1]), np.ones(3),
    np.arange(3, dtype=np.int32), np.array([(0, 1), (1, 2)], dtype=np.int32), np.array([1.0, 3.0]),
    np.array([0, 2], dtype=np.int32), 1,
)  # fmt: skip


def test_srg_is_endpoint_features_compared_by_d():
    srg = descriptor_named("srg")
    features = srg.describe(LINE)
    np.testing.assert_array_equal(features, endpoint_features(LINE))
    for measure in ("matching", "literal"):
        other = features[:1] * 2
        assert srg.compare(features, other, measure) == dissimilarity(features, other, measure)


def test_names():
    assert all(descriptor_named(name).name == name for name in DESCRIPTORS)
    with pytest.raises(UnknownName, match="srg"):
        descriptor_named("none")
