"""How what is kept of shapes is compared: one with many, all pairs, and why two are as far apart as they are."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError
from reebase.matching.explanation import Match

__all__ = ["Comparison", "Stack"]

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.floating[Any]]
Progress = Callable[[float], None]


class Stack(NamedTuple):
    """The rows of n shapes in one array. values: of the comparison's precision, (total, w). offsets: int64, (n + 1,);
    shape i has the rows offsets[i] .. offsets[i + 1]."""

    values: Floats
    offsets: npt.NDArray[np.int64]

    @classmethod
    def of(cls, shapes: Sequence[Floats]) -> Stack:
        """shapes: rows (k, w) each. Raises ParameterError unless w is the same for all."""
        widths = sorted({rows.shape[1] for rows in shapes})
        if len(widths) > 1:
            raise ParameterError(f"Rows of {widths} numbers cannot be compared: all must have the same number.")
        values = np.ascontiguousarray(np.vstack(shapes)) if shapes else np.empty((0, 1))
        return cls(values, np.cumsum([0, *map(len, shapes)], dtype=np.int64))

    @property
    def shapes(self) -> int:
        return len(self.offsets) - 1

    def since(self, first: int) -> Stack:
        """The shapes from ``first`` on, without copying their rows."""
        start = self.offsets[first]
        return Stack(self.values[start:], self.offsets[first:] - start)


@dataclass(frozen=True)
class Comparison:
    """One way to compare shapes of which rows (k, w) are kept; a vector is one row.

    rows: what is kept and what a refusal calls it -> its rows as the kernels want them, C-contiguous, of ``precision``;
    raises ParameterError for what cannot be compared.
    one_to_many: rows of the query, a stack of n shapes, the name of a measure -> (n,), >= 0.
    one_sided: measures under which it matters which of two is the query; of the others D(a, b) = D(b, a), to the bit.
    explain: what is kept of two shapes and the name of a measure -> the parts of their dissimilarity, where it has any.
    precision: of the rows. Single, which is how they are stored, where many numbers go into one dissimilarity.
    """

    rows: Callable[[Any, str], Floats]
    one_to_many: Callable[[Any, Stack, str], Array]
    one_sided: frozenset[str] = frozenset()
    explain: Callable[[Any, Any, str], Match] | None = None
    precision: type[np.floating[Any]] = np.float64

    def matrix(self, kept: Sequence[Any], measure: str, progress: Progress | None = None) -> Array:
        """The dissimilarity of all pairs, float64, (n, n), row = query, with the bits of ``one_to_many``.

        progress: called with the fraction of the work that is done, after each row. Raises ParameterError.
        """
        return self.all_pairs([self.rows(one, f"shapes[{i}]") for i, one in enumerate(kept)], measure, progress)

    def all_pairs(self, shapes: Sequence[Floats], measure: str, progress: Progress | None = None) -> Array:
        """As ``matrix``, of shapes whose ``rows`` are known."""
        stack, symmetric = Stack.of(shapes), measure not in self.one_sided
        count, done = len(shapes), 0
        out = np.zeros((count, count))
        for i, query in enumerate(shapes):
            first = i if symmetric else 0
            out[i, first:] = self.one_to_many(query, stack.since(first), measure)
            if symmetric:
                out[i:, i] = out[i, i:]
            done += count - first
            if progress is not None:
                progress(done / (count * (count + 1) / 2 if symmetric else count * count))
        return out
