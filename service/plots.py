"""Plots of evaluations: drawn one at a time, kept for a while, from what was reduced to the size of a picture."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import numpy.typing as npt

__all__ = ["Plots", "blocks"]

_KEPT = 64
_MOST_CELLS = 300


class Plots:
    """The plots that were drawn last. Drawing takes a tenth of a second of one core, so only one draws at a time."""

    def __init__(self, most: int = _KEPT) -> None:
        self._most = most
        self._drawing = threading.Lock()
        self._kept: OrderedDict[str, bytes] = OrderedDict()

    def get(self, name: str, draw: Callable[[], bytes]) -> bytes:
        """What was drawn under this name, or what ``draw`` gives now."""
        with self._drawing:
            if name not in self._kept:
                self._kept[name] = draw()
                while len(self._kept) > self._most:
                    self._kept.popitem(last=False)
            self._kept.move_to_end(name)
            return self._kept[name]


def blocks(
    rows: Iterator[npt.NDArray[np.float64]], labels: Sequence[str], most: int = _MOST_CELLS
) -> tuple[npt.NDArray[np.float64], list[str]]:
    """A matrix (n, n) that comes row by row, sorted by class, its cells merged to at most ``most`` squared means.

    Returns the matrix, (k, k), and the class of each of its rows.
    """
    order = sorted(range(len(labels)), key=lambda at: labels[at])
    size = min(len(labels), most)
    cell = np.empty(len(labels), dtype=np.int64)
    cell[order] = np.arange(len(labels)) * size // len(labels)
    sums = np.zeros((size, size))
    for at, row in enumerate(rows):
        sums[cell[at]] += np.bincount(cell, np.minimum(row, np.finfo(np.float64).max / len(labels)), size)
    counts = np.bincount(cell, minlength=size)
    names = [""] * size
    for at in reversed(order):
        names[cell[at]] = labels[at]
    return sums / np.outer(counts, counts), names
