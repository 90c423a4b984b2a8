"""What the descriptors of one shape share: its body, operator and eigenpairs, each computed once when asked for."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import numpy.typing as npt

from reebase.matching import endpoint_features
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import largest_component
from reebase.pipeline import Description, skeleton
from reebase.spectrum import Operator, Spectrum, eigenpairs, operator

__all__ = ["EIGENPAIRS", "Surface", "surface_of"]

EIGENPAIRS = 100
"""How many eigenpairs the signatures read: exp(-lambda t) of what is left out is below 0.1 at the smallest time."""


class Surface:
    """One connected surface, the largest component of a mesh, and what is computed on it.

    mesh: a cleaned mesh. features: omega of the endpoints of its skeleton where they are known already.
    Not for several threads at once.
    """

    def __init__(self, mesh: Mesh, features: npt.NDArray[np.float64] | None = None) -> None:
        self.body = largest_component(mesh)[0]
        self._features = features

    @cached_property
    def operator(self) -> Operator:
        return operator(self.body)

    @cached_property
    def weights(self) -> npt.NDArray[np.float64]:
        """The share of the area at each vertex, (m,), summing to 1."""
        return self.operator.mass / self.operator.area

    @property
    def features(self) -> npt.NDArray[np.float64]:
        """omega of each endpoint of the skeleton, (k, 3)."""
        if self._features is None:
            self._features = endpoint_features(skeleton(self.body))
        return self._features

    @cached_property
    def spectrum(self) -> Spectrum:
        """The first 100 eigenpairs at unit area, or as many as there are vertices. Raises ComputationError.

        As many for those who read fewer: what is kept must not depend on who else asked, not even in the last bit.
        """
        return eigenpairs(self.operator, min(EIGENPAIRS, len(self.body.vertices)))


def surface_of(shape: Surface | Description | Mesh) -> Surface:
    """The surface of a description, as its profile denoised it, or of a cleaned mesh."""
    if isinstance(shape, Description):
        return Surface(shape.denoised, shape.features)
    return Surface(shape) if isinstance(shape, Mesh) else shape
