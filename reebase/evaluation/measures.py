"""Evaluation of a dissimilarity matrix against labels, leave-one-out (METHOD §7)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError
from reebase.evaluation import ranking
from reebase.evaluation.intervals import Interval, intervals

__all__ = ["SCORES", "Evaluation", "PrecisionRecall", "evaluate"]

SCORES: Mapping[str, Callable[[npt.NDArray[np.bool_]], float]] = MappingProxyType({
    "nn": ranking.nearest_neighbour,
    "first_tier": lambda relevant: ranking.tier(relevant, 1),
    "second_tier": lambda relevant: ranking.tier(relevant, 2),
    "e_measure": ranking.e_measure,
    "dcg": ranking.discounted_gain,
    "map": ranking.average_precision,
})  # fmt: skip
"""name -> measure of one ranked list; the overall figure is the mean over the queries."""


@dataclass(frozen=True, eq=False)
class PrecisionRecall:
    """Precision against recall, interpolated and averaged over the queries; each has the same weight.

    recall: the levels 1/L, 2/L, ... 1, float64, (L,), where L is the greatest number R of relevant shapes
    that a query has. Where all classes have one size these are exactly the recalls that occur; a query with
    fewer relevant shapes contributes its interpolated precision there, a step function. precision: float64,
    (L,).
    eleven_point: the interpolated precision at recall 0, 0.1, ... 1, float64, (11,).
    """

    recall: npt.NDArray[np.float64]
    precision: npt.NDArray[np.float64]
    eleven_point: npt.NDArray[np.float64]

    def to_json(self) -> dict[str, list[float]]:
        """JSON-serialisable; the numbers round-trip."""
        return {
            "recall": self.recall.tolist(),
            "precision": self.precision.tolist(),
            "eleven_point": self.eleven_point.tolist(),
        }


@dataclass(frozen=True, eq=False)
class Evaluation:
    """How well a dissimilarity finds shapes of the query's class, each shape the query once.

    ids, labels: of the n labelled shapes, in the order given. matrix: their D, float64, (n, n), row = query.
    queries: which rows were queries, int64, (q,): all but the classes of one.
    scores: measure -> its value for each query, float64, (q,); measures are nn, first_tier, second_tier,
    e_measure, dcg, map. overall: measure -> mean over the queries. class_mean: measure -> mean over the
    classes of the mean in each. per_class: label -> the means in that class. counts: label -> number of its
    shapes, classes of one as well.
    intervals: measure -> 95 % interval of ``overall``, from resampling the queries; empty without resampling.
    class_mean_intervals, class_intervals: the same of ``class_mean`` and, by label, of ``per_class``, from resampling
    the queries of each class by themselves: how far they would move with other shapes of these classes. Of a class of
    a few shapes such an interval is too narrow, as resampling knows no values but those it has.
    tie_order: the rows in the order in which equal dissimilarities are ranked, int64, (n,).
    unlabelled: how many shapes had no label; these take no part at all, since whether they are relevant is
    not known.
    """

    ids: tuple[str, ...]
    labels: tuple[str, ...]
    matrix: npt.NDArray[np.float64]
    queries: npt.NDArray[np.int64]
    scores: Mapping[str, npt.NDArray[np.float64]]
    overall: Mapping[str, float]
    class_mean: Mapping[str, float]
    per_class: Mapping[str, Mapping[str, float]]
    counts: Mapping[str, int]
    intervals: Mapping[str, Interval]
    class_mean_intervals: Mapping[str, Interval]
    class_intervals: Mapping[str, Mapping[str, Interval]]
    precision_recall: PrecisionRecall
    unlabelled: int
    tie_order: npt.NDArray[np.int64]

    @property
    def left_out(self) -> tuple[str, ...]:
        """Labels of the classes of one, sorted. Their shapes are no queries, only candidates."""
        return tuple(sorted(label for label, count in self.counts.items() if count == 1))

    def ranked(self, row: int) -> npt.NDArray[np.int64]:
        """All other rows, the nearest to the query ``row`` first, int64, (n - 1,)."""
        return _nearest(self.matrix, self.tie_order, row)

    def to_json(self, matrix: bool = False) -> dict[str, Any]:
        """A JSON-serialisable report, with the dissimilarity matrix if asked for."""
        report: dict[str, Any] = {
            "queries": len(self.queries),
            "classes": len(self.per_class),
            "left_out": {
                "unlabelled": self.unlabelled,
                "classes_of_one": len(self.left_out),
                "labels": list(self.left_out),
            },
            "overall": dict(self.overall),
            "intervals": _lists(self.intervals),
            "class_mean": dict(self.class_mean),
            "class_mean_intervals": _lists(self.class_mean_intervals),
            "per_class": {
                label: {"count": self.counts[label], **means, "intervals": _lists(self.class_intervals.get(label, {}))}
                for label, means in self.per_class.items()
            },
            "precision_recall": self.precision_recall.to_json(),
        }
        if matrix:
            report["matrix"] = {
                "ids": list(self.ids),
                "labels": list(self.labels),
                "values": self.matrix.tolist(),
            }
        return report


def evaluate(
    D: npt.ArrayLike,
    labels: Sequence[str | None],
    ids: Sequence[str] | None = None,
    bootstrap: int = 1000,
    seed: int = 0,
) -> Evaluation:
    """Leave-one-out evaluation of a dissimilarity matrix.

    D: finite, shape (n, n); row i ranks all others for query i, so it need not be symmetric, and the diagonal
    is not looked at. labels: the class of each shape, None for unknown. ids: equal dissimilarities
    are ranked by id, then by position. bootstrap: how often the queries are resampled for the
    intervals (percentiles 2.5 and 97.5 of the resampled means), 0 for none; seed: of these.
    A class of one has nothing to find: its shape is no query, but remains a candidate, relevant to nobody. A
    shape without a label is taken out of rows and columns.
    Raises ParameterError for other shapes and values, and when no label occurs twice.
    """
    matrix, names = _checked(D, labels, ids)
    for name, number in (("bootstrap", bootstrap), ("seed", seed)):
        if number % 1 or number < 0:
            raise ParameterError(f"{name} must be a whole number of at least 0; found {number}.", parameter=name)
    known = np.array([i for i, label in enumerate(labels) if label is not None], dtype=np.int64)
    kept = [str(labels[i]) for i in known]
    counts = Counter(kept)
    queries = np.array([row for row, label in enumerate(kept) if counts[label] > 1], dtype=np.int64)
    if len(queries) == 0:
        raise ParameterError(
            "There is nothing to evaluate: no label occurs twice. Label at least two shapes alike.",
            parameter="labels", labelled=len(kept),
        )  # fmt: skip
    matrix = matrix[np.ix_(known, known)]
    kept_ids = [names[i] for i in known]
    ties = np.array(range(len(known)) if ids is None else sorted(range(len(known)), key=kept_ids.__getitem__))
    lists = _relevant(matrix, kept, ties, queries)
    scores = {
        name: np.array([measure(relevant) for relevant in lists]) for name, measure in SCORES.items()
    }
    rows_of: dict[str, list[int]] = {}
    for q, row in enumerate(queries):
        rows_of.setdefault(kept[row], []).append(q)
    per_class = {
        label: {name: float(values[rows_of[label]].mean()) for name, values in scores.items()}
        for label in sorted(rows_of)
    }
    of_all, of_mean, of_class = intervals(scores, {label: rows_of[label] for label in per_class}, bootstrap, seed)
    return Evaluation(
        ids=tuple(kept_ids),
        labels=tuple(kept),
        matrix=matrix,
        queries=queries,
        scores=scores,
        overall={name: float(values.mean()) for name, values in scores.items()},
        class_mean={
            name: float(np.mean([means[name] for means in per_class.values()])) for name in SCORES
        },
        per_class=per_class,
        counts=dict(counts),
        intervals=of_all,
        class_mean_intervals=of_mean,
        class_intervals=of_class,
        precision_recall=_precision_recall(lists),
        unlabelled=len(labels) - len(kept),
        tie_order=ties,
    )


def _checked(
    D: npt.ArrayLike, labels: Sequence[str | None], ids: Sequence[str] | None
) -> tuple[npt.NDArray[np.float64], list[str]]:
    """D as an array and the ids, or positions as text."""
    matrix = np.asarray(D, dtype=np.float64)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise ParameterError(f"D must have shape (n, n); found {matrix.shape}.", parameter="D")
    if len(labels) != len(matrix):
        raise ParameterError(
            f"There must be a label, or None, for each of the {len(matrix)} shapes; found {len(labels)}.",
            parameter="labels",
        )
    bad = np.argwhere(~np.isfinite(matrix))
    if len(bad):
        raise ParameterError(
            f"D must be finite; found {matrix[tuple(bad[0])]} at {bad[0].tolist()}.", parameter="D"
        )
    if ids is None:
        return matrix, [str(i) for i in range(len(matrix))]
    if len(ids) != len(matrix):
        raise ParameterError(f"There must be {len(matrix)} ids; found {len(ids)}.", parameter="ids")
    return matrix, list(ids)


def _nearest(
    matrix: npt.NDArray[np.float64], ties: npt.NDArray[np.int64], row: int
) -> npt.NDArray[np.int64]:
    others = ties[ties != row]
    return np.asarray(others[np.argsort(matrix[row, others], kind="stable")])


def _relevant(
    matrix: npt.NDArray[np.float64],
    labels: list[str],
    ties: npt.NDArray[np.int64],
    queries: npt.NDArray[np.int64],
) -> list[npt.NDArray[np.bool_]]:
    """For each query, whether the shapes at rank 1, 2, ... are relevant, bool, (n - 1,)."""
    number = {label: n for n, label in enumerate(dict.fromkeys(labels))}
    classes = np.array([number[label] for label in labels])
    return [classes[_nearest(matrix, ties, int(query))] == classes[query] for query in queries]


def _precision_recall(lists: list[npt.NDArray[np.bool_]]) -> PrecisionRecall:
    levels = max(int(relevant.sum()) for relevant in lists)
    curve = np.mean([ranking.interpolated_precision(relevant, levels)[1:] for relevant in lists], axis=0)
    eleven = np.mean([ranking.interpolated_precision(relevant, 10) for relevant in lists], axis=0)
    return PrecisionRecall(np.arange(1, levels + 1) / levels, curve, eleven)


def _lists(intervals: Mapping[str, Interval]) -> dict[str, list[float]]:
    return {name: list(interval) for name, interval in intervals.items()}
