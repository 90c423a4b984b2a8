"""The first eigenpairs of C phi = lambda R phi (4.13) at unit area.

With B = C + s R for a small shift s > 0, which is positive definite on a connected surface, the symmetric
matrix R^(1/2) B^(-1) R^(1/2) has the eigenvalues mu = 1 / (lambda + s) and eigenvectors y = R^(1/2) phi: the
smallest lambda become the largest mu, well apart, and Lanczos needs few solves with one factorisation
(Ericsson and Ruhe, "The spectral transformation Lanczos method", 1980). The constant eigenvector is known, so
it is taken out of the space beforehand. Zero masses do no harm: phi = B^(-1) R^(1/2) y / mu extends there.

The first three beyond the constant, all that the pipeline reads, come from multigrid (multigrid.py) in a fraction of
the time; where that does not converge, on surfaces that do not coarsen, the factorisation takes over.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from reebase.errors import ComputationError, ParameterError
from reebase.spectrum.multigrid import WIDTH, first_eigenpairs
from reebase.spectrum.operator import Operator

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

__all__ = ["NEAR_DEGENERATE", "Spectrum", "eigenpairs"]

NEAR_DEGENERATE = 1.05
"""lambda_3 / lambda_2 below this: phi_2 is not stable under remeshing (METHOD §3)."""

SHIFT = 1e-3
"""s at unit area. Far below lambda_2 of any shape that is not a wire (a tube of length L and girth p has
pi^2 p / L), so that mu_2 stands apart; far above rounding, so that B factorises."""

MULTIGRID = 500
"""From so many vertices on multigrid is faster than a factorisation."""

DENSE = 64
"""Up to so many vertices a dense solver is both faster and free of iteration."""

RESIDUAL = 1e-8
"""Accepted |C phi - lambda R phi| relative to lambda |R phi|, beyond what rounding in C phi explains."""

CONVERGED = 1e-10
"""Residual of an eigenpair of the shifted and inverted operator, relative to mu, at which Lanczos ends. The solve
that follows it takes the eigenvector further by a factor of about mu over the next one."""

GUARD = 1
"""Vectors in a block beyond those wanted, so that an eigenvalue close to the last wanted one does not hold it up."""

WIDEST = 4
"""Vectors in a block at most: as many copies of a multiple eigenvalue as it finds at once. Wider ones need more solves;
with one vector a solve costs twice as much, and copies come of rounding alone."""

EVERY = 3
"""Blocks between two looks at the residuals, which cost as much as a block, once there are more than a few."""

STEPS = 100
"""Blocks after which Lanczos gives up, beyond those that the wanted vectors fill four times; it needs about ten."""

Array = npt.NDArray[np.float64]
Solve = Callable[[Array], Array]


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


def eigenpairs(operator: Operator, k: int = 3) -> Spectrum:
    """The k eigenpairs with the smallest eigenvalues, the constant one included, at unit area.

    Deterministic: the same operator gives the same bits. Eigenvalues have a relative error of at most 1e-8, phi_2 one
    of at most 1e-5 in the norm of R, and others as far as their eigenvalues are apart; where k is above ``WIDTH`` or
    the operator does not know its mesh, the errors are near rounding.
    Raises ParameterError unless 1 <= k <= m, ComputationError when the matrix cannot be factorised, the iteration does
    not converge, or a residual is above ``RESIDUAL``.
    """
    m = len(operator.mass)
    if not 1 <= k <= m:
        raise ParameterError(
            f"A mesh with {m} vertices has {m} eigenpairs; asked for {k}.", parameter="k", found=k, maximum=m
        )
    mass = operator.mass / operator.area
    eigenvalues, eigenvectors = np.zeros(k), np.ones((m, k))
    if k > 1:
        found = None
        if operator.mesh is not None and m >= MULTIGRID and k <= WIDTH:
            found = first_eigenpairs(operator.C, mass, operator.mesh, k - 1)
        eigenvalues[1:], eigenvectors[:, 1:] = found or _factorised(operator.C, mass, k - 1)
    return Spectrum(np.maximum(eigenvalues, 0.0), eigenvectors)


def _factorised(C: csr_matrix, mass: Array, count: int) -> tuple[Array, Array]:
    """Eigenvalues and eigenvectors beyond the constant by Lanczos on the shifted and inverted operator."""
    m = len(mass)
    solve = (_dense_solve if m <= DENSE else _sparse_solve)(C, SHIFT * mass)
    root = np.sqrt(mass)
    # Lanczos builds three times what is wanted, and more on a symmetric shape: it must not run out of space.
    search = _dense_search if m <= DENSE or 6 * (count + 1) > m else _lanczos
    mu, y = search(solve, root, count)
    order = np.argsort(-mu, kind="stable")
    mu, y = mu[order], y[:, order]
    phi = solve(root[:, None] * y) / mu
    phi -= mass @ phi  # the constant, which the solve amplifies by lambda / s
    phi /= np.sqrt(mass @ phi**2)
    eigenvalues = 1.0 / mu - SHIFT
    _check(C, mass, eigenvalues, phi)
    return eigenvalues, phi


def _dense_solve(C: csr_matrix, shifted: Array) -> Solve:
    from scipy.linalg import LinAlgError, cho_factor, cho_solve

    try:
        factor = cho_factor(C.toarray() + np.diag(shifted))
    except LinAlgError as error:
        raise ComputationError(_singular(error)) from error
    return lambda b: np.asarray(cho_solve(factor, b))


def _sparse_solve(C: csr_matrix, shifted: Array) -> Solve:
    """Solver by LU in symmetric mode: B is positive definite, so no pivoting and a symmetric ordering."""
    from scipy.sparse import csc_matrix, diags_array
    from scipy.sparse.linalg import splu

    B = csc_matrix(C + diags_array(shifted))
    try:
        factor = splu(
            B, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError as error:
        raise ComputationError(_singular(error)) from error
    return lambda b: np.asarray(factor.solve(b))


def _singular(error: Exception) -> str:
    return (
        f"The operator could not be factorised ({error}); a vertex without faces, or a surface whose "
        "triangles have no area, makes it singular."
    )


def _dense_search(solve: Solve, root: Array, count: int) -> tuple[Array, Array]:
    from scipy.linalg import eigh

    m = len(root)
    S = root[:, None] * solve(np.diag(root))
    S -= np.outer(root, root) / SHIFT  # root is the unit eigenvector of the constant, with mu = 1 / s
    mu, y = eigh((S + S.T) / 2, subset_by_index=[m - count, m - 1])
    return mu, y


def _lanczos(solve: Solve, root: Array, count: int) -> tuple[Array, Array]:
    """Largest eigenpairs of R^(1/2) B^(-1) R^(1/2) orthogonal to ``root``, the constant's eigenvector.

    Block Lanczos (Golub and Underwood 1977) with full orthogonalisation and no restart: a block finds as many
    copies of a multiple eigenvalue as it is wide, where a single vector would find one.
    """
    from scipy.linalg import eigh

    m = len(root)
    width = min(count + GUARD, WIDEST)
    limit = min(m - 1, STEPS * width + 4 * count)
    basis, H = np.empty((limit, m)), np.zeros((limit, limit))
    block = np.random.default_rng(0).standard_normal((m, width))
    block = np.linalg.qr(block - np.outer(root, root @ block))[0]
    size, step, residual = 0, 0, np.inf
    while size + width <= limit:
        new = slice(size, size + width)
        basis[new] = block.T
        image = root[:, None] * solve(root[:, None] * block)
        image -= np.outer(root, root @ image)
        size, step = size + width, step + 1
        V = basis[:size]
        H[:size, new] = V @ image
        H[new, :size] = H[:size, new].T
        block, R = np.linalg.qr(image - V.T @ H[:size, new])
        block, again = np.linalg.qr(block - V.T @ (V @ block))
        last = size + width > limit
        if size < count or (size > EVERY * WIDEST and step % EVERY and not last):
            continue
        mu, s = eigh(H[:size, :size], subset_by_index=[size - count, size - 1])
        residual = float((np.linalg.norm(again @ R @ s[-width:], axis=0) / mu).max())
        if residual <= CONVERGED:
            return mu, V.T @ s
    raise ComputationError(
        f"The eigenpairs did not converge in {step} steps; the relative residual is {residual:.1e}.",
        residual=residual,
    )


def _check(C: csr_matrix, mass: Array, eigenvalues: Array, phi: Array) -> None:
    weighted = mass[:, None] * phi * eigenvalues
    residual = np.linalg.norm(C @ phi - weighted, axis=0)
    rounding = 64 * np.finfo(np.float64).eps * np.linalg.norm(abs(C) @ abs(phi), axis=0)
    bound = RESIDUAL * np.linalg.norm(weighted, axis=0) + rounding
    if not (residual <= bound).all():
        worst = int(np.argmax(np.where(np.isfinite(residual), residual / bound, np.inf)))
        raise ComputationError(
            f"Eigenpair {worst + 2} did not converge: its residual is {residual[worst]:.1e}, "
            f"{bound[worst]:.1e} is accepted.",
            eigenpair=worst + 2, residual=float(residual[worst]),
        )  # fmt: skip
