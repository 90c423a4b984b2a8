"""A map of a collection: who is near in the plane is near by the dissimilarity, as far as a plane allows.

Classical scaling (Torgerson 1952) gives the outline and the start; from there the neighbourhoods are arranged by
stochastic neighbour embedding with heavy tails (van der Maaten and Hinton, JMLR 9, 2008, exact). Nothing is drawn at
random, so the same dissimilarities give the same map. Of many shapes some are arranged, and each of the others comes
to lie among those of them that are nearest to it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError

__all__ = ["MOST", "neighbours_kept", "plane"]

MOST = 1500
"""Points that a map can hold and still be read; the cost is quadratic in it."""

Array = npt.NDArray[np.float64]

_LANDMARKS = 500  # shapes that are arranged among all others
_FEW = 8  # up to so many classical scaling is all
_ROUNDS = 350
_EXAGGERATED = 100  # rounds at the beginning, in which groups are drawn together
_PERPLEXITY = 15.0  # how many neighbours count, about


def plane(dissimilarities: npt.ArrayLike) -> Array:
    """Positions, float64, (n, 2), in [-1, 1], the farther axis of the outline to the right.

    dissimilarities: finite, >= 0, (n, n); of a pair that differs by direction the mean counts. Raises ParameterError.
    """
    matrix = np.asarray(dissimilarities, dtype=np.float64)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise ParameterError(
            f"dissimilarities must have shape (n, n); found {matrix.shape}.", parameter="dissimilarities"
        )
    if not np.isfinite(matrix).all() or (matrix < 0).any():
        raise ParameterError("dissimilarities must be finite and not negative.", parameter="dissimilarities")
    if len(matrix) > MOST:
        raise ParameterError(f"A map holds at most {MOST} shapes; found {len(matrix)}.", parameter="dissimilarities")
    distances = (matrix + matrix.T) / 2
    np.fill_diagonal(distances, 0.0)
    distances /= distances.max(initial=0.0) or 1.0
    # Spread over all of them: the list may be sorted by class.
    chosen = np.unique(np.linspace(0, len(matrix) - 1, min(len(matrix), _LANDMARKS)).round().astype(np.int64))
    own = distances[np.ix_(chosen, chosen)]
    arranged = _scaled(own)
    if len(chosen) > _FEW:
        arranged = _neighbourly(own, arranged)
    positions = _among(distances[:, chosen], arranged)
    positions[chosen] = arranged
    return _framed(positions)


def neighbours_kept(dissimilarities: Array, positions: Array, count: int = 10) -> float:
    """Which share of the ``count`` nearest shapes of each is among its ``count`` nearest points, the mean over all."""
    size = len(positions)
    count = min(count, size - 1)
    if count < 1:
        return 1.0
    apart = _squared(positions)
    shares = []
    for row in range(size):
        near = [set(np.argsort(np.delete(d[row], row), kind="stable")[:count]) for d in (dissimilarities, apart)]
        shares.append(len(near[0] & near[1]) / count)
    return float(np.mean(shares))


def _scaled(distances: Array) -> Array:
    """Classical scaling into the plane; each axis points to where the farther points are."""
    size = len(distances)
    if size < 2:
        return np.zeros((size, 2))
    squares = distances**2
    inner = -(squares - squares.mean(axis=0) - squares.mean(axis=1)[:, None] + squares.mean()) / 2
    values, vectors = np.linalg.eigh(inner)
    axes = vectors[:, ::-1][:, :2] * np.sqrt(np.maximum(values[::-1][:2], 0.0))
    signs = np.sign(axes[np.abs(axes).argmax(axis=0), range(axes.shape[1])])
    placed: Array = axes * np.where(signs == 0, 1.0, signs)
    return placed


def _neighbourly(distances: Array, start: Array) -> Array:
    """Descends the divergence between neighbourhoods by dissimilarity and in the plane, from the outline."""
    wanted = _affinities(distances)
    points = start / (start.std() or 1.0) * 1e-2
    speed, gains = np.zeros_like(points), np.ones_like(points)
    rate = max(len(points) / 12.0, 25.0)
    for turn in range(_ROUNDS):
        close = 1.0 / (1.0 + _squared(points))
        np.fill_diagonal(close, 0.0)
        factor = 4.0 if turn < _EXAGGERATED else 1.0
        pull = (factor * wanted - close / close.sum()) * close
        slope = 4.0 * (pull.sum(axis=1)[:, None] * points - pull @ points)
        # Jacobs' rule: faster where the direction stays, slower where it turns.
        gains = np.maximum(np.where(np.sign(slope) != np.sign(speed), gains + 0.2, gains * 0.8), 0.01)
        speed = (0.5 if turn < _EXAGGERATED else 0.8) * speed - rate * gains * slope
        points = points + speed
        points -= points.mean(axis=0)
    return points


def _affinities(distances: Array) -> Array:
    """How much each pair is neighbours, (n, n), of sum 1: Gaussian, as wide at each shape as it has few near ones."""
    size = len(distances)
    squares = distances**2 / max(float(np.mean(distances**2)), 1e-300)
    np.fill_diagonal(squares, np.inf)
    perplexity = min(_PERPLEXITY, (size - 1) / 3)
    low, high = np.full(size, 1e-6), np.full(size, 1e12)
    least = squares.min(axis=1)[:, None]
    for _ in range(60):
        width = np.sqrt(low * high)[:, None]
        weights = np.exp(-(squares - least) * width)
        shares = weights / weights.sum(axis=1, keepdims=True)
        entropy = -np.where(shares > 0, shares * np.log(np.where(shares > 0, shares, 1.0)), 0.0).sum(axis=1)
        wide = entropy > np.log(perplexity)
        low, high = np.where(wide, width[:, 0], low), np.where(wide, high, width[:, 0])
    mutual: Array = np.maximum((shares + shares.T) / (2 * size), 1e-12)
    return mutual


def _among(to_landmarks: Array, landmarks: Array, count: int = 4) -> Array:
    """The mean of the nearest landmarks, (n, 2), weighted by nearness."""
    count = min(count, len(landmarks))
    nearest = np.argsort(to_landmarks, axis=1, kind="stable")[:, :count]
    away = np.take_along_axis(to_landmarks, nearest, axis=1)
    weights = 1.0 / (away + 1e-3 * away.max(axis=1, initial=0.0, keepdims=True) + 1e-12) ** 2
    placed: Array = (landmarks[nearest] * weights[..., None]).sum(axis=1) / weights.sum(axis=1, keepdims=True)
    return placed


def _squared(points: Array) -> Array:
    sums = (points**2).sum(axis=1)
    apart: Array = np.maximum(sums[:, None] + sums - 2.0 * points @ points.T, 0.0)
    return apart


def _framed(points: Array) -> Array:
    if not len(points):
        return points
    low, high = points.min(axis=0), points.max(axis=0)
    framed: Array = (points - (low + high) / 2) / (float((high - low).max()) / 2 or 1.0)
    return framed
