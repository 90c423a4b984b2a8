"""Measures of one ranked list (METHOD §7): how early the shapes of the query's class come.

Every function takes ``relevant``: bool, shape (n,), True where the shape at that rank belongs to the query's
class, nearest first, the query itself not in it. R = the number of True; all measures are in [0, 1] and 0
where R = 0. A perfect list, all relevant shapes first, gives 1 for each but the E-measure, which looks at 32
ranks whatever R is. Tiers, E-measure and DCG follow Shilane, Min, Kazhdan and Funkhouser, "The Princeton
Shape Benchmark", SMI 2004, with the query left out of its class.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = [
    "E_MEASURE_RANKS", "average_precision", "discounted_gain", "e_measure", "interpolated_precision",
    "nearest_neighbour", "precision", "recall", "tier",
]  # fmt: skip

E_MEASURE_RANKS = 32
"""How many ranks the E-measure looks at: what a person sees on a first page of results."""

Relevant = npt.NDArray[np.bool_]


def precision(relevant: Relevant) -> npt.NDArray[np.float64]:
    """Share of the first 1, 2, ... n shapes that is relevant, float64, (n,) (Kacem 4.18)."""
    return np.cumsum(relevant) / np.arange(1, len(relevant) + 1)


def recall(relevant: Relevant) -> npt.NDArray[np.float64]:
    """Share of the R relevant shapes among the first 1, 2, ... n, float64, (n,) (Kacem 4.19)."""
    return np.cumsum(relevant) / max(int(relevant.sum()), 1)


def interpolated_precision(relevant: Relevant, levels: int) -> npt.NDArray[np.float64]:
    """The greatest precision at any recall >= j / levels, for j = 0 ... levels, float64, (levels + 1,).

    levels = R gives every recall that occurs, levels = 10 the standard eleven points. Levels are compared as
    whole numbers of relevant shapes, ceil(j R / levels), so that no rounding moves one.
    """
    ranks = np.flatnonzero(relevant) + 1
    total = len(ranks)
    if total == 0:
        return np.zeros(levels + 1)
    # Precision is greatest, for a given recall, at the rank of a relevant shape.
    best = np.maximum.accumulate((np.arange(1, total + 1) / ranks)[::-1])[::-1]
    needed = np.maximum(-(-np.arange(levels + 1) * total // levels), 1)
    return np.asarray(best[needed - 1])


def nearest_neighbour(relevant: Relevant) -> float:
    """1 if the first shape is relevant, else 0."""
    return float(relevant[:1].sum())


def tier(relevant: Relevant, order: int) -> float:
    """Share of the R relevant shapes among the first order * R: order 1 the first tier, 2 the second."""
    total = int(relevant.sum())
    return float(relevant[: order * total].sum()) / total if total else 0.0


def e_measure(relevant: Relevant) -> float:
    """2 / (1 / P + 1 / R) of precision P and recall R among the first 32, or all where there are fewer."""
    total, shown = int(relevant.sum()), relevant[:E_MEASURE_RANKS]
    # With h hits among s shown, P = h / s and R = h / total.
    return 2.0 * float(shown.sum()) / (len(shown) + total) if total else 0.0


def average_precision(relevant: Relevant) -> float:
    """Mean of the precision at the rank of each relevant shape; its mean over queries is MAP."""
    ranks = np.flatnonzero(relevant) + 1
    return float(np.mean(np.arange(1, len(ranks) + 1) / ranks)) if len(ranks) else 0.0


def discounted_gain(relevant: Relevant) -> float:
    """DCG over that of a perfect list: DCG_1 = G_1, DCG_i = DCG_{i-1} + G_i / log2(i), G_i 1 if relevant."""
    discount = 1.0 / np.log2(np.maximum(np.arange(1, len(relevant) + 1), 2))
    ideal = float(discount[: int(relevant.sum())].sum())
    return float(discount[relevant].sum()) / ideal if ideal else 0.0
