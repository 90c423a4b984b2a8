"""How well a dissimilarity retrieves (METHOD §7): the matrix of D, and what it says against labels.

``dissimilarity_matrix`` compares all shapes, ``evaluate`` turns a matrix and labels into an ``Evaluation``:
precision-recall, nearest neighbour, tiers, E-measure, DCG and MAP, leave-one-out, per class and overall.
"""

from reebase.evaluation.matrix import dissimilarity_matrix
from reebase.evaluation.measures import SCORES, Evaluation, PrecisionRecall, evaluate

__all__ = ["SCORES", "Evaluation", "PrecisionRecall", "dissimilarity_matrix", "evaluate"]
