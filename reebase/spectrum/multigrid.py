"""The first eigenpairs by multigrid: a coarse answer, carried up level by level and refined on each.

Levels: the vertices are grouped into aggregates of about seven; their seeds are the vertices of the next level, and
each vertex is interpolated on the triangle of seeds nearest to it ("Gravo MG", Wiersma, Nasikun, Eisemann, Hildebrandt
2023). Linear interpolation makes the eigenvectors of a level a start with three digits for the next one.
C is coarsened by Galerkin's product, which keeps it positive semi-definite whatever the triangles are.

Refinement: LOBPCG (Knyazev 2001), preconditioned by one V-cycle with a Gauss-Seidel sweep each way, in float32 as only
directions come of it. All else is float64. Blocks hold four vectors: those wanted, and guards beyond them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from reebase.mesh.mesh import Mesh

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

__all__ = ["WIDTH", "first_eigenpairs"]

WIDTH = 4
"""Vectors in a block; the kernels are written out for it."""

ROWS = 1024
"""Rows that are combined at once: 100 kB."""

COARSEST = 100
"""Up to so many vertices a level is solved densely."""

WEAK = 0.08
"""Neighbours i, j with |c_ij| below this share of sqrt(c_ii c_jj) are not put into one aggregate: that across a
stretched triangle interpolation would see what the operator does not."""

SHRINK = 0.7
"""A level that keeps more than this share of the vertices is not worth its work: the operator does not coarsen."""

SWEEPS = 1
"""Refinements of the start on each coarse level; more do not bring its error on the next level down."""

STEPS = 60
"""Refinements on the finest level after which the iteration gives up. It needs 5 to 8, on shapes with many like limbs,
whose eigenvalues crowd, up to 25."""

EIGENVALUE = 2e-9
"""Relative error of the wanted eigenvalues at which the iteration ends, as foreseen from the last two steps."""

EIGENVECTORS = np.array([2e-6, 3e-5, 3e-5])
"""Error of phi_2 and of those after it in the norm of R at which the iteration ends, foreseen likewise. Of a shape and
itself with its vertices in another order D stays below 1e-4. The last ones have neighbours outside the block and are
the slowest, and only their eigenvalues are read by default."""

SEPARATION = 0.2
"""Least relative distance of eigenvalues that the foreseen error of an eigenvector is divided by. Where the guards are
nearer, they are copies of a multiple eigenvalue: the vector is any one of their space."""

Array = npt.NDArray[np.float64]
Single = npt.NDArray[np.float32]
Indices = npt.NDArray[np.int32]


@dataclass(eq=False)
class _Level:
    """C and R of a level; in float32 C, its inverted diagonal, and P from the next level, which is ``coarser``."""

    pointers: Indices
    indices: Indices
    values: Array
    mass: Array
    points: Array
    faces: Indices
    single: Single = field(init=False)
    inverse: Single = field(init=False)
    column: Indices = field(init=False)
    weight: Array = field(init=False)
    single_weight: Single = field(init=False)
    correction: Single = field(init=False)
    coarser: _Level | None = None
    solution: Single = field(init=False)
    """The inverse of C on a coarsest level, up to constants."""

    def __post_init__(self) -> None:
        self.correction = np.zeros((len(self.mass), WIDTH), np.float32)


def first_eigenpairs(C: csr_matrix, mass: Array, mesh: Mesh, count: int) -> tuple[Array, Array] | None:
    """Eigenvalues (count,) and eigenvectors (m, count) of C phi = lambda R phi beyond the constant, or None.

    mass sums to 1; count < WIDTH. None when the iteration does not converge, or the mesh does not coarsen; the caller
    then has to factorise. Deterministic.
    """
    from scipy.linalg import LinAlgError

    from reebase.spectrum.multigrid_kernels import carry

    with np.errstate(all="ignore"):
        try:
            levels = _levels(C, mass, mesh)
            if levels is None:
                return None
            eigenvalues, X = _coarsest(levels[-1])
            converged = False
            for level in levels[-2::-1]:
                start = carry(level.column, level.weight, X)
                steps = STEPS if level is levels[0] else SWEEPS
                eigenvalues, X, converged = _refined(level, start, count, steps)
        except LinAlgError:
            return None
    return (eigenvalues[:count], X[:, :count]) if converged else None


def _levels(C: csr_matrix, mass: Array, mesh: Mesh) -> list[_Level] | None:
    """The levels, the finest first; None when they do not shrink."""
    from reebase.spectrum import multigrid_kernels as kernels

    pointers, indices = C.indptr.astype(np.int32, copy=False), C.indices.astype(np.int32, copy=False)
    level = _Level(pointers, indices, C.data, mass, mesh.vertices, mesh.faces)
    levels = [level]
    while len(level.mass) > COARSEST:
        owner, seeds, diagonal = kernels.aggregate(level.pointers, level.indices, level.values, WEAK)
        if not len(seeds) <= SHRINK * len(owner) or len(seeds) < 2 * WIDTH or not diagonal.min() > 0.0:
            return None
        points = level.points[seeds]
        triangles, starts, around = kernels.coarse_triangles(level.faces, owner, len(seeds))
        points.flags.writeable = triangles.flags.writeable = False  # as those of a mesh: one type for the kernels
        level.column, level.weight = kernels.interpolate(
            level.pointers, level.indices, level.points, points, owner, seeds, triangles, starts, around
        )
        coarse = kernels.coarse_operator(
            level.pointers, level.indices, level.values, level.mass, level.column, level.weight, len(seeds)
        )
        level.single, level.inverse = level.values.astype(np.float32), (1.0 / diagonal).astype(np.float32)
        level.single_weight = level.weight.astype(np.float32)
        level.coarser = level = _Level(*coarse, points, triangles)
        levels.append(level)
    return levels if len(levels) > 1 else None


def _coarsest(level: _Level) -> tuple[Array, Array]:
    """The first eigenpairs beyond the constant of the coarsest level; sets its ``solution``."""
    from scipy.linalg import LinAlgError, eigh
    from scipy.sparse import csr_matrix

    n = len(level.mass)
    C = csr_matrix((level.values, level.indices, level.pointers), shape=(n, n)).toarray()
    if not np.isfinite(C).all() or not level.mass.min() > 0.0:
        raise LinAlgError("The coarsest level has no eigenpairs.")
    # On what sums to 0 this inverse is that of C up to a constant, which is taken out of the correction later.
    level.solution = np.linalg.inv(C + np.trace(C) / n**2).astype(np.float32)
    root = np.sqrt(level.mass)
    scaled = C / root / root[:, None]
    eigenvalues, y = eigh(scaled, subset_by_index=[1, WIDTH])
    return eigenvalues, y / root[:, None]


def _cycle(level: _Level, b: Single) -> Single:
    """One V-cycle for C x = b from x = 0: symmetric, and definite but for constants."""
    if level.coarser is None:
        return level.solution @ b
    from reebase.spectrum.multigrid_kernels import ascend, descend

    x = level.correction
    below = np.empty((len(level.coarser.mass), WIDTH), np.float32)
    matrix = level.pointers, level.indices, level.single, level.inverse, b, x, level.column
    descend(*matrix, level.single_weight, below)
    ascend(*matrix, level.single_weight, _cycle(level.coarser, below))
    return x


def _refined(level: _Level, X: Single, count: int, steps: int) -> tuple[Array, Array, bool]:
    """Ritz values (WIDTH,) and vectors, and whether the first ``count`` are as accurate as promised.

    S = [X, P, W]: iterates, the last step, preconditioned residuals; no P at first. G = S^T C S and H = S^T R S are
    known but for the rows of W, as X and P are combinations of the S before.

    With T the cycle, near the inverse of C, W = T r is near the error, but for a factor 1 - lambda / lambda_j of its
    part along a further eigenvector j; and r^T T r is near the square of the error in the norm of C.
    """
    from reebase.spectrum.multigrid_kernels import image, residual

    m, w = len(level.mass), WIDTH
    matrix = level.pointers, level.indices, level.values, level.mass
    S, CS, RW = np.empty((m, 3 * w)), np.empty((m, 3 * w)), np.empty((m, w))
    image(*matrix, X, S[:, :w], CS[:, :w], RW)
    eigenvalues, Z = _ritz(S[:, :w].T @ CS[:, :w], S[:, :w].T @ RW)
    _combine(S, Z)
    _combine(CS, Z)
    G, H = np.zeros((3 * w, 3 * w)), np.zeros((3 * w, 3 * w))
    G[:w, :w], H[:w, :w] = np.diag(eigenvalues), np.eye(w)
    b = np.empty((m, w), np.float32)
    size, converged, error = w, False, np.zeros(count)
    for _ in range(steps):
        new = slice(size, size + w)
        residual(level.mass, S, CS, eigenvalues, b)
        image(*matrix, _cycle(level, b), S[:, new], CS[:, new], RW)
        size += w
        G[:size, new], H[:size, new] = S[:, :size].T @ CS[:, new], S[:, :size].T @ RW
        G[new, :size], H[new, :size] = G[:size, new].T, H[:size, new].T
        # r^T W, as W differs from T r by a constant, to which r is orthogonal
        energy = (np.diagonal(G[:w, new]) / eigenvalues - np.diagonal(H[:w, new]))[:count]
        apart = np.maximum(1.0 - eigenvalues[:count] / eigenvalues[-1], SEPARATION)
        before, error = error, np.sqrt(np.diagonal(H)[new][:count]) / apart
        shrink = np.minimum(error / before, 1.0)
        converged = bool((energy * shrink**2 <= EIGENVALUE).all() and (error * shrink <= EIGENVECTORS[:count]).all())
        values, Z = _ritz(G[:size, :size], H[:size, :size])
        eigenvalues, both = values[:w], np.concatenate([Z[:, :w], Z[:, :w]], axis=1)
        both[:w, w:] = 0.0
        _combine(S, both)
        _combine(CS, both)
        kept = slice(0, 2 * w)
        G[kept, kept], H[kept, kept] = both.T @ G[:size, :size] @ both, both.T @ H[:size, :size] @ both
        size = 2 * w
        if converged:
            break
    return eigenvalues, S[:, :w], converged


def _combine(S: Array, Z: Array) -> None:
    """The first columns of S become those times Z, a stretch of rows that stays in the cache after another."""
    size, new = Z.shape
    for begin in range(0, len(S), ROWS):
        rows = S[begin : begin + ROWS]
        rows[:, :new] = rows[:, :size] @ Z


def _ritz(G: Array, H: Array) -> tuple[Array, Array]:
    """All pairs of G z = theta H z, H positive definite, z^T H z = 1. Raises LinAlgError when H is not."""
    from scipy.linalg import LinAlgError
    from scipy.linalg.lapack import dsygvd

    scale = 1.0 / np.sqrt(np.diagonal(H))
    both = scale[:, None] * scale
    values, z, failed = dsygvd(G * both, H * both)
    if failed:
        raise LinAlgError(f"The Gram matrix is not positive definite: dsygvd says {failed}.")
    return values, z * scale[:, None]
