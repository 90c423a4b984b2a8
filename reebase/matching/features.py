"""Endpoint features: omega = (a, dv, dc), what the method knows about the end of a limb."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.errors import ComputationError, ParameterError, unknown_name
from reebase.skeleton.graph import Skeleton

__all__ = ["AREAS", "as_features", "endpoint_features"]

AREAS = ("band", "ring")
"""Readings of the relative node area: the component of the band, or the one-ring of its extremal vertex."""

LARGEST = 1e100
"""No endpoint of any skeleton comes near this; beyond it the squares in Phi would overflow in the kernels."""


def endpoint_features(skeleton: Skeleton, area: str = "band") -> npt.NDArray[np.float64]:
    """omega_i = (a_i, dv_i, dc_i) of each endpoint, float64, shape (k, 3), in the order of
    ``skeleton.endpoints``.

    With the root node c and delta the length of the shortest path along the skeleton's edges (Kacem, section
    4.3; METHOD §5): a_i = area at the endpoint / area(M), in (0, 1]; dv_i = sum_k delta(v_i, v_k) / sum_k
    delta(c, v_k); dc_i = delta(c, v_i) / sum_k delta(c, v_k), which sums to 1. All are free of units, so
    invariant to scale.
    area: "band" takes the area of the endpoint's node, which does not depend on the tessellation; "ring" the
    one-ring of its extremal vertex, as printed.
    A skeleton without endpoints, or whose endpoints all lie at the root (sum_k delta(c, v_k) = 0), has shape
    (0, 3).
    Raises UnknownName for another ``area``; ComputationError when an endpoint cannot be reached from the
    root.
    """
    if area not in AREAS:
        raise unknown_name("area", area, AREAS)
    endpoints = np.asarray(skeleton.endpoints, dtype=np.int64)
    if len(endpoints) == 0:
        return np.zeros((0, 3))
    paths = skeleton.path_lengths(np.concatenate([[skeleton.root], endpoints]))[:, endpoints]
    if not np.isfinite(paths).all():
        raise ComputationError("The skeleton is not connected: an endpoint cannot be reached from the root.")
    from_root = paths[0]
    # The matrix of paths between endpoints is symmetric but for rounding; the mean makes it so.
    between = (paths[1:] + paths[1:].T) / 2
    total = float(from_root.sum())
    if total == 0.0:
        return np.zeros((0, 3))
    areas = skeleton.areas if area == "band" else skeleton.ring_areas
    return np.column_stack(
        [areas[endpoints] / skeleton.areas.sum(), between.sum(axis=1) / total, from_root / total]
    )


def as_features(value: Skeleton | npt.ArrayLike, name: str = "features") -> npt.NDArray[np.float64]:
    """``value`` as endpoint features: a skeleton's, or an array of shape (k, 3), C-contiguous float64.

    An empty array of any shape stands for no endpoints. ``name`` is what a refusal calls the argument.
    Raises ParameterError for another shape, and for entries that are negative or above ``LARGEST``: areas and
    path lengths never are, and the kernels and the bounds of the search rely on it.
    """
    if isinstance(value, Skeleton):
        return endpoint_features(value)
    try:
        features = np.ascontiguousarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        message = f"{name} must be a skeleton or numbers of shape (k, 3)."
        raise ParameterError(message, parameter=name) from error
    if features.size == 0:
        return np.zeros((0, 3))
    if features.ndim != 2 or features.shape[1] != 3:
        raise ParameterError(
            f"{name} must have shape (k, 3), a row (a, dv, dc) for each endpoint; found {features.shape}.",
            parameter=name, found=list(features.shape),
        )  # fmt: skip
    lowest, highest = float(features.min()), float(features.max())
    if not (lowest >= 0.0 and highest <= LARGEST):
        raise ParameterError(
            f"{name} must be between 0 and {LARGEST:g}; found values between {lowest} and {highest}.",
            parameter=name,
        )
    return features
