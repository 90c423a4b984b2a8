"""Bootstrap intervals: how far a mean over queries would move with other shapes of the same kinds.

Queries are drawn with replacement, and the interval holds the middle 95 % of the means (Efron, "Bootstrap Methods:
Another Look at the Jackknife", Annals of Statistics 7(1), 1979: the percentile interval).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

__all__ = ["Interval", "intervals"]

Interval = tuple[float, float]

_CONFIDENCE = 0.95
_RESAMPLES_AT_ONCE = 64


def intervals(
    scores: Mapping[str, npt.NDArray[np.float64]], rows_of: Mapping[str, list[int]], bootstrap: int, seed: int
) -> tuple[dict[str, Interval], dict[str, Interval], dict[str, dict[str, Interval]]]:
    """95 % intervals of the mean over queries, of the mean over classes, and of the mean in each class.

    scores: measure -> its value for each query, (q,). rows_of: class -> the positions of its queries in these. The mean
    over classes is resampled within each class, so it is that of these classes, not of others of their kind.
    All empty without resampling.
    """
    if not bootstrap:
        return {}, {}, {}
    values = np.column_stack(list(scores.values()))
    names = list(scores)
    of_all = _bounds(names, _resampled_means(values, bootstrap, np.random.default_rng(seed)))
    sums = np.zeros((bootstrap, len(names)))
    of_class = {}
    for number, (label, rows) in enumerate(rows_of.items()):
        means = _resampled_means(values[rows], bootstrap, np.random.default_rng([seed, number]))
        of_class[label] = _bounds(names, means)
        sums += means
    return of_all, _bounds(names, sums / len(rows_of)), of_class


def _resampled_means(
    values: npt.NDArray[np.float64], bootstrap: int, generator: np.random.Generator
) -> npt.NDArray[np.float64]:
    """Means over rows drawn with replacement from ``values``, (q, s): (bootstrap, s)."""
    count = len(values)
    means = []
    for start in range(0, bootstrap, _RESAMPLES_AT_ONCE):
        size = min(_RESAMPLES_AT_ONCE, bootstrap - start)
        means.append(generator.multinomial(count, np.full(count, 1 / count), size=size) @ values / count)
    return np.vstack(means)


def _bounds(names: list[str], means: npt.NDArray[np.float64]) -> dict[str, Interval]:
    tail = (1 - _CONFIDENCE) / 2
    low, high = np.quantile(means, [tail, 1 - tail], axis=0)
    return {name: (float(low[m]), float(high[m])) for m, name in enumerate(names)}
