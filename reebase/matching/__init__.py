"""Endpoint features, the dissimilarity D(G, G~) of two skeletons, and why it is what it is (METHOD §5).

``endpoint_features`` gives omega = (a, dv, dc) of each endpoint; ``dissimilarity`` compares two sets of them
by a measure from ``MEASURES``, ``dissimilarities`` compares one with many, and ``match`` says which endpoint
went with which. A ``Comparison`` has all three for whatever is kept of a shape; ``ENDPOINTS`` is that of omega.
"""

from reebase.matching.comparison import Comparison, Stack
from reebase.matching.endpoints import ENDPOINTS
from reebase.matching.explanation import Match, Pair, Unmatched, match
from reebase.matching.features import as_features, endpoint_features
from reebase.matching.measures import MEASURES, Measure, dissimilarities, dissimilarity, measure_named

__all__ = [
    "ENDPOINTS", "MEASURES", "Comparison", "Match", "Measure", "Pair", "Stack", "Unmatched", "as_features",
    "dissimilarities", "dissimilarity",
    "endpoint_features", "match", "measure_named",
]  # fmt: skip
