"""Which queries and which shapes a report shows: chosen by rule, never by hand."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from reebase.evaluation import Evaluation
from reebase.report.record import Entry

__all__ = ["HITS", "Row", "by_class", "sample_of", "shown_in", "typical", "worst"]

HITS = 10
"""Retrieved shapes that are shown of a query (Kacem, Table 4.2)."""

TYPICAL = 10
WORST = 5
"""Queries that are shown at most: of the typical ones one a class."""

SAMPLE = 10
"""Rows of the matrix that are printed as numbers (Kacem, Table 4.1)."""


@dataclass(frozen=True)
class Row:
    """A query and what it retrieves first.

    query, hits: rows of the evaluation. relevant: whether each hit is of the query's class.
    average_precision: of the whole list.
    """

    query: int
    hits: tuple[int, ...]
    relevant: tuple[bool, ...]
    average_precision: float


def typical(entries: Sequence[Entry]) -> list[str]:
    """The query of each class that is in the middle of it by average precision, by id, at most ten classes.

    The same for all entries, so that their lists can be compared: the precision is the mean over them.
    """
    sums: dict[str, list[float]] = {}
    label_of: dict[str, str] = {}
    for entry in entries:
        one = entry.evaluation
        for query, precision in zip(one.queries, one.scores["map"], strict=True):
            sums.setdefault(one.ids[query], []).append(float(precision))
            label_of[one.ids[query]] = one.labels[query]
    members: dict[str, list[tuple[float, str]]] = {}
    for shape, precisions in sums.items():
        members.setdefault(label_of[shape], []).append((float(np.mean(precisions)), shape))
    labels = sorted(members)
    spread = np.unique(np.linspace(0, len(labels) - 1, min(TYPICAL, len(labels))).round().astype(int))
    return [sorted(members[labels[at]])[len(members[labels[at]]) // 2][1] for at in spread]


def worst(evaluation: Evaluation, limit: int = WORST) -> list[Row]:
    """The queries of the least average precision, worst first, ties by id."""
    precision = evaluation.scores["map"]
    order = sorted(range(len(precision)), key=lambda q: (precision[q], evaluation.ids[evaluation.queries[q]]))
    return [_row(evaluation, q) for q in order[:limit]]


def rows_of(evaluation: Evaluation, shapes: Iterable[str]) -> list[Row]:
    """The lists of these queries, by id; of those that are queries here."""
    place = {evaluation.ids[query]: q for q, query in enumerate(evaluation.queries)}
    return [_row(evaluation, place[shape]) for shape in shapes if shape in place]


def _row(evaluation: Evaluation, q: int) -> Row:
    query = int(evaluation.queries[q])
    hits = tuple(int(hit) for hit in evaluation.ranked(query)[:HITS])
    relevant = tuple(evaluation.labels[hit] == evaluation.labels[query] for hit in hits)
    return Row(query, hits, relevant, float(evaluation.scores["map"][q]))


def sample_of(evaluation: Evaluation) -> list[int]:
    """Rows of the matrix to print: two shapes of each of five classes, so that likes and strangers are both seen."""
    rows = by_class(evaluation)
    members: dict[str, list[int]] = {}
    for row in rows:
        members.setdefault(evaluation.labels[row], []).append(int(row))
    labels = [label for label, own in members.items() if len(own) > 1] or list(members)
    each = max(2, SAMPLE // len(labels))
    return [row for label in labels for row in members[label][:each]][:SAMPLE]


def by_class(evaluation: Evaluation) -> npt.NDArray[np.int64]:
    """All rows, sorted by class and then by id, (n,)."""
    keys = list(zip(evaluation.labels, evaluation.ids, strict=True))
    return np.array(sorted(range(len(keys)), key=keys.__getitem__), dtype=np.int64)


def shown_in(entries: Sequence[Entry]) -> list[str]:
    """Ids of the shapes whose thumbnails a report shows, sorted."""
    chosen = typical(entries)
    shown: set[str] = set()
    for entry in entries:
        for row in (*rows_of(entry.evaluation, chosen), *worst(entry.evaluation)):
            shown.update(entry.evaluation.ids[at] for at in (row.query, *row.hits))
    return sorted(shown)
