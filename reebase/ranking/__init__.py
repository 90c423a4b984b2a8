"""Ranking by several descriptors at once, and re-ranking by what the whole collection says.

fusion.py: ``fuse``, one dissimilarity out of those of all ``PARTS``, each measured in units of the collection, with
each part's share in every hit. diffusion.py: ``rerank``, the ranking after similarity has spread over the graph of
nearest neighbours. Nothing is trained, and no label is looked at. named.py: ``ranking_named``, these and each single
descriptor by name.
"""

from reebase.ranking.diffusion import CANDIDATES, UNREACHED, rerank, reranked_matrix
from reebase.ranking.fusion import PARTS, REFERENCES, Fused, Statistics, fuse, fused_matrix, statistics
from reebase.ranking.named import DEFAULT, FUSED, RANKINGS, Ranking, ranking_named

__all__ = [
    "CANDIDATES", "DEFAULT", "FUSED", "PARTS", "RANKINGS", "REFERENCES", "UNREACHED", "Fused", "Ranking", "Statistics",
    "fuse", "fused_matrix", "ranking_named", "rerank", "reranked_matrix", "statistics",
]  # fmt: skip
