"""``fused``: one dissimilarity out of several descriptors' (METHOD §6).

The idea: distances of different descriptors have no common unit, and how much one means differs from shape to shape: in
a crowd a small distance says little. Each is therefore measured in units of what lies around the two shapes compared
(self-tuning scales, Zelnik-Manor and Perona, "Self-Tuning Spectral Clustering", NIPS 2004); then they are added.
A descriptor to which all shapes of a collection look about equally far, as bent shapes do to ``views``, adds
about the same to all of them, and so has little to say: nothing needs to find out whether it is of use.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError

__all__ = ["PARTS", "REFERENCES", "Fused", "Statistics", "fuse", "fused_matrix", "statistics"]

Array = npt.NDArray[np.float64]
Rows = Mapping[str, Array]

WEIGHTS: Mapping[str, float] = MappingProxyType({"extended": 3.0, "moments": 1.0, "wks": 1.0, "views": 5.0})
"""The descriptors that are fused, each by its default measure, and what each counts."""

PARTS: tuple[str, ...] = tuple(WEIGHTS)

REFERENCES = 256
"""Shapes of a collection from which scales are taken; of a smaller collection all. They must be a fair sample: shapes
come class by class."""

NEAREST = 10
SHARE = 15
"""The scale of a shape is its mean distance to its nearest references: one in 15 of them, and at least ten. Larger
collections tend to have larger classes; below ten the scale is that of the nearest relative, and noise."""

SMALLEST = 1e-12
"""Scales below this count as this: copies of one shape are at distance 0 from one another."""


@dataclass(frozen=True)
class Statistics:
    """What is known of a collection of n shapes, by part.

    scales: part -> mean distance of each shape to its nearest references, > 0, float64, (n,).
    """

    scales: Mapping[str, Array]


class Fused(NamedTuple):
    """dissimilarities: >= 0, about 1 to the nearest of a shape, float64, (n,). shares: part -> its share of the
    similarity, (n,), in all 1."""

    dissimilarities: Array
    shares: Mapping[str, Array]


def statistics(distances: Rows, references: npt.ArrayLike) -> Statistics:
    """Of n shapes from their distances to r of them: part -> (n, r), for every part.

    references: which of the n these are, int, (r,), -1 for one that is none of them. A shape's distance to itself is
    left out. Row i depends on row i alone: a shape that comes to a large collection adds a row, and the others stay.
    Raises ParameterError when a part is missing or shapes do not agree.
    """
    columns = np.asarray(references, dtype=np.int64)
    _check(distances, (None, len(columns)))
    inside = np.flatnonzero(columns >= 0)
    scales = {}
    for part in PARTS:
        rows = np.array(distances[part], dtype=np.float64)
        rows[columns[inside], inside] = np.inf
        scales[part] = _scales(rows)
    return Statistics(scales)


def fuse(distances: Rows, own: Mapping[str, float], collection: Statistics) -> Fused:
    """The fused dissimilarity of a query to n shapes.

    distances: part -> (n,). own: the query's scales, its own row of ``collection.scales`` where it is one of the
    shapes. F = sum_p w_p x_p / sum_p w_p with x_p = d_p / sqrt(s_p s~_p): symmetric, 0 where all parts are 0. The share
    of a part is w_p exp(-x_p) over the sum of these: how much it has to do with the two being near.
    Raises as ``statistics``.
    """
    count = len(collection.scales[PARTS[0]])
    _check(distances, (count,))
    weights = np.array(list(WEIGHTS.values()))[:, None] / sum(WEIGHTS.values())
    scaled = np.stack([distances[part] / np.sqrt(own[part] * collection.scales[part]) for part in PARTS])
    nearness = weights * np.exp(scaled.min(axis=0) - scaled)
    shares = dict(zip(PARTS, nearness / nearness.sum(axis=0), strict=True))
    return Fused((weights * scaled).sum(axis=0), shares)


def fused_matrix(distances: Rows, collection: Statistics | None = None) -> Array:
    """The fused dissimilarity of all pairs, part -> (n, n); row i is what ``fuse`` gives for shape i as query.

    collection: its statistics; by default those of these n shapes, all of them references. Float64, (n, n).
    """
    count = len(distances[PARTS[0]]) if PARTS[0] in distances else 0
    _check(distances, (count, count))
    known = statistics(distances, np.arange(count)) if collection is None else collection
    out = np.zeros((count, count))
    for i in range(count):
        own = {part: float(known.scales[part][i]) for part in PARTS}
        out[i] = fuse({part: distances[part][i] for part in PARTS}, own, known).dissimilarities
    return out


def _scales(rows: Array) -> Array:
    """Mean of the nearest in each row, those at infinity left out; 1 where there is none."""
    near = np.sort(rows, axis=1)[:, : max(NEAREST, rows.shape[1] // SHARE)]
    present = np.isfinite(near)
    total = np.where(present, near, 0.0).sum(axis=1)
    count = present.sum(axis=1)
    return np.where(count > 0, np.maximum(total / np.maximum(count, 1), SMALLEST), 1.0)


def _check(distances: Rows, shape: tuple[int | None, ...]) -> None:
    for part in PARTS:
        if part not in distances:
            raise ParameterError(f"fused needs the distances of {', '.join(PARTS)}; found no {part}.", parameter=part)
        found = np.shape(distances[part])
        if len(found) != len(shape) or any(w is not None and w != f for w, f in zip(shape, found, strict=True)):
            wanted = ", ".join("n" if w is None else str(w) for w in shape)
            raise ParameterError(f"Distances of {part} must have shape ({wanted}); found {found}.", parameter=part)
