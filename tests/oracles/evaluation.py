"""Straight loops from METHOD §7 and Shilane et al. 2004: one query at a time, one rank at a time."""

from __future__ import annotations

import math


def ranked_labels(D, labels, ids, query):
    """Labels of all other labelled shapes, nearest first, ties by id."""
    others = [i for i in range(len(labels)) if i != query and labels[i] is not None]
    return [labels[i] for i in sorted(others, key=lambda i: (D[query][i], ids[i]))]


def scores(retrieved, label):
    """The six measures of one list of labels."""
    total = retrieved.count(label)
    hits, precisions, dcg, ideal = 0, [], 0.0, 0.0
    for rank, found in enumerate(retrieved, start=1):
        gain = 1.0 if rank == 1 else 1.0 / math.log2(rank)
        if rank <= total:
            ideal += gain
        if found == label:
            hits += 1
            dcg += gain
            precisions.append(hits / rank)
    shown = retrieved[:32]
    p, r = shown.count(label) / len(shown), shown.count(label) / total
    return {
        "nn": 1.0 if retrieved[0] == label else 0.0,
        "first_tier": retrieved[:total].count(label) / total,
        "second_tier": retrieved[: 2 * total].count(label) / total,
        "e_measure": 0.0 if p == 0 else 2 / (1 / p + 1 / r),
        "dcg": dcg / ideal,
        "map": sum(precisions) / total,
    }


def interpolated(retrieved, label, numerator, denominator):
    """The greatest precision at any rank whose recall is at least numerator / denominator."""
    total = retrieved.count(label)
    best, hits = 0.0, 0
    for rank, found in enumerate(retrieved, start=1):
        hits += found == label
        if hits * denominator >= numerator * total:
            best = max(best, hits / rank)
    return best


def evaluate(D, labels, ids):
    """Means over queries, over classes, per class, and the two curves."""
    queries = [q for q, label in enumerate(labels) if label is not None and labels.count(label) > 1]
    lists = {q: ranked_labels(D, labels, ids, q) for q in queries}
    found = {q: scores(lists[q], labels[q]) for q in queries}
    names = ["nn", "first_tier", "second_tier", "e_measure", "dcg", "map"]

    def mean(rows, name):
        return sum(found[q][name] for q in rows) / len(rows)

    classes = {label: [q for q in queries if labels[q] == label] for label in {labels[q] for q in queries}}
    per_class = {label: {name: mean(rows, name) for name in names} for label, rows in classes.items()}
    levels = max(len(rows) for rows in classes.values()) - 1

    def curve(first, last):
        return [
            sum(interpolated(lists[q], labels[q], j, last) for q in queries) / len(queries)
            for j in range(first, last + 1)
        ]

    return {
        "overall": {name: mean(queries, name) for name in names},
        "class_mean": {name: sum(c[name] for c in per_class.values()) / len(per_class) for name in names},
        "per_class": per_class,
        "precision": curve(1, levels),
        "eleven_point": curve(0, 10),
    }
