"""The registry of descriptors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from reebase.descriptors import d2, extended, gps, hks, moments, ms, patches, rgpd, sh, shape_dna, srg, views, wks
from reebase.descriptors.patches import PATCHES
from reebase.descriptors.surface import Surface, surface_of
from reebase.descriptors.vectors import VECTORS
from reebase.descriptors.views import VIEWS
from reebase.errors import unknown_name
from reebase.matching import ENDPOINTS, MEASURES, Comparison, Match, Stack
from reebase.matching.charged import CHARGED
from reebase.mesh.mesh import Mesh
from reebase.pipeline import Description

__all__ = ["DESCRIPTORS", "Descriptor", "descriptor_named"]

Array = npt.NDArray[np.float64]
Progress = Callable[[float], None]


@dataclass(frozen=True)
class Descriptor:
    """One way to describe a shape, and the ways to compare what it keeps.

    keep: surface -> what is kept of it, float64; a vector, or a row for each endpoint. Rounding it to float32 must
    not change a ranking. comparison: how that is compared. measures: names of the measures, the default first.
    version: raised when the same surface would give other numbers, or a measure another dissimilarity.
    place: surface -> where the rows of ``keep`` lie on it, (k, 3), for endpoints.
    """

    name: str
    summary: str
    keep: Callable[[Surface], Array]
    comparison: Comparison
    measures: tuple[str, ...]
    version: int = 1
    place: Callable[[Surface], Array] | None = None

    def describe(self, shape: Description | Mesh | Surface) -> Array:
        """What is kept of a shape: a description, a cleaned mesh, or a surface that several descriptors share.

        Of several components the largest is described. Raises MeshError, ComputationError.
        """
        return self.keep(surface_of(shape))

    def distances(
        self, kept: Sequence[Array], measure: str | None = None, *, progress: Progress | None = None
    ) -> Array:
        """The dissimilarity of all pairs, >= 0, float64, (n, n), row = query.

        progress: called with the fraction of the work that is done. Raises UnknownName for a measure that is not
        among ``measures``, ParameterError for arrays that this descriptor did not make.
        """
        return self.comparison.matrix(kept, self.measure_named(measure), progress)

    def distances_to(self, query: Array, kept: Sequence[Array], measure: str | None = None) -> Array:
        """The dissimilarity of one shape with each of n, float64, (n,), the bits of its row in ``distances``."""
        chosen, rows = self.measure_named(measure), self.comparison.rows
        asked = rows(query, "query")
        stack = Stack.of([asked, *(rows(one, f"kept[{i}]") for i, one in enumerate(kept))])
        return self.comparison.one_to_many(asked, stack.since(1), chosen)

    def compare(self, first: Array, second: Array, measure: str | None = None) -> float:
        """The dissimilarity of two shapes, ``first`` the query. Raises as ``distances``."""
        return float(self.distances_to(first, [second], measure)[0])

    def explain(self, first: Array, second: Array, measure: str | None = None) -> Match | None:
        """Which rows of the two went together, and what each adds; None for a descriptor that is one vector."""
        chosen = self.measure_named(measure)
        return None if self.comparison.explain is None else self.comparison.explain(first, second, chosen)

    def measure_named(self, measure: str | None) -> str:
        """The measure, or the default for None. Raises UnknownName with the names that would do."""
        if measure is not None and measure not in self.measures:
            raise unknown_name(f"measure of {self.name}", measure, self.measures)
        return measure or self.measures[0]


DESCRIPTORS: Mapping[str, Descriptor] = MappingProxyType({
    descriptor.name: descriptor
    for descriptor in (
        Descriptor("srg", "Endpoints of the spectral Reeb graph, compared by D.",
                   srg.describe, ENDPOINTS, tuple(MEASURES)),
        Descriptor("extended", "Limbs: maxima of the auto diffusion field, what surrounds them; compared by D.",
                   extended.describe, CHARGED, ("matching",), place=extended.place, version=4),
        Descriptor("rgpd", "Endpoints of the Reeb graph of geodesic distance, compared by D.",
                   rgpd.describe, ENDPOINTS, tuple(MEASURES), version=2),
        Descriptor("shape_dna", "The first 20 eigenvalues.", shape_dna.describe, VECTORS, ("l2", "l1")),
        Descriptor("moments", "How flat, round and bulging the surface is around its points.",
                   moments.describe, VECTORS, ("l1", "l2")),
        Descriptor("hks", "Quantiles of the heat kernel signature.", hks.describe, VECTORS, ("l1", "l2"), version=2),
        Descriptor("wks", "Quantiles of the wave kernel signature.", wks.describe, VECTORS, ("l1", "l2"), version=2),
        Descriptor("gps", "Distances in the global point signature.", gps.describe, VECTORS, ("l1", "l2")),
        Descriptor("d2", "Distances between points of the surface.", d2.describe, VECTORS, ("l1", "l2")),
        Descriptor("sh", "Spherical harmonics of the surface in shells round its centroid.",
                   sh.describe, VECTORS, ("l1", "l2")),
        Descriptor("ms", "Parts of the medial surface, matched by thickness, size and place.",
                   ms.describe, CHARGED, ("matching",)),
        Descriptor("patches", "Patches of the query, each sought in the other: finds the whole of a part.",
                   patches.describe, PATCHES, ("relative", "absolute"), place=patches.place, version=3),
        Descriptor("views", "Images from eighteen sides, in any of 48 positions.",
                   views.describe, VIEWS, ("l1",), version=2),
    )
})  # fmt: skip
"""name -> descriptor: the thesis's own, the same with richer endpoints, then the peers."""


def descriptor_named(name: str) -> Descriptor:
    """The descriptor of that name. Raises UnknownName with the names that would do."""
    if name not in DESCRIPTORS:
        raise unknown_name("descriptor", name, DESCRIPTORS)
    return DESCRIPTORS[name]
