"""Linear equations with a positive definite matrix, column by column: what implicit steps solve."""

from __future__ import annotations

import numpy as np

from reebase.denoise.filter import FloatArray, Step

__all__ = ["conjugate_gradients"]

RESIDUAL = 1e-13


def conjugate_gradients(
    matrix: Step, right: FloatArray, diagonal: FloatArray, rounds: int
) -> tuple[FloatArray, bool]:
    """The solution of matrix(x) = right, column by column, (m, 3), from zero, with the diagonal as preconditioner.

    rounds: at most. Also returns whether the residual got small enough.
    """
    found, residual = np.zeros_like(right), right
    scaled = residual / diagonal
    direction = scaled
    product = (residual * scaled).sum(axis=0)
    enough = RESIDUAL**2 * product
    for _ in range(rounds):
        if (product <= enough).all():
            return found, True
        image = matrix(direction)
        curvature = (direction * image).sum(axis=0)
        share = product / np.where(curvature > 0, curvature, 1.0)
        found = found + share * direction
        residual = residual - share * image
        scaled = residual / diagonal
        product, before = (residual * scaled).sum(axis=0), product
        direction = scaled + product / np.where(before > 0, before, 1.0) * direction
    return found, False
