"""Compiled loops of the measures of D: canonical order, assignment, one set of endpoints against many.

Every set is first put in canonical order (decreasing a, then increasing dv, dc), and of two sets the smaller,
or the one that comes first in that order, plays the rows. So a symmetric measure gives the same bits for (G,
G~) and (G~, G), and for any order of the endpoints. Inputs are clean: finite, not negative, C-contiguous.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

__all__ = ["GREEDY", "LITERAL", "MATCHING", "MATCHING_MEAN", "assign", "lower_bounds", "one_to_many", "one_to_one"]

MATCHING, MATCHING_MEAN, GREEDY, LITERAL = 0, 1, 2, 3

# Read-only in the signature accepts both kinds of array, so that each kernel is compiled once.
_POINTS = numba.types.Array(numba.float64, 2, "C", readonly=True)
_STACKED_AXES = numba.types.Array(numba.float64, 3, "C", readonly=True)
_INDICES = numba.types.Array(numba.int64, 1, "C", readonly=True)


@numba.njit(cache=True, nogil=True)
def _compare(first: Any, i: int, second: Any, j: int) -> int:
    """-1, 0, 1 as row i of ``first`` comes before, equals or comes after row j of ``second``."""
    if first[i, 0] != second[j, 0]:
        return -1 if first[i, 0] > second[j, 0] else 1
    for axis in range(1, 3):
        if first[i, axis] != second[j, axis]:
            return -1 if first[i, axis] < second[j, axis] else 1
    return 0


@numba.njit(cache=True, nogil=True)
def _distance(first: Any, i: int, second: Any, j: int) -> float:
    """Phi, (4.16)."""
    x = first[i, 0] - second[j, 0]
    y = first[i, 1] - second[j, 1]
    z = first[i, 2] - second[j, 2]
    return float(np.sqrt(x * x + y * y + z * z))


@numba.njit(cache=True, nogil=True)
def _norm(points: Any, i: int) -> float:
    return float(np.sqrt(points[i, 0] ** 2 + points[i, 1] ** 2 + points[i, 2] ** 2))


@numba.njit(cache=True, nogil=True)
def _arrange(source: Any, start: int, end: int, target: Any, order: Any) -> None:
    """Rows start..end of ``source`` into ``target`` in canonical order; ``order`` says from which row each
    came.

    Insertion: a skeleton's endpoints come by decreasing area already, so that there is next to nothing to
    move.
    """
    for row in range(start, end):
        place = row - start
        while place > 0 and _compare(source, row, target, place - 1) < 0:
            for axis in range(3):
                target[place, axis] = target[place - 1, axis]
            order[place] = order[place - 1]
            place -= 1
        for axis in range(3):
            target[place, axis] = source[row, axis]
        order[place] = row - start


@numba.njit(cache=True, nogil=True)
def assign(cost: Any, n: int, m: int, reals: Any, integers: Any) -> None:
    """Minimum-weight assignment of n rows to m >= n columns by shortest augmenting paths, O(n^2 m).

    Crouse, "On implementing 2D rectangular assignment algorithms", IEEE TAES 52(4), 2016, without
    initialisation.
    reals: (3, >= m) scratch. integers: (5, >= m); row 0 receives the column of each row.
    """
    u, v, shortest = reals[0], reals[1], reals[2]
    column_of, row_of, via = integers[0], integers[1], integers[2]
    done_rows, remaining = integers[3], integers[4]
    reals[:2, :m] = 0.0
    integers[:2, :m] = -1
    for start in range(n):
        for j in range(m):
            shortest[j] = np.inf
            remaining[j] = j
        left = m
        reached = 0
        i = start
        length = 0.0
        sink = -1
        while sink < 0:
            done_rows[reached] = i
            reached += 1
            best = np.inf
            chosen = 0
            for k in range(left):
                j = remaining[k]
                reduced = length + cost[i, j] - u[i] - v[j]
                if reduced < shortest[j]:
                    shortest[j] = reduced
                    via[j] = i
                # Of equally short paths one that ends in a free column is over at once.
                if shortest[j] < best or (shortest[j] == best and row_of[j] < 0):
                    best = shortest[j]
                    chosen = k
            length = best
            j = remaining[chosen]
            left -= 1
            remaining[chosen] = remaining[left]
            remaining[left] = j
            if row_of[j] < 0:
                sink = j
            else:
                i = row_of[j]
        u[start] += length
        for k in range(1, reached):
            u[done_rows[k]] += length - shortest[column_of[done_rows[k]]]
        for k in range(left, m):
            v[remaining[k]] -= length - shortest[remaining[k]]
        j = sink
        while True:
            i = via[j]
            row_of[j] = i
            previous = column_of[i]
            column_of[i] = j
            if i == start:
                break
            j = previous


@numba.njit(cache=True, nogil=True)
def _rows_first(first: Any, n: int, second: Any, m: int) -> bool:
    """Whether ``first`` plays the rows: the smaller set, of equal sizes the one that comes first."""
    if n != m:
        return n < m
    for i in range(n):
        order = _compare(first, i, second, i)
        if order != 0:
            return order < 0
    return True


@numba.njit(cache=True, nogil=True)
def _optimal(rows: Any, n: int, columns: Any, m: int, cost: Any, reals: Any, integers: Any) -> float:
    """Sum of ``matching`` for n <= m; row 0 of ``integers`` receives the column of each row.

    All n rows are matched and a column left over costs its norm, so the assignment minimises Phi less the
    norm of the column; the sum is then taken from the parts, since the difference has lost digits.
    """
    equal = n == m
    for i in range(n):
        if not equal:
            break
        equal = _compare(rows, i, columns, i) == 0
    if equal:
        for i in range(n):
            integers[0, i] = i
        return 0.0
    for j in range(m):
        charge = _norm(columns, j) if n < m else 0.0
        for i in range(n):
            cost[i, j] = _distance(rows, i, columns, j) - charge
    assign(cost, n, m, reals, integers)
    total = 0.0
    for j in range(m):
        i = integers[1, j]
        total += _distance(rows, i, columns, j) if i >= 0 else _norm(columns, j)
    return total


@numba.njit(cache=True, nogil=True)
def _greedy(first: Any, n: int, second: Any, m: int, integers: Any) -> float:
    """Sum of ``greedy``; row 0 of ``integers`` receives the partner of each row of ``first``, -1 for none."""
    total = 0.0
    for j in range(m):
        integers[1, j] = -1
    for i in range(n):
        nearest = np.inf
        partner = -1
        for j in range(m):
            if integers[1, j] < 0:
                distance = _distance(first, i, second, j)
                if distance < nearest:
                    nearest = distance
                    partner = j
        integers[0, i] = partner
        if partner >= 0:
            integers[1, partner] = i
            total += nearest
        else:
            total += _norm(first, i)
    for j in range(m):
        if integers[1, j] < 0:
            total += _norm(second, j)
    return total


@numba.njit(cache=True, nogil=True)
def _literal(rows: Any, n: int, columns: Any, m: int) -> float:
    """The double sum of (4.17)."""
    total = 0.0
    for i in range(n):
        for j in range(m):
            total += _distance(rows, i, columns, j)
    return total


@numba.njit(cache=True, nogil=True)
def _dissimilarity(
    first: Any, n: int, second: Any, m: int, code: int, cost: Any, reals: Any, integers: Any
) -> float:
    """D of two sets in canonical order."""
    if code == GREEDY:
        return _greedy(first, n, second, m, integers)
    rows_first = _rows_first(first, n, second, m)
    if code == LITERAL:
        return _literal(first, n, second, m) if rows_first else _literal(second, m, first, n)
    if rows_first:
        total = _optimal(first, n, second, m, cost, reals, integers)
    else:
        total = _optimal(second, m, first, n, cost, reals, integers)
    if code == MATCHING_MEAN and max(n, m) > 0:
        return total / max(n, m)
    return total


@numba.njit(
    numba.void(_POINTS, _POINTS, _INDICES, _INDICES, numba.int64, numba.float64[::1]), cache=True, nogil=True
)
def one_to_many(query: Any, stacked: Any, starts: Any, ends: Any, code: int, out: Any) -> None:
    """out[c] = D(query, rows starts[c]..ends[c] of ``stacked``) by the measure ``code``."""
    n = len(query)
    largest = 0
    for c in range(len(starts)):
        largest = max(largest, ends[c] - starts[c])
    widest = max(n, largest)
    first = np.empty((n, 3))
    second = np.empty((largest, 3))
    order = np.empty(widest, np.int64)
    cost = np.empty((min(n, largest), widest))
    reals = np.empty((3, widest))
    integers = np.empty((5, widest), np.int64)
    _arrange(query, 0, n, first, order)
    for c in range(len(starts)):
        _arrange(stacked, starts[c], ends[c], second, order)
        out[c] = _dissimilarity(first, n, second, ends[c] - starts[c], code, cost, reals, integers)


@numba.njit(numba.float64(_POINTS, _POINTS, numba.int64, numba.int64[::1]), cache=True, nogil=True)
def one_to_one(first: Any, second: Any, code: int, partner: Any) -> float:
    """D(first, second), the bits of ``one_to_many``; partner[i] = row of ``second`` that i went with, -1."""
    n, m = len(first), len(second)
    widest = max(n, m)
    a = np.empty((n, 3))
    b = np.empty((m, 3))
    a_order = np.empty(n, np.int64)
    b_order = np.empty(m, np.int64)
    integers = np.empty((5, widest), np.int64)
    _arrange(first, 0, n, a, a_order)
    _arrange(second, 0, m, b, b_order)
    cost = np.empty((min(n, m), widest))
    total = _dissimilarity(a, n, b, m, code, cost, np.empty((3, widest)), integers)
    for i in range(n):
        partner[i] = -1
    if code == GREEDY:
        for i in range(n):
            if integers[0, i] >= 0:
                partner[a_order[i]] = b_order[integers[0, i]]
    elif code != LITERAL:
        if _rows_first(a, n, b, m):
            for i in range(n):
                partner[a_order[i]] = b_order[integers[0, i]]
        else:
            for j in range(m):
                partner[a_order[integers[0, j]]] = b_order[j]
    return total


@numba.njit(numba.void(_POINTS, _STACKED_AXES, numba.float64[::1]), cache=True, nogil=True)
def lower_bounds(query: Any, candidates: Any, out: Any) -> None:
    """out[c] <= D(query, candidate c) by ``matching``. query: (3, k), candidates: (n, 3, l), each axis
    decreasing.

    Along one axis the cheapest matching pairs the sorted values (those left over with zero): W of that axis.
    As sum |x_i| >= |sum x_i| for the vectors of absolute differences, D >= sqrt(W_a^2 + W_dv^2 + W_dc^2).
    """
    k, width = query.shape[1], candidates.shape[2]
    shared = min(k, width)
    for c in range(len(candidates)):
        squares = 0.0
        for axis in range(3):
            total = 0.0
            for i in range(shared):
                total += abs(query[axis, i] - candidates[c, axis, i])
            for i in range(shared, k):
                total += query[axis, i]
            for i in range(shared, width):
                total += candidates[c, axis, i]
            squares += total * total
        out[c] = np.sqrt(squares)
