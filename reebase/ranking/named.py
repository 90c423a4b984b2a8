"""What a collection can be ranked by, by name: one descriptor under one of its measures, or all parts fused."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from reebase.descriptors import DESCRIPTORS, descriptor_named
from reebase.errors import ParameterError, unknown_name
from reebase.ranking.diffusion import reranked_matrix
from reebase.ranking.fusion import PARTS, fused_matrix

__all__ = ["DEFAULT", "FUSED", "RANKINGS", "Ranking", "ranking_named"]

Array = npt.NDArray[np.float64]

FUSED = "fused"
RANKINGS: tuple[str, ...] = (FUSED, *DESCRIPTORS)
"""What ``descriptor`` may be, wherever it ranks."""

DEFAULT = FUSED
"""Of a query that names none: what measures best."""


@dataclass(frozen=True)
class Ranking:
    """name: of RANKINGS. measure: of the descriptor, None for fused. rerank: whether diffusion follows the fusion."""

    name: str
    measure: str | None
    rerank: bool

    @property
    def parts(self) -> Mapping[str, str]:
        """The descriptors that are compared -> by which measure."""
        if self.measure is not None:
            return {self.name: self.measure}
        return {part: descriptor_named(part).measures[0] for part in PARTS}

    def matrix(
        self, kept: Mapping[str, Sequence[Array]], *, progress: Callable[[float], None] | None = None
    ) -> Array:
        """The dissimilarity of all pairs by which this ranks, float64, (n, n), row = query.

        kept: of each part, what it keeps of the n shapes. Raises KeyError for a part that is missing, ParameterError.
        """
        found = {}
        for done, (part, measure) in enumerate(self.parts.items()):
            found[part] = descriptor_named(part).distances(
                kept[part], measure, progress=_share(progress, done, len(self.parts))
            )
        return self.combined(found)

    def combined(self, distances: Mapping[str, Array]) -> Array:
        """The same from the dissimilarities of all pairs by each part, (n, n): several rankings may share these."""
        if self.measure is not None:
            return distances[self.name]
        fused = fused_matrix(distances)
        return reranked_matrix(fused) if self.rerank else fused


def ranking_named(name: str | None = None, measure: str | None = None, rerank: bool | None = None) -> Ranking:
    """The ranking. None stands for the default of each; where only a measure of D is named, it is ``srg``.

    Raises UnknownName for another name or measure, ParameterError for ``rerank`` of a single descriptor: its
    dissimilarities have no unit that a walk over neighbours could use.
    """
    if name is None:
        name = DEFAULT if measure is None else "srg"
    if name not in RANKINGS:
        raise unknown_name("descriptor", name[:80], RANKINGS)
    if name != FUSED:
        if rerank:
            raise ParameterError(f"rerank goes with the descriptor {FUSED}; found {name}.", parameter="rerank")
        return Ranking(name, descriptor_named(name).measure_named(measure), False)
    if measure is not None:
        raise ParameterError(
            f"{FUSED} compares by the first measure of each of its descriptors; leave measure out, "
            "or name the descriptor that has it.",
            parameter="measure", found=measure,
        )  # fmt: skip
    return Ranking(FUSED, None, rerank is not False)


def _share(progress: Callable[[float], None] | None, done: int, parts: int) -> Callable[[float], None] | None:
    return None if progress is None else lambda fraction: progress((done + fraction) / parts)
