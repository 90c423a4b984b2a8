"""``extended``: endpoints that see the surface around them, compared by D (METHOD §6; Kacem, section 5.2.1).

The idea: heat put at a point stays longest at the tip of a limb, so limbs end at the maxima of the auto diffusion
field (Gebal, Baerentzen, Aanaes, Larsen, "Shape Analysis Using the Auto Diffusion Function", SGP 2009), and how far
one must go down from one to reach a higher one, its persistence, tells a limb from a bump. At each, the heat
kernel signature at many times says what the limb is like, from its tip to the whole body.
Use it wherever ``srg`` is used: it is still a matching of limbs with limbs that can be shown pair by pair, its
endpoints do not come and go with the pose, and it ranks far better.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.descriptors.hks import TIMES, log_heat
from reebase.descriptors.maxima import Maxima, persistent_maxima
from reebase.descriptors.surface import Surface
from reebase.spectrum.signatures import heat_kernel_signature

__all__ = ["LEAST", "TIME", "describe", "endpoints", "place"]

TIME = 0.03
"""Time of the auto diffusion field over the area."""

LEAST = 0.05
"""Persistence in nats below which a maximum is no endpoint: 5 % more heat than at the pass to a higher one."""

CHARGES = (0.25, 1.5)
"""The charge is the persistence in nats within these: dearer ones would drown what the features say."""

MEAN = 0.5
"""Weight of the shape's mean signature beside the endpoint's own. Each is a root mean square over the times, in nats,
and so on a scale that is the same in every collection."""


def endpoints(surface: Surface) -> Maxima:
    """The persistent maxima of the logarithm of the auto diffusion field, most persistent first.

    Ratios of heat, not differences, tell a limb: in nats persistence does not depend on how strong the hottest is.
    """
    field = np.log(heat_kernel_signature(surface.spectrum(), TIME)[:, 0])
    return persistent_maxima(surface.body, field, LEAST)


def place(surface: Surface) -> npt.NDArray[np.float64]:
    """Where the endpoints lie, in the order of the rows of ``describe``, float64, (k, 3)."""
    return surface.body.vertices[endpoints(surface).vertices]


def describe(surface: Surface) -> npt.NDArray[np.float64]:
    """omega of each endpoint, most persistent first, float64, (k, 33), k >= 1.

    16 columns: log heat kernel signature at the endpoint less its area-weighted mean; 16: half that mean, the same in
    each row; all over sqrt(16); the last: the charge of the endpoint when it stays unmatched.
    """
    found = endpoints(surface)
    heat = log_heat(surface)
    mean = surface.weights @ heat
    own = (heat[found.vertices] - mean) / np.sqrt(len(TIMES))
    shared = np.broadcast_to(MEAN * mean / np.sqrt(len(TIMES)), own.shape)
    return np.column_stack([own, shared, np.clip(found.persistence, *CHARGES)])
