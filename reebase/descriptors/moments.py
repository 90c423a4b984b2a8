"""``moments``: how flat, round, long and bulging the surface is around each of its points, at six scales.

The idea: heat put at a point gathers what lies around it, near at short times and farther at long ones. Gathered so,
the products of normals say whether the surface about there is a plate, a tube or a ball, and those of positions how
long, wide and thick it is: what no signature made of eigenpairs alone can see, since a flat wing may bend into a
round arm without stretching. A limb that turns takes its surroundings along, so the figures stay.
Use it where shapes bend and where they do not: alone among the single vectors here it ranks well on both. Heat need not
be spread point by point: a function spreads by its coefficients in the eigenbasis, so all points cost one product
(the windows are those of Sun et al. 2009; covariances of normals in a window, Pauly, Gross, Kobbelt, "Efficient
Simplification of Point-Sampled Surfaces", IEEE Visualization 2002, and in voting, Medioni, Lee, Tang 2000).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reebase.descriptors.surface import Surface
from reebase.mesh.geometry import vertex_normals

__all__ = ["TIMES", "Moments", "describe", "moments_around", "moments_at", "spread_points"]

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]

TIMES = np.geomspace(0.002, 0.1, 6)
"""Times over the area: windows from a twentieth of the body to a third of it."""

POINTS = 400
"""Points of the surface whose moments are looked at; twice as many rank no better."""

LEVELS = (np.arange(8) + 0.5) / 8
"""Quantiles kept of each figure over these points."""

WEIGHTS = {"spread": 1.0, "extent": 0.5, "facing": 2.0, "bulge": 2.0}
"""What each figure counts in the vector, so that each varies about as much over a collection of many kinds."""

THINNEST = 1e-3
"""Variances of positions below this share of the time count as this."""

_PAIRS = tuple((i, j) for i in range(3) for j in range(i, 3))


class Moments(NamedTuple):
    """Of p points at the six times; float64.

    spread: eigenvalues of the mean of n n^T, increasing, summing to about 1, (p, 6, 3): (0, 0, 1) on a plate,
    (0, 1/2, 1/2) on a tube, thirds on a ball. extent: logarithms of the standard deviations of the positions along
    their principal axes over sqrt(t), increasing, (p, 6, 3). facing: length of the mean normal, (p, 6): 1 where all
    face one way. bulge: how far the point lies outside the mean position, along the mean normal, over sqrt(t), (p, 6).
    """

    spread: Array
    extent: Array
    facing: Array
    bulge: Array


def moments_at(surface: Surface, points: Indices) -> Moments:
    """The moments at some vertices. A mean in a window of time t is a function after heat has spread it for t."""
    weights, spectrum = surface.weights, surface.spectrum()
    normals = vertex_normals(surface.body, "area")
    positions = (surface.body.vertices - weights @ surface.body.vertices) / np.sqrt(surface.operator.area)
    if weights @ np.einsum("mi,mi->m", positions, normals) < 0.0:
        normals = -normals
    products = [one[:, i] * one[:, j] for one in (normals, positions) for i, j in _PAIRS]
    functions = np.column_stack([positions, normals, *products])
    coefficients = spectrum.eigenvectors.T @ (weights[:, None] * functions)
    decay = np.exp(-np.multiply.outer(TIMES, spectrum.eigenvalues))
    means = np.einsum("pk,tk,kf->ptf", spectrum.eigenvectors[points], decay, coefficients, optimize=True)
    position, normal = means[..., :3], means[..., 3:6]
    covariances = means[..., 12:] - np.stack([position[..., i] * position[..., j] for i, j in _PAIRS], axis=-1)
    return Moments(
        spread=np.maximum(_eigenvalues(means[..., 6:12]), 0.0),
        extent=0.5 * np.log(np.maximum(_eigenvalues(covariances) / TIMES[:, None], THINNEST)),
        facing=np.linalg.norm(normal, axis=-1),
        bulge=np.einsum("pti,pti->pt", positions[points, None] - position, normal) / np.sqrt(TIMES),
    )


def moments_around(surface: Surface) -> Moments:
    """The moments at points spread evenly over the surface."""
    return moments_at(surface, spread_points(surface))


def spread_points(surface: Surface) -> Indices:
    """``POINTS`` vertices, as many from each share of the area, int64, (400,); one may occur several times.

    At equal steps of the area, with the vertices in the order of the last time's heat: from the body to the tips,
    whatever the order of the file.
    """
    spectrum = surface.spectrum()
    heat = spectrum.eigenvectors**2 @ np.exp(-TIMES[-1] * spectrum.eigenvalues)
    order = np.argsort(heat, kind="stable")
    cumulated = np.cumsum(surface.weights[order])
    steps = (np.arange(POINTS) + 0.5) / POINTS * cumulated[-1]
    return np.asarray(order[np.minimum(np.searchsorted(cumulated, steps), len(order) - 1)], dtype=np.int64)


def describe(surface: Surface) -> Array:
    """8 quantiles of each of the 8 figures at 6 times, weighted, figure by figure, float64, (384,)."""
    found = surface.shared(moments_around)._asdict()
    columns = [WEIGHTS[name] * values.reshape(POINTS, -1) for name, values in found.items()]
    return np.asarray(np.quantile(np.hstack(columns), LEVELS, axis=0).T.ravel())


def _eigenvalues(entries: Array) -> Array:
    """Eigenvalues of symmetric matrices from their entries on and above the diagonal, increasing, (..., 6) -> (..., 3).

    In closed form, to 1e-8 of the largest (Smith, "Eigenvalues of a Symmetric 3 x 3 Matrix", Communications of the ACM
    4(4), 1961): ten times as fast as a solver on thousands of small matrices.
    """
    a, b, c, d, e, f = np.moveaxis(entries, -1, 0)
    middle = (a + d + f) / 3.0
    a, d, f = a - middle, d - middle, f - middle
    size = np.sqrt((a * a + d * d + f * f + 2.0 * (b * b + c * c + e * e)) / 6.0)
    determinant = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)
    ratio = determinant / (2.0 * np.maximum(size, np.finfo(np.float64).tiny ** 0.25) ** 3)
    angle = np.arccos(np.clip(ratio, -1.0, 1.0)) / 3.0
    largest, smallest = 2.0 * size * np.cos(angle), 2.0 * size * np.cos(angle + 2.0 * np.pi / 3.0)
    return np.asarray(middle[..., None] + np.stack([smallest, -largest - smallest, largest], axis=-1))
