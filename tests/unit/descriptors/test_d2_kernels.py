"""The histogram of distances equals numpy's, on edges too."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.descriptors.d2_kernels import binned


@pytest.mark.parametrize("bins", [1, 7, 64])
@pytest.mark.parametrize("last", [1.0, 3.0, 0.1])
def test_equals_numpys_histogram_of_clipped_values(bins: int, last: float) -> None:
    edges = np.linspace(0.0, last, bins + 1)
    random = np.random.default_rng(bins)
    values = np.concatenate([random.uniform(0, 1.5 * last, 5000), edges, np.nextafter(edges[1:], 0), [1e300]])
    expected = np.histogram(np.minimum(values, last), bins, (0.0, last))[0]
    np.testing.assert_array_equal(binned(values, edges), expected)
