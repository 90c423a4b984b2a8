"""Where the level sets of a Reeb graph lie: at equal steps of the field, or of the area below it.

The thesis cuts bands of equal width in phi_2. But phi_2 is steep where a surface is thin and flat at the ends of its
limbs, so that such bands are narrow on the body and a whole limb may lie in one. Levels with the same area between
them follow the surface instead: every band is as large as any other, a limb gets the bands that its area deserves, and
a quarter of the bands serves retrieval as well (benchmarks/skeleton_sweep.py).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.mesh.geometry import face_areas
from reebase.mesh.mesh import Mesh

__all__ = ["LEVELS", "by_area"]

Array = npt.NDArray[np.float64]

LEVELS = ("area", "width")
"""Bands of equal area, or of equal width in the field (Algorithm 1)."""


TIE = 1e-9
"""Values nearer to each other than this share of the range are equal: what rounding separates must not be spread."""


def by_area(mesh: Mesh, values: Array) -> Array:
    """The share of the area below each vertex's value, in [0, 1], float64, (m,): equal steps of it hold equal areas.

    values: the field at the vertices, (m,), finite, on faces that have an area. The area of a face counts as spread
    evenly over its range of the field, so that the shares follow the field without jumps; half of a face within a level
    counts as below it. Equal values get equal shares, and those of -values are 1 less these. So the order of the
    vertices, and with it the Reeb graph before it is cut into bands, stays what it was.
    """
    order = np.argsort(values)  # equal values share a step, in whatever order they come
    ordered = values[order]
    fresh = np.concatenate([[True], np.diff(ordered) > TIE * (ordered[-1] / 2 - ordered[0] / 2)])
    heights = ordered[fresh]
    step = np.empty(len(values), dtype=np.int64)  # of each vertex, its place among the heights
    step[order] = np.cumsum(fresh) - 1
    areas = face_areas(mesh)
    lowest, highest = step[mesh.faces].min(axis=1), step[mesh.faces].max(axis=1)
    flat = lowest == highest
    density = areas[~flat] / (heights[highest[~flat]] - heights[lowest[~flat]])
    count = len(heights)
    rise = np.bincount(lowest[~flat], density, count) - np.bincount(highest[~flat], density, count)
    within = np.bincount(lowest[flat], areas[flat], count)
    slopes = np.concatenate([[0.0], np.cumsum(rise)[:-1] * np.diff(heights)])
    below = np.cumsum(slopes) + np.cumsum(within) - within / 2
    return np.asarray((below / areas.sum())[step])
