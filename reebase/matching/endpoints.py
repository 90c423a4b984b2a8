"""omega of endpoints, compared by the measures of D."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.matching.comparison import Comparison, Stack
from reebase.matching.explanation import match
from reebase.matching.features import as_features
from reebase.matching.measures import MEASURES, measure_named

__all__ = ["ENDPOINTS"]


def _one_to_many(query: npt.NDArray[np.float64], stack: Stack, measure: str) -> npt.NDArray[np.float64]:
    from reebase.matching.assignment_kernels import one_to_many

    out = np.empty(stack.shapes)
    one_to_many(query, stack.values, stack.offsets[:-1], stack.offsets[1:], measure_named(measure).code, out)
    return out


ENDPOINTS = Comparison(
    as_features, _one_to_many, frozenset(name for name, measure in MEASURES.items() if not measure.symmetric), match
)
"""Endpoint features (k, 3), by the names of ``MEASURES``."""
