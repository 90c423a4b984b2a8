"""The smallest eigenpairs by a shift and an inversion (Ericsson and Ruhe, "The spectral transformation Lanczos method",
1980): R^(1/2) (C - sigma R)^(-1) R^(1/2) has the eigenvalues mu = 1 / (lambda - sigma) and eigenvectors R^(1/2) phi.

Those next to sigma come out far apart and converge first. With sigma inside the wanted eigenvalues they converge on
both sides of it, with a third fewer vectors than from below; and the factor's signs say how many lie below sigma.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from reebase.errors import ComputationError
from reebase.spectrum.factor import Elimination, Factor
from reebase.spectrum.lanczos import WIDTH, block_lanczos

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

__all__ = ["smallest"]

SHIFT = 1e-3
"""-sigma at unit area when sigma is below all eigenvalues. Far below lambda_2 of any shape that is not a wire (a tube
of length L and girth p has pi^2 p / L), so that mu_2 stands apart; far above rounding, so that C + s R factorises."""

MANY = 8
"""From so many eigenpairs on sigma is among them."""

SHARE = 0.55
"""How many of the wanted eigenvalues are best below sigma."""

SHARES = 0.3, 0.8
"""As good: up to 1.2 times the vectors at the ends."""

TRIES = 4
"""Shifts tried to get there. At unit area there are about lambda / (4 pi) eigenvalues below lambda (Weyl 1911), on a
closed surface 0.9 to 1.1 times as many from the tenth on; limbs and boundaries make them more."""

MOST = 2.0
"""More eigenvalues below sigma than this times those wanted: sigma below all is better."""

SAME = 1e-5
"""Eigenvalues nearer than this share may be copies of one, of which some may be missing."""

LIGHT = 0.01
"""Vertices with less than this share of the mean mass get phi by the inverse: R^(1/2) phi knows it too little there."""

AMPLIFIED = 10.0
"""Accepted error of the inverse itself, in tolerances."""

Array = npt.NDArray[np.float64]


def smallest(C: csr_matrix, mass: Array, points: Array | None, count: int, tolerance: float) -> tuple[Array, Array]:
    """Eigenvalues (count,), increasing, and eigenvectors (m, count) of C phi = lambda R phi beyond the constant.

    mass sums to 1; points as for ``Elimination``. Masses may be 0: phi extends there by the inverse.
    tolerance: relative residual of the eigenpairs of the inverse. Raises ComputationError.
    """
    elimination = Elimination(C, points)
    if 4 * (count + 1) + 8 * WIDTH > len(mass):
        return _dense(elimination, mass, count)
    sigma, factor = _inside(elimination, mass, count) if count >= MANY else (-SHIFT, elimination.factor(SHIFT * mass))
    try:
        found = _around(C, mass, factor, sigma, count, tolerance)
    except ComputationError:
        if sigma < 0.0:
            raise
        sigma = -SHIFT  # for sigma inside may have hit an eigenvalue
        found = _around(C, mass, elimination.factor(SHIFT * mass), sigma, count, tolerance)
    eigenvalues = found[0]
    near = SAME * eigenvalues[-1]
    above = eigenvalues[eigenvalues > sigma]
    last = int(np.searchsorted(eigenvalues, eigenvalues[-1] - near))
    if last and (above[WIDTH - 1 :] < above[: len(above) - WIDTH + 1] + near).any():
        # As many copies as a block can hold, and above sigma, where none were counted: count them.
        sigma = (eigenvalues[last - 1] + eigenvalues[last]) / 2
        factor = elimination.factor(-sigma * mass)
        if factor.negative != last + 1:
            return _around(C, mass, factor, sigma, count, tolerance)
    return found


def _inside(elimination: Elimination, mass: Array, count: int) -> tuple[float, Factor]:
    """A shift among the wanted eigenvalues, and its factor; the shift below all when none is found."""
    sigma = 4.0 * np.pi * SHARE * (count + 1)
    for _ in range(TRIES):
        factor = elimination.factor(-sigma * mass)
        share = factor.negative / (count + 1)
        if SHARES[0] <= share <= SHARES[1]:
            return sigma, factor
        sigma *= SHARE / max(share, SHARE / 8)
    if 0.0 < share <= MOST:
        return sigma * max(share, SHARE / 8) / SHARE, factor
    return -SHIFT, elimination.factor(SHIFT * mass)


def _around(
    C: csr_matrix, mass: Array, factor: Factor, sigma: float, count: int, tolerance: float
) -> tuple[Array, Array]:
    """With the factor of C - sigma R: all eigenpairs below sigma, and the next ones."""
    root = np.sqrt(mass)
    below = max(factor.negative - 1, 0)
    mu, y = block_lanczos(lambda rows: factor.solve(rows, root), root, below, max(count - below, 0), tolerance)
    mu, y = mu[:count], y[:, :count]
    some = np.unique(np.linspace(0, count - 1, WIDTH).astype(np.int64))
    error = _error(C, mass, factor, sigma, y[:, some]) / abs(mu[some])
    if not error.max() <= AMPLIFIED * tolerance:
        raise ComputationError(
            f"The operator was not factorised well enough: its inverse errs by {error.max():.1e}, "
            f"{AMPLIFIED * tolerance:.1e} is accepted.",
            error=float(error.max()),
        )  # fmt: skip
    return _eigenpairs(factor, sigma, root, mu, y)


def _error(C: csr_matrix, mass: Array, factor: Factor, sigma: float, y: Array) -> Array:
    """Length of the error of R^(1/2) (C - sigma R)^(-1) R^(1/2) y of each column, by a step of refinement."""
    root, one = np.sqrt(mass), np.ones(len(mass))
    b = (root[:, None] * y).T
    x = factor.solve(b, one)
    left = b - (C @ x.T).T + sigma * mass * x
    return np.asarray(np.linalg.norm(root * factor.solve(np.ascontiguousarray(left), one), axis=1))


def _dense(elimination: Elimination, mass: Array, count: int) -> tuple[Array, Array]:
    m, root, factor = len(mass), np.sqrt(mass), elimination.factor(SHIFT * mass)
    S = factor.solve(np.eye(m), root)
    S -= np.outer(root, root) / SHIFT  # root is the unit eigenvector of the constant, with mu = 1 / s
    mu, y = np.linalg.eigh((S + S.T) / 2)
    return _eigenpairs(factor, -SHIFT, root, mu[: m - count - 1 : -1], y[:, : m - count - 1 : -1])


def _eigenpairs(factor: Factor, sigma: float, root: Array, mu: Array, y: Array) -> tuple[Array, Array]:
    with np.errstate(divide="ignore", invalid="ignore"):
        phi = y / root[:, None]
        light = root < np.sqrt(LIGHT / len(root))
        if light.any():
            phi[light] = factor.solve((root[:, None] * y).T, np.ones(len(root)))[:, light].T / mu
        return sigma + 1.0 / mu, phi
