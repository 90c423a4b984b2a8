"""Maxima of a function on a mesh and how persistent each is: 0-dimensional persistent homology."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import rings

__all__ = ["Maxima", "persistent_maxima"]


class Maxima(NamedTuple):
    """vertices: int64, (k,), by decreasing persistence, then value, then index. persistence: float64, (k,)."""

    vertices: npt.NDArray[np.int64]
    persistence: npt.NDArray[np.float64]


def persistent_maxima(mesh: Mesh, values: npt.NDArray[np.float64], least: float = 0.0) -> Maxima:
    """The maxima of ``values``, (m,), on the edges of a connected mesh that persist by ``least`` or more.

    A maximum's persistence is how far one must go down from it to reach a higher one; that of the highest, which
    there is none to reach, is the whole range of the values (Edelsbrunner, Letscher, Zomorodian, "Topological
    Persistence and Simplification", 2002). Of equal values the vertex with the smaller index counts as the higher.
    The highest is always among them.
    """
    from reebase.descriptors.maxima_kernels import persistences

    joined = rings(mesh.faces, len(mesh.vertices))
    order = np.argsort(-values, kind="stable")
    found = persistences(values, order, joined.neighbour_starts, joined.neighbours)
    found[order[0]] = values[order[0]] - values[order[-1]]
    kept = np.flatnonzero(found >= least)
    kept = kept if len(kept) else order[:1]
    kept = kept[np.lexsort((kept, -values[kept], -found[kept]))]
    return Maxima(kept, found[kept])
