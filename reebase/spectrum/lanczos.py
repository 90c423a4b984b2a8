"""Eigenpairs of a symmetric operator beside its largest ones in size, by block Lanczos with full orthogonalisation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from reebase.errors import ComputationError

__all__ = ["block_lanczos"]

WIDTH = 4
"""Vectors in a block, and those it is widened by. Wider ones need more vectors in all; with fewer a solve costs more a
vector."""

STEPS = 100
"""Blocks after which the search gives up, beyond those that the wanted vectors fill four times."""

FIRST = 1.4
"""Vectors for each wanted one, and"""

MORE = 6.0
"""vectors for each digit, from which on convergence is looked at; six for a wanted one suffice where few are wanted."""

RATE = 4.0
"""By about so much the residual falls with each block: when to look again."""

EVERY = 6
"""Blocks between a block made wider and the next look."""

STEEP = 1e-5
"""Share of its length that a row of a block must add to those before for the fast way to be accurate enough."""

DRIFT = 1e-10
"""Foreseen loss of orthogonality at which two blocks are orthogonalised twice. What a block keeps of an earlier loss
grows by as much as it is longer than what of it is new."""

EPSILON = float(np.finfo(np.float64).eps)

Array = npt.NDArray[np.float64]


def block_lanczos(
    apply: Callable[[Array], Array], root: Array, negative: int, positive: int, tolerance: float
) -> tuple[Array, Array]:
    """The ``negative`` smallest and the ``positive`` largest eigenvalues mu, 1 / mu increasing, and vectors (m, count).

    apply: the operator on rows (n, m), n a multiple of WIDTH; ``root`` is a unit eigenvector, which is left out.
    negative: how many eigenvalues are negative beside that of ``root``; all are found, whatever their multiplicities.
    tolerance: residual at which the search ends, relative to each eigenvalue.
    Golub and Underwood, "The block Lanczos method for computing eigenvalues", 1977, without restarts. Raises
    ComputationError when it does not converge.
    """
    m, count = len(root), negative + positive
    limit = min(m, STEPS * WIDTH + 4 * count)
    basis = np.empty((min(limit, 2 * count + 16 * WIDTH), m))
    H = np.zeros((len(basis), len(basis)))
    basis[0], H[0, 0] = root, 0.0
    random = np.random.default_rng(0)
    block = _started(random, basis[:1])
    digits = -np.log10(tolerance)
    look = int(min(FIRST * count + MORE * digits, (MORE + digits) * count))
    size, residual, drift, twice = 1, np.inf, EPSILON, 0
    while size + len(block) <= limit:
        if size + len(block) > len(basis):
            more = min(limit, 2 * len(basis)) - len(basis)
            basis, H = np.concatenate([basis, np.empty((more, m))]), np.pad(H, ((0, more), (0, more)))
        new = slice(size, size + len(block))
        basis[new] = block
        image = apply(basis[new])
        size = new.stop
        V = basis[:size]
        column = V @ image.T
        H[:size, new], H[new, :size] = column, column.T
        length = np.sqrt((image * image).sum(axis=1).max())
        image -= column.T @ V
        if twice:
            image -= (V @ image.T).T @ V
        block, R = _orthonormal(image, V, STEEP * length)
        drift *= length / max(abs(np.diagonal(R)).min(), EPSILON * length)
        if twice:
            drift, twice = EPSILON, twice - 1
        elif drift > DRIFT:
            twice = 2
        if size < look and size + len(block) <= limit:
            continue
        mu, s = np.linalg.eigh(H[1:size, 1:size])
        below = min(negative, int(np.count_nonzero(mu < 0.0)))
        wanted = np.concatenate([np.arange(below)[::-1], np.arange(len(mu) - positive, len(mu))[::-1]])
        last = s[new.start - 1 :, wanted]
        residual = float((np.linalg.norm(R @ last, axis=0) / abs(mu[wanted])).max())
        if residual > tolerance:
            look = size + len(block) * max(1, int(np.log(residual / tolerance) / np.log(RATE)))
        elif below == negative:
            return mu[wanted], V[1:].T @ s[:, wanted]
        else:  # a block finds as many copies of a multiple eigenvalue as it is wide
            block = np.concatenate([block, _started(random, np.concatenate([V, block]))])
            look = size + EVERY * len(block)
    raise ComputationError(
        f"The eigenpairs did not converge in {size} vectors; the relative residual is {residual:.1e}.",
        residual=residual,
    )


def _started(random: np.random.Generator, V: Array) -> Array:
    """Orthonormal rows, orthogonal to those of V."""
    return _projected(random.standard_normal((WIDTH, V.shape[1])), V)[0]


def _orthonormal(image: Array, V: Array, least: float) -> tuple[Array, Array]:
    """Q and R with R^T Q = image, rows of Q orthonormal and orthogonal to those of V, as image is but for rounding.

    Where a row of image adds less than ``least`` to those before, rounding is too much of it.
    """
    try:
        once = np.linalg.cholesky(image @ image.T)
        if once.diagonal().min() > least:
            Q = np.linalg.inv(once) @ image
            again = np.linalg.cholesky(Q @ Q.T)
            return np.linalg.inv(again) @ Q, (once @ again).T
    except np.linalg.LinAlgError:
        pass
    return _projected(image, V)


def _projected(image: Array, V: Array) -> tuple[Array, Array]:
    """The same by Householder's reflections, however little of image is beyond V: the rest of Q is then arbitrary."""
    Q, R = np.linalg.qr(image.T)
    for _ in range(2):
        Q, again = np.linalg.qr(Q - V.T @ (V @ Q))
        R = again @ R
    return Q.T, R
