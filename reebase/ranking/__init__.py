"""Ranking by several descriptors at once, and re-ranking by what the whole collection says.

fusion.py: ``fuse``, one dissimilarity out of those of all ``PARTS``, each measured in units of the collection, with
each part's share in every hit. diffusion.py: ``rerank``, the ranking after similarity has spread over the graph of
nearest neighbours. Nothing is trained, and no label is looked at.
"""

from reebase.ranking.diffusion import CANDIDATES, rerank, reranked_matrix
from reebase.ranking.fusion import PARTS, REFERENCES, Fused, Statistics, fuse, fused_matrix, query_scales, statistics

__all__ = [
    "CANDIDATES", "PARTS", "REFERENCES", "Fused", "Statistics", "fuse", "fused_matrix", "query_scales", "rerank",
    "reranked_matrix", "statistics",
]  # fmt: skip
