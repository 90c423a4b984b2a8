"""What the descriptors of one shape share: its body, operator and eigenpairs, each computed once when asked for."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from reebase.matching import endpoint_features
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import largest_component
from reebase.pipeline import Description, skeleton
from reebase.spectrum import Operator, Spectrum, eigenpairs, operator

__all__ = ["EIGENPAIRS", "Surface", "surface_of"]

Shared = TypeVar("Shared")

EIGENPAIRS = 64
"""How many eigenpairs the descriptors read: whole multiplets on a round shape, where they come by 1, 3, 5, ... 15.
With 100 none but `wks` ranks better on any set measured, at twice the cost: heat sees low frequencies."""

TOLERANCE = 1e-5
"""Of the eigenpairs, whose eigenvalues are then right to ten digits and eigenvectors to five."""


class Surface:
    """One connected surface, the largest component of a mesh, and what is computed on it.

    mesh: a cleaned mesh. features: omega of the endpoints of its skeleton where they are known already.
    Not for several threads at once.
    """

    def __init__(self, mesh: Mesh, features: npt.NDArray[np.float64] | None = None) -> None:
        self.body = largest_component(mesh)[0]
        self._features = features
        self._spectra: dict[int, Spectrum] = {}
        self._shared: dict[Callable[[Surface], Any], Any] = {}

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

    def shared(self, compute: Callable[[Surface], Shared]) -> Shared:
        """What ``compute`` gives for this surface, computed once: for what several descriptors are made of."""
        if compute not in self._shared:
            self._shared[compute] = compute(self)
        found: Shared = self._shared[compute]
        return found

    def spectrum(self, k: int = EIGENPAIRS) -> Spectrum:
        """The first k eigenpairs at unit area, or as many as there are vertices. Raises ComputationError.

        Computed for each k afresh and not cut from more: what is kept of a shape must not depend on what else was
        asked for, not even in the last bit.
        """
        k = min(k, len(self.body.vertices))
        if k not in self._spectra:
            self._spectra[k] = eigenpairs(self.operator, k, TOLERANCE)
        return self._spectra[k]


def surface_of(shape: Surface | Description | Mesh) -> Surface:
    """The surface of a description, as its profile denoised it, or of a cleaned mesh."""
    if isinstance(shape, Description):
        return Surface(shape.denoised, shape.features)
    return Surface(shape) if isinstance(shape, Mesh) else shape
