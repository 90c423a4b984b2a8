"""Compiled loops of D for endpoints with charges.

Rows come in canonical order. Of two sets the smaller, or the one that comes first in that order, plays the rows of
the assignment, so that (G, G~) and (G~, G) give the same bits.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from reebase.matching.assignment_kernels import assign

__all__ = ["one_to_many", "one_to_one"]


# Sums in any order: one after the other, each addition waits for the last.
@njit(cache=True, nogil=True, fastmath={"reassoc", "nsz"})
def _squared(first: Any, i: int, second: Any, j: int) -> float:
    total = 0.0
    for k in range(first.shape[1]):
        total += (first[i, k] - second[j, k]) ** 2
    return total


@njit(cache=True, nogil=True)
def _order(first: Any, second: Any) -> int:
    """-1 when ``first`` plays the rows, 1 when ``second`` does, 0 for equal sets."""
    if len(first) != len(second):
        return -1 if len(first) < len(second) else 1
    for i in range(len(first)):
        for k in range(first.shape[1]):
            if first[i, k] != second[i, k]:
                return -1 if first[i, k] < second[i, k] else 1
    return 0


@njit(cache=True, nogil=True)
def _optimal(rows: Any, columns: Any, partner: Any) -> float:
    """D for n <= m; partner[i] = column of row i, -1 when it stays alone.

    Each row may also take one of n further columns, which stand for staying alone. The squared charge of a column is
    saved when a row takes it; the sum is then taken from the parts, since differences have lost digits.
    """
    n, m = len(rows), len(columns)
    last = rows.shape[1] - 1
    cost = np.empty((n, m + n))
    for i in range(n):
        for j in range(m):
            cost[i, j] = _squared(rows, i, columns, j) - columns[j, last] ** 2
        for j in range(n):
            cost[i, m + j] = rows[i, last] ** 2
    integers = np.empty((5, m + n), np.int64)
    assign(cost, n, m + n, np.empty((3, m + n)), integers)
    total = 0.0
    for i in range(n):
        j = integers[0, i]
        partner[i] = j if j < m else -1
        total += _squared(rows, i, columns, j) if j < m else rows[i, last] ** 2
    for j in range(m):
        if integers[1, j] < 0:
            total += columns[j, last] ** 2
    return float(np.sqrt(total))


@njit(cache=True, nogil=True)
def one_to_one(first: Any, second: Any, partner: Any) -> float:
    """D(first, second); partner[i] = row of ``second`` that row i of ``first`` went with, -1 for none."""
    order = _order(first, second)
    if order == 0:
        for i in range(len(first)):
            partner[i] = i
        return 0.0
    if order < 0:
        return _optimal(first, second, partner)
    found = np.empty(len(second), np.int64)
    total = _optimal(second, first, found)
    for i in range(len(first)):
        partner[i] = -1
    for j in range(len(second)):
        if found[j] >= 0:
            partner[found[j]] = j
    return total


@njit(cache=True, nogil=True)
def one_to_many(query: Any, stacked: Any, offsets: Any, out: Any) -> None:
    """out[c] = D(query, rows offsets[c] .. offsets[c + 1] of ``stacked``)."""
    partner = np.empty(len(query), np.int64)
    for c in range(len(out)):
        out[c] = one_to_one(query, stacked[offsets[c] : offsets[c + 1]], partner)
