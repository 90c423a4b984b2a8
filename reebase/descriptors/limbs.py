"""The skeleton whose ends are the endpoints of ``extended``: what its matching speaks of, to be stored and shown.

The idea: the endpoints are maxima of the auto diffusion field; in the Reeb graph of that same field each of them is
where a branch ends, so that leaving out all other branches gives a skeleton with a branch for every limb.
"""

from __future__ import annotations

import numpy as np

from reebase.descriptors.extended import LEAST, TIME, endpoints
from reebase.descriptors.surface import Surface
from reebase.skeleton import MAX_BANDS, Skeleton, prune_to, reeb_nodes
from reebase.spectrum import field

__all__ = ["limb_skeleton"]

FEWEST = 64
"""Bands at least."""


def limb_skeleton(surface: Surface) -> Skeleton:
    """The Reeb graph of the logarithm of the auto diffusion field, pruned to the endpoints of ``extended``.

    ``endpoints`` are in the order of the rows of ``extended.describe``; every other node has two neighbours or more,
    except that a shape with one endpoint alone keeps the path from there to the coldest point. The bands are narrower
    than the least persistence of an endpoint, so that each has its own node. Raises ComputationError.
    """
    values = field(f"auto_diffusion:{TIME}", surface.body, surface.spectrum())
    bands = int(np.clip(np.ptp(values) / LEAST + 2, FEWEST, MAX_BANDS))
    graph, nodes = reeb_nodes(surface.body, values, bands)
    ends = nodes[surface.shared(endpoints).vertices]
    return prune_to(graph, ends[np.sort(np.unique(ends, return_index=True)[1])])
