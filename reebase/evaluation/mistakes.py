"""Where an evaluation went wrong: which classes are taken for which, and the queries that were answered worst."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from reebase.evaluation.measures import Evaluation

__all__ = ["Confusion", "confusion"]


@dataclass(frozen=True, eq=False)
class Confusion:
    """How often the nearest shape to a query of each class is of each class.

    labels: the classes, sorted. counts: row = class of the query, column = class of its nearest other shape,
    int64, (c, c); the row of a class of one is 0, as its shape is no query.
    """

    labels: tuple[str, ...]
    counts: npt.NDArray[np.int64]


def confusion(evaluation: Evaluation) -> Confusion:
    """The classes of nearest neighbours, over all queries."""
    labels = tuple(sorted(evaluation.counts))
    place = {label: number for number, label in enumerate(labels)}
    counts = np.zeros((len(labels), len(labels)), dtype=np.int64)
    for query in evaluation.queries:
        nearest = evaluation.labels[int(evaluation.ranked(int(query))[0])]
        counts[place[evaluation.labels[int(query)]], place[nearest]] += 1
    return Confusion(labels, counts)
