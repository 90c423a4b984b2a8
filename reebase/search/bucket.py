"""A bucket of the index: all shapes with one count of endpoints, in arrays that a kernel walks in one go."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

__all__ = ["Bucket"]

_FIRST_CAPACITY = 16


@dataclass(frozen=True, eq=False)
class Bucket:
    """A snapshot of the shapes with ``count`` endpoints; what a reader holds never changes under it.

    The arrays have room to grow and are shared with later snapshots: one writer at a time appends beyond the
    ``rows`` of every snapshot before, and takes a copy of ``alive`` to remove. So adding costs O(1)
    amortised, without a lock for readers.

    ids: of each row, a list that may be longer than ``rows``. features: float64, (capacity, count, 3), as
    given.
    projections: the same with each of a, dv, dc sorted by itself, decreasing, float64, (capacity, 3, count).
    alive: bool, (capacity,), False where a shape was removed. removed: how many of ``rows`` these are.
    """

    count: int
    ids: list[str]
    features: npt.NDArray[np.float64]
    projections: npt.NDArray[np.float64]
    alive: npt.NDArray[np.bool_]
    rows: int = 0
    removed: int = 0

    @classmethod
    def empty(cls, count: int) -> Bucket:
        """A bucket without shapes for ``count`` endpoints."""
        return cls(
            count, [], np.empty((0, count, 3)), np.empty((0, 3, count)), np.empty(0, dtype=np.bool_)
        )

    def __len__(self) -> int:
        return self.rows - self.removed

    def appended(self, name: str, features: npt.NDArray[np.float64]) -> Bucket:
        """The snapshot with one shape more, in row ``self.rows``."""
        room = self if self.rows < len(self.alive) else self._grown()
        room.features[self.rows] = features
        room.projections[self.rows] = project(features)
        room.alive[self.rows] = True
        room.ids.append(name)
        return replace(room, rows=self.rows + 1)

    def without(self, row: int) -> Bucket:
        """The snapshot in which ``row`` is removed; the other rows stay where they are."""
        alive = self.alive.copy()
        alive[row] = False
        return replace(self, alive=alive, removed=self.removed + 1)

    def compacted(self) -> Bucket:
        """The snapshot with the removed rows gone, the others moved up in order."""
        kept = np.flatnonzero(self.alive[: self.rows])
        return Bucket(
            self.count, [self.ids[row] for row in kept], self.features[kept], self.projections[kept],
            np.ones(len(kept), dtype=np.bool_), len(kept),
        )  # fmt: skip

    def selected(self, among: frozenset[str] | None) -> npt.NDArray[np.int64]:
        """The rows that are alive and, unless None, whose id is in ``among``."""
        wanted = self.alive[: self.rows]
        if among is not None:
            ids = self.ids[: self.rows]
            wanted = wanted & np.fromiter(map(among.__contains__, ids), dtype=np.bool_, count=len(ids))
        return np.flatnonzero(wanted)

    def _grown(self) -> Bucket:
        more = max(_FIRST_CAPACITY, len(self.alive))
        return replace(
            self,
            features=np.concatenate([self.features, np.zeros((more, self.count, 3))]),
            projections=np.concatenate([self.projections, np.zeros((more, 3, self.count))]),
            alive=np.concatenate([self.alive, np.zeros(more, dtype=np.bool_)]),
        )


def project(features: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Each column of ``features`` (k, 3) sorted by itself, decreasing, as rows: float64, (3, k)."""
    return np.ascontiguousarray(-np.sort(-features.T, axis=1))
