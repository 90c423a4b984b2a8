"""``rgpd``: the Reeb graph path dissimilarity, the thesis's own predecessor (Mohamed and Ben Hamza, "Reeb Graph Path
Dissimilarity for 3D Object Matching and Retrieval", The Visual Computer 28(3), 2012).

The idea: how far a point is, along the surface, from all the others does not change when the shape bends; the ends of
limbs are where that is greatest. The Reeb graph of this normalised distance function takes the place of that of phi_2;
endpoints, features and D are those of ``srg``.
Use it beside ``srg``: it finds every limb where phi_2 sees only the two longest ones, but a coarse or noisy surface
moves all of its distances.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from reebase.descriptors.surface import Surface
from reebase.matching import endpoint_features
from reebase.pipeline import skeleton

__all__ = ["describe"]

BANDS = 64
"""Half of the pipeline's: the field rises to every limb at once, so that each limb has the bands of the whole."""


def describe(surface: Surface) -> npt.NDArray[np.float64]:
    """omega = (a, dv, dc) of each endpoint where the field is greatest, float64, (k, 3).

    Where it is least lies the middle of the body: whether that ends in a cap or in a ring says nothing of limbs.
    """
    graph = skeleton(surface.body, field="geodesic_integral", bands=BANDS, levels="width")
    rises = np.zeros(len(graph.positions), dtype=bool)
    rises[graph.edges.max(axis=1, initial=0)] = True  # nodes are numbered by band: its edge comes from below
    rises[graph.edges.min(axis=1, initial=0)] = False
    return endpoint_features(dataclasses.replace(graph, endpoints=graph.endpoints[rises[graph.endpoints]]))
