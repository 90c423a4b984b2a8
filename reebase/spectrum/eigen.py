"""The first eigenpairs of C phi = lambda R phi (4.13) at unit area.

The first three beyond the constant, all that the pipeline reads, come from multigrid (multigrid.py). More, and those of
small meshes and of surfaces that do not coarsen, come from a factor of C - sigma R and Lanczos (inverse.py).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError
from reebase.spectrum.inverse import smallest
from reebase.spectrum.multigrid import WIDTH, first_eigenpairs
from reebase.spectrum.operator import Operator

__all__ = ["NEAR_DEGENERATE", "Spectrum", "eigenpairs"]

NEAR_DEGENERATE = 1.05
"""lambda_3 / lambda_2 below this: phi_2 is not stable under remeshing (METHOD §3)."""

MULTIGRID = 500
"""From so many vertices on multigrid is faster than a factor, for up to ``WIDTH`` eigenpairs."""

TOLERANCE = 1e-7
"""Default residual of the eigenpairs of the inverse. Errors of eigenvalues go with its square."""

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Eigenpairs at unit area: invariant to scale, and to anything else that keeps lengths on the surface.

    eigenvalues: increasing, float64, (k,); the first is 0. Those of a mesh of area A are these over A.
    eigenvectors: columns, float64, (m, k), orthonormal under R at unit area (phi^T R phi = A in the units of
    the mesh); the first is 1 everywhere. Signs, and bases of multiple eigenvalues, are arbitrary.
    """

    eigenvalues: Array
    eigenvectors: Array

    @property
    def fiedler(self) -> Array:
        """phi_2, float64, (m,)."""
        if self.eigenvectors.shape[1] < 2:
            raise ParameterError("phi_2 needs at least two eigenpairs; compute them with k=2 or more.")
        column: Array = self.eigenvectors[:, 1]
        return column

    @property
    def near_degenerate(self) -> bool:
        """Whether lambda_3 / lambda_2 < 1.05. Raises ParameterError when fewer than three were computed."""
        if len(self.eigenvalues) < 3:
            raise ParameterError("Near-degeneracy compares lambda_2 and lambda_3; compute k=3 or more.")
        return bool(self.eigenvalues[2] < NEAR_DEGENERATE * self.eigenvalues[1])

    def __repr__(self) -> str:
        return f"Spectrum({len(self.eigenvalues)} eigenpairs, {len(self.eigenvectors)} vertices)"


def eigenpairs(operator: Operator, k: int = 3, tolerance: float = TOLERANCE) -> Spectrum:
    """The k eigenpairs with the smallest eigenvalues, the constant one included, at unit area.

    Deterministic: the same operator gives the same bits. Eigenvalues have a relative error of at most 1e-8; phi_2 one
    of at most 1e-5 in the norm of R, and others as far as their eigenvalues are apart.
    tolerance: of the eigenpairs that a factor gives, those beyond ``WIDTH`` and of small meshes: the residual of
    R^(1/2) phi as an eigenvector of R^(1/2) (C - sigma R)^(-1) R^(1/2), relative to its eigenvalue, 1e-12 to 1e-2.
    Raises ParameterError unless 1 <= k <= m, ComputationError when the matrix cannot be factorised well enough or the
    iteration does not converge.
    """
    m = len(operator.mass)
    if not 1 <= k <= m:
        raise ParameterError(
            f"A mesh with {m} vertices has {m} eigenpairs; asked for {k}.", parameter="k", found=k, maximum=m
        )
    if not 1e-12 <= tolerance <= 1e-2:
        raise ParameterError(
            f"The tolerance must be from 1e-12 to 1e-2; found {tolerance}.", parameter="tolerance", found=tolerance
        )
    mass = operator.mass / operator.area
    eigenvalues, eigenvectors = np.zeros(k), np.ones((m, k))
    if k > 1:
        found = None
        if operator.mesh is not None and m >= MULTIGRID and k <= WIDTH:
            found = first_eigenpairs(operator.C, mass, operator.mesh, k - 1)
        if found is None:
            points = None if operator.mesh is None else operator.mesh.vertices
            found = smallest(operator.C, mass, points, k - 1, tolerance)
        eigenvalues[1:], eigenvectors[:, 1:] = found
    return Spectrum(np.maximum(eigenvalues, 0.0), eigenvectors)
