"""Factorisation of a sparse symmetric matrix on a surface: B = L S L^T, L lower triangular, S a diagonal of signs.

Rows are ordered by nested dissection (George, "Nested dissection of a regular finite element mesh", 1973): a plane
across the longest extent halves the vertices, those along the cut come last, and each half is treated likewise. On a
surface cuts are short, so that L has O(m log m) entries. The columns of a cut make one dense panel, and panels are
eliminated by dense fronts (Duff and Reid, "The multifrontal solution of indefinite sparse symmetric linear
equations", 1983), without pivoting: as safe as Cholesky's for positive definite B, and B may also have a few negative
eigenvalues, which S counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from reebase.errors import ComputationError

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

__all__ = ["BLOCK", "Elimination", "Factor"]

BLOCK = 4
"""Right sides solved for at once; the kernels are written out for it."""

LEAF = 16
"""Up to so many vertices a part is not cut further."""

CROWDED = 10.0
"""Vertices with more neighbours than this times sqrt(m) come last: no cut can hold them apart."""

MOST_ENTRIES = 200_000_000
"""Of L: 1.6 GB. A million vertices of a surface take 80 million."""

FULL = 30.0
"""More entries of L than this times m log2 m mean that the order is bad; surfaces have 2 to 10 times that."""

Array = npt.NDArray[np.float64]


Int32 = npt.NDArray[np.int32]
Int64 = npt.NDArray[np.int64]
Pattern = tuple[Int32, Int64, Int32, Int64]


class _Dissection(NamedTuple):
    """order: of the vertices; pattern and steps: of the panels; height: entries of the fronts at once."""

    order: Int32
    pattern: Pattern
    steps: tuple[Int32, Int32, Int32, Int32]
    height: int


class Elimination:
    """The order of elimination and the pattern of L: what factors of one C share, whatever is added to its diagonal.

    C: symmetric, CSR, (m, m). points: where the vertices are, (m, 3), to cut between them; None when that is unknown,
    and they are then placed by distances along the edges of C.
    """

    def __init__(self, C: csr_matrix, points: Array | None = None) -> None:
        from reebase.spectrum import factor_kernels as kernels

        self._graph = C.indptr.astype(np.int32, copy=False), C.indices.astype(np.int32, copy=False)
        self._values = C.data
        crowded = int(CROWDED * np.sqrt(C.shape[0]))
        placed = kernels.places(*self._graph, crowded) if points is None else np.array(points)
        self._dissection = self._dissect(placed, crowded)
        if points is not None and self.entries > FULL * C.shape[0] * np.log2(C.shape[0] + 1):
            # Edges run across the whole shape, so that planes cannot cut it; distances along its edges can.
            by_planes, entries = self._dissection, self.entries
            self._dissection = self._dissect(kernels.places(*self._graph, crowded), crowded)
            if self.entries > entries:
                self._dissection = by_planes

    def _dissect(self, points: Array, crowded: int) -> _Dissection:
        from reebase.spectrum import factor_kernels as kernels

        points = np.asarray(points, dtype=np.float64)
        order, first = kernels.dissect(*self._graph, points, LEAF, crowded)
        number, starts, rows, child, sibling = kernels.fill_in(*self._graph, order, first)
        sequence, panel, height = kernels.schedule(first, starts, child, sibling)
        return _Dissection(order, (first, starts, rows, panel), (number, child, sibling, sequence), height)

    @property
    def entries(self) -> int:
        """Entries that L will have."""
        return int(self._dissection.pattern[3][-1])

    def factor(self, shift: Array) -> Factor:
        """L and S of C + diag(shift), shift (m,).

        Raises ComputationError when a pivot vanishes, or L would have more than ``MOST_ENTRIES``.
        """
        from reebase.spectrum.factor_kernels import factorise

        made = self._dissection
        if self.entries > MOST_ENTRIES:
            raise ComputationError(
                f"The operator's factor would have {self.entries:,} entries, {MOST_ENTRIES:,} are allowed: the "
                "surface hangs together too densely, as triangles thrown together at random do.",
                entries=self.entries, limit=MOST_ENTRIES,
            )  # fmt: skip
        L, signs, failed = factorise(
            *self._graph, self._values, shift, made.order, *made.pattern, *made.steps, made.height
        )
        if failed >= 0:
            raise ComputationError(
                f"The operator could not be factorised (no pivot at vertex {failed}); a vertex without faces, or a "
                "surface whose triangles have no area, makes it singular.",
                vertex=int(failed),
            )
        return Factor(made.order, made.pattern, L, signs)


@dataclass(frozen=True, eq=False)
class Factor:
    """L and S of a matrix: solves with it, and counts its negative eigenvalues."""

    _order: Int32
    _pattern: Pattern
    _L: Array
    _signs: Array

    @property
    def negative(self) -> int:
        """How many eigenvalues are negative (Sylvester's law of inertia)."""
        return int(np.count_nonzero(self._signs < 0.0))

    @property
    def entries(self) -> int:
        """Entries of L that are kept."""
        return len(self._L)

    def solve(self, b: Array, scale: Array) -> Array:
        """D B^-1 D b for the rows of b, (n, m), with D = diag(scale)."""
        from reebase.spectrum.factor_kernels import solve

        x = np.empty_like(b)
        for begin in range(0, len(b), BLOCK):
            rows = b[begin : begin + BLOCK]
            block = rows if len(rows) == BLOCK else np.pad(rows, ((0, BLOCK - len(rows)), (0, 0)))
            solved = solve(self._order, *self._pattern, self._L, self._signs, scale, block)
            x[begin : begin + BLOCK] = solved[: len(rows)]
        return x
