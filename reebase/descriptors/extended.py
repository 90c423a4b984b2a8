"""``extended``: endpoints that see the surface around them, compared by D (METHOD §6; Kacem, section 5.2.1).

The idea: heat put at a point stays longest at the tip of a limb, so limbs end at the maxima of the auto diffusion
field (Gebal, Baerentzen, Aanaes, Larsen, "Shape Analysis Using the Auto Diffusion Function", SGP 2009), and how far
one must go down from one to reach a higher one, its persistence, tells a limb from a bump. At each, the heat
kernel signature at many times says what the limb is like, from its tip to the whole body, and the moments of the
normals whether it is a plate, a tube or a ball.
Use it wherever ``srg`` is used: it is still a matching of limbs with limbs that can be shown pair by pair, its
endpoints do not come and go with the pose, and it ranks far better.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.descriptors.hks import TIMES, log_heat
from reebase.descriptors.maxima import Maxima, persistent_maxima
from reebase.descriptors.moments import moments_around, moments_at
from reebase.descriptors.surface import Surface
from reebase.descriptors.wks import waves
from reebase.spectrum.signatures import heat_kernel_signature

__all__ = ["LEAST", "TIME", "describe", "endpoints", "place"]

Array = npt.NDArray[np.float64]

TIME = 0.04
"""Time of the auto diffusion field over the area."""

LEAST = 0.02
"""Persistence in nats below which a maximum is no endpoint: 2 % more heat than at the pass to a higher one."""

CHARGE = 1.5
CHARGES = (0.6, 1.5)
"""The charge is ``CHARGE`` times the persistence in nats, within these: dearer ones would drown what the features say,
and cheaper ones let limbs that differ stay alone."""

OWN = {"heat": 0.75, "spread": 2.0, "facing": 2.0}
SHARED = {"spread": 1.5, "extent": 0.5, "bulge": 2.0, "waves": 0.75}
"""Weights of the features of the endpoint and of the shape. Each is a root mean square over the times or energies, in
nats or in ratios, and so on a scale that is the same in every collection."""

SHORT = 3
"""Times of the moments of the whole shape, the shortest ones: in a wide window a bent knee shows."""


def endpoints(surface: Surface) -> Maxima:
    """The persistent maxima of the logarithm of the auto diffusion field, most persistent first.

    Ratios of heat, not differences, tell a limb: in nats persistence does not depend on how strong the hottest is.
    """
    field = np.log(heat_kernel_signature(surface.spectrum(), TIME)[:, 0])
    return persistent_maxima(surface.body, field, LEAST)


def place(surface: Surface) -> Array:
    """Where the endpoints lie, in the order of the rows of ``describe``, float64, (k, 3)."""
    return surface.body.vertices[surface.shared(endpoints).vertices]


def describe(surface: Surface) -> Array:
    """omega of each endpoint, most persistent first, float64, (k, 78), k >= 1.

    Of the endpoint: log heat kernel signature less its area-weighted mean, 16 columns; square roots of the eigenvalues
    of the normals' moments, 18, which are cosines as the mean normal is; length of the mean normal, 6. Of the shape,
    the same in each row, at the shortest times: the means over the surface of these square roots, 9, of the extents,
    9, and of the bulge, 3; the standard deviation of the wave kernel signature at each energy, 16. The last column:
    the charge of the endpoint when it stays unmatched.
    """
    found = surface.shared(endpoints)
    heat = surface.shared(log_heat)
    at = moments_at(surface, found.vertices)
    around = surface.shared(moments_around)
    own = {
        "heat": (heat[found.vertices] - surface.weights @ heat) / np.sqrt(len(TIMES)),
        "spread": _mean_square(np.sqrt(at.spread)),
        "facing": _mean_square(at.facing),
    }
    shared = {
        "spread": _mean_square(np.sqrt(around.spread)[:, :SHORT].mean(axis=0, keepdims=True)),
        "extent": _mean_square(around.extent[:, :SHORT].mean(axis=0, keepdims=True)),
        "bulge": _mean_square(around.bulge[:, :SHORT].mean(axis=0, keepdims=True)),
        "waves": _waves(surface),
    }
    of_shape = np.hstack([weight * shared[name] for name, weight in SHARED.items()])
    return np.column_stack([
        *(weight * own[name] for name, weight in OWN.items()),
        np.broadcast_to(of_shape, (len(found.vertices), of_shape.shape[1])),
        np.clip(CHARGE * found.persistence, *CHARGES),
    ])  # fmt: skip


def _mean_square(values: Array) -> Array:
    """Rows whose Euclidean distance is the root mean square over the times, (k, 6, ...) -> (k, ...)."""
    return np.asarray(values.reshape(len(values), -1) / np.sqrt(values.shape[1]))


def _waves(surface: Surface) -> Array:
    """How unevenly waves of each energy spread over the surface, (1, 16)."""
    found = surface.shared(waves)
    return np.asarray(np.sqrt(surface.weights @ (found - 1.0) ** 2)[None] / np.sqrt(found.shape[1]))
