"""Straight loops from METHOD §5: endpoint features and the four measures, slow and obvious."""

from __future__ import annotations

import itertools
import math

import numpy as np
from scipy.optimize import linear_sum_assignment


def path_lengths(nodes, edges, lengths):
    """All shortest paths by Floyd and Warshall."""
    delta = [[0.0 if i == j else math.inf for j in range(nodes)] for i in range(nodes)]
    for (i, j), length in zip(edges, lengths, strict=True):
        delta[i][j] = delta[j][i] = min(delta[i][j], length)
    for k, i, j in itertools.product(range(nodes), repeat=3):
        delta[i][j] = min(delta[i][j], delta[i][k] + delta[k][j])
    return delta


def endpoint_features(skeleton, area="band"):
    """omega of each endpoint."""
    delta = path_lengths(len(skeleton.positions), skeleton.edges.tolist(), skeleton.lengths.tolist())
    ends = skeleton.endpoints.tolist()
    areas = skeleton.areas if area == "band" else skeleton.ring_areas
    total = sum(delta[skeleton.root][k] for k in ends)
    if total == 0:
        return []
    return [
        (
            areas[i] / sum(skeleton.areas),
            sum(delta[i][k] for k in ends) / total,
            delta[skeleton.root][i] / total,
        )
        for i in ends
    ]


def phi(a, b):
    return math.dist(a, b)


def norm(a):
    return math.hypot(*a)


def brute_force(first, second):
    """Least cost over every partial pairing: nobody has to be matched, whoever is not pays the norm."""
    best = math.inf
    n, m = len(first), len(second)
    for size in range(min(n, m) + 1):
        for rows in itertools.combinations(range(n), size):
            for columns in itertools.permutations(range(m), size):
                cost = sum(phi(first[i], second[j]) for i, j in zip(rows, columns, strict=True))
                cost += sum(norm(first[i]) for i in range(n) if i not in rows)
                cost += sum(norm(second[j]) for j in range(m) if j not in columns)
                best = min(best, cost)
    return best


def maximum_matching(first, second):
    """The smaller side padded with zero vectors to the size of the larger: all of it must be matched."""
    size = max(len(first), len(second))
    if size == 0:
        return 0.0
    a, b = ([*map(tuple, side), *[(0.0, 0.0, 0.0)] * (size - len(side))] for side in (first, second))
    cost = np.array([[phi(x, y) for y in b] for x in a])
    return float(cost[linear_sum_assignment(cost)].sum())


def free_matching(first, second):
    """Both sides padded to n + m: any endpoint may be matched to the zero vector instead."""
    zero = [(0.0, 0.0, 0.0)]
    return maximum_matching([*first, *zero * len(second)], [*second, *zero * len(first)])


def matching_mean(first, second):
    return maximum_matching(first, second) / max(len(first), len(second), 1)


def greedy(first, second):
    """Algorithm 2: by decreasing a, ties by dv, dc, each takes the nearest that is free; the rest pay."""

    def key(omega):
        return -omega[0], omega[1], omega[2]

    free = sorted(map(tuple, second), key=key)
    total = 0.0
    for omega in sorted(map(tuple, first), key=key):
        if not free:
            total += norm(omega)
            continue
        nearest = min(free, key=lambda other: phi(omega, other))
        total += phi(omega, nearest)
        free.remove(nearest)
    return total + sum(map(norm, free))


def literal(first, second):
    """(4.17)."""
    return sum(phi(a, b) for a in first for b in second)


MEASURES = {
    "matching": maximum_matching, "matching_mean": matching_mean, "greedy": greedy, "literal": literal,
}  # fmt: skip
