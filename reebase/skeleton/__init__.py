"""The spectral Reeb graph of a shape: its skeleton (METHOD §4).

graph.py: the value, Skeleton. reeb.py: exact banding of a scalar field, with its kernels in reeb_kernels.py.
levels.py: where the level sets lie.
prune.py: removal of branches that are not salient. root.py: which node is the root.
"""

from reebase.skeleton.graph import Skeleton
from reebase.skeleton.levels import LEVELS
from reebase.skeleton.prune import SALIENCIES, prune, prune_to
from reebase.skeleton.reeb import MAX_BANDS, reeb_graph, reeb_nodes
from reebase.skeleton.root import ROOTS, rooted

__all__ = [
    "LEVELS", "MAX_BANDS", "ROOTS", "SALIENCIES", "Skeleton", "prune", "prune_to", "reeb_graph", "reeb_nodes", "rooted",
]  # fmt: skip
