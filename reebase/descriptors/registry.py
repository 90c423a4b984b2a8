"""The registry of descriptors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from reebase.descriptors import d2, extended, gps, hks, shape_dna, srg, vectors, wks
from reebase.descriptors.surface import Surface, surface_of
from reebase.errors import unknown_name
from reebase.evaluation.matrix import dissimilarity_matrix
from reebase.matching import MEASURES
from reebase.matching.charged import charged_matrix
from reebase.mesh.mesh import Mesh
from reebase.pipeline import Description

__all__ = ["DESCRIPTORS", "Descriptor", "descriptor_named"]

Array = npt.NDArray[np.float64]
Progress = Callable[[float], None]
Matrix = Callable[[Sequence[Array], str, Progress | None], Array]


@dataclass(frozen=True)
class Descriptor:
    """One way to describe a shape, and the ways to compare what it keeps.

    keep: surface -> what is kept of it, float64; a vector, or a row for each endpoint.
    matrix: what is kept of n shapes, the name of a measure, and a listener to progress -> (n, n), row = query.
    measures: names of the measures, the default first.
    """

    name: str
    summary: str
    keep: Callable[[Surface], Array]
    matrix: Matrix
    measures: tuple[str, ...]

    def describe(self, shape: Description | Mesh | Surface) -> Array:
        """What is kept of a shape: a description, a cleaned mesh, or a surface that several descriptors share.

        Of several components the largest is described. Raises MeshError, ComputationError.
        """
        return self.keep(surface_of(shape))

    def distances(
        self, kept: Sequence[Array], measure: str | None = None, *, progress: Progress | None = None
    ) -> Array:
        """The dissimilarity of all pairs, >= 0, float64, (n, n), row = query; it may depend on the whole set.

        progress: called with the fraction of the work that is done. Raises UnknownName for a measure that is not
        among ``measures``, ParameterError for arrays that this descriptor did not make.
        """
        return self.matrix(kept, self.measure_named(measure), progress)

    def compare(self, first: Array, second: Array, measure: str | None = None) -> float:
        """The dissimilarity of two shapes, ``first`` the query. Raises as ``distances``."""
        return float(self.distances([first, second], measure)[0, 1])

    def measure_named(self, measure: str | None) -> str:
        """The measure, or the default for None. Raises UnknownName with the names that would do."""
        if measure is not None and measure not in self.measures:
            raise unknown_name(f"measure of {self.name}", measure, self.measures)
        return measure or self.measures[0]


def _endpoints(kept: Sequence[Array], measure: str, progress: Progress | None) -> Array:
    return dissimilarity_matrix(kept, measure, progress=progress)


def _charged(kept: Sequence[Array], measure: str, progress: Progress | None) -> Array:
    return charged_matrix(kept, progress)


def _vectors(kept: Sequence[Array], measure: str, progress: Progress | None) -> Array:
    return vectors.distances(kept, measure)


DESCRIPTORS: Mapping[str, Descriptor] = MappingProxyType({
    descriptor.name: descriptor
    for descriptor in (
        Descriptor("srg", "Endpoints of the spectral Reeb graph, compared by D.",
                   srg.describe, _endpoints, tuple(MEASURES)),
        Descriptor("extended", "Endpoints of the auto diffusion field with heat signatures, compared by D.",
                   extended.describe, _charged, ("matching",)),
        Descriptor("shape_dna", "The first 20 eigenvalues.", shape_dna.describe, _vectors, ("l2", "l1")),
        Descriptor("hks", "Quantiles of the heat kernel signature.", hks.describe, _vectors, ("l1", "l2")),
        Descriptor("wks", "Quantiles of the wave kernel signature.", wks.describe, _vectors, ("l1", "l2")),
        Descriptor("gps", "Distances in the global point signature.", gps.describe, _vectors, ("l1", "l2")),
        Descriptor("d2", "Distances between points of the surface.", d2.describe, _vectors, ("l1", "l2")),
    )
})  # fmt: skip
"""name -> descriptor: the thesis's own, the same with richer endpoints, then the peers."""


def descriptor_named(name: str) -> Descriptor:
    """The descriptor of that name. Raises UnknownName with the names that would do."""
    if name not in DESCRIPTORS:
        raise unknown_name("descriptor", name, DESCRIPTORS)
    return DESCRIPTORS[name]
