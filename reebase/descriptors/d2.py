"""``d2``: the distribution of distances between points of the surface (Osada, Funkhouser, Chazelle, Dobkin, "Shape
Distributions", ACM Transactions on Graphics 21(4), 2002).

The idea: how far apart two random points of the surface are, in space, tells long shapes from round ones.
Use it as the yardstick that everything else must beat, and for rigid shapes of any quality: it needs neither
connectivity nor a clean surface. A bent limb changes it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.descriptors.surface import Surface
from reebase.mesh.geometry import face_areas
from reebase.mesh.mesh import Mesh

__all__ = ["describe", "surface_points"]

POINTS = 1024
"""Points on the surface: half a million distances."""

BINS = 64
"""Bins of the histogram, from 0 to ``FARTHEST`` mean distances; what is farther is in the last."""

FARTHEST = 3.0


def describe(surface: Surface) -> npt.NDArray[np.float64]:
    """Shares of the distances, over their mean, in each of 64 bins, float64, (64,), summing to 1."""
    from scipy.spatial.distance import pdist

    from reebase.descriptors.d2_kernels import binned

    distances = pdist(surface_points(surface.body, POINTS))
    counts = binned(distances / distances.mean(), np.linspace(0.0, FARTHEST, BINS + 1))
    return np.asarray(counts / len(distances))


def surface_points(mesh: Mesh, count: int, seed: int = 0) -> npt.NDArray[np.float64]:
    """Points spread over the surface, one in each of ``count`` equal shares of its area, float64, (count, 3).

    The shares run through the faces in their order. Within a triangle: Osada et al. 2002, equation 1.
    """
    random = np.random.default_rng(seed)
    cumulated = np.cumsum(face_areas(mesh))
    steps = (np.arange(count) + random.random(count)) / count * cumulated[-1]
    chosen = np.minimum(np.searchsorted(cumulated, steps), len(cumulated) - 1)
    a, b, c = mesh.vertices[mesh.faces[chosen]].transpose(1, 0, 2)
    root, along = np.sqrt(random.random((count, 1))), random.random((count, 1))
    return np.asarray((1 - root) * a + root * (1 - along) * b + root * along * c)
