"""L0 minimisation: as few edges as possible along which the surface bends, so that the rest is flat.

Idea: counting the bent edges, instead of adding up how far they bend, makes a shape piecewise flat with sharp creases.
Use it for shapes made of planes, at strong noise too; curved parts become facets. One iteration is the whole
minimisation. Source: L. He and S. Schaefer, Mesh Denoising via L0 Minimization, ACM TOG 32 (SIGGRAPH 2013).

For an edge (1, 3) between the triangles (1, 2, 3) and (1, 3, 4), with areas a and b and both sums over the two,

    D(e) = [ (a <p4-p3, p3-p1> + b <p1-p3, p3-p2>) p1 + (a <p3-p1, p1-p4> + b <p2-p1, p1-p3>) p3 ] / (|p3-p1|^2 (a+b))
         + (b p2 + a p4) / (a + b),
    R(e) = p1 - p2 + p3 - p4

D vanishes on planes. Alternately, with beta = 0.001 growing by sqrt 2 up to 1000,

    delta_e = D(e), or 0 where |D(e)|^2 <= lambda / beta
    p minimises |p - p0|^2 + beta sum |D(e) - delta_e|^2 + alpha sum |R(e)|^2

with the coefficients of D at the p before. lambda is ``flatness`` times the mean angle between the faces at edges times
the squared mean edge length, alpha begins at 0.1 times that angle and is halved in each round. The forty systems are
solved by sparse factors, which takes seconds for ten thousand vertices. As printed ``flatness`` is 0.02, which leaves
noise of 0.3 mean edge lengths nearly as it was; the default removes it. Edges without two triangles, or with one that
has no area, do not count.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.denoise.faces import sides_across
from reebase.denoise.filter import Filter, FloatArray, Number, Step, Surface
from reebase.mesh.geometry import lengths

__all__ = ["L0"]

FIRST, LAST, GROWTH = 1e-3, 1e3, 2.0**0.5
"""Of beta."""
REGULAR = 0.1
"""alpha over the mean angle."""
LEAST = 1e-12
"""Twice an area, or a squared length, in squared mean edge lengths, below which it counts as none."""

IntArray = npt.NDArray[np.int32]


def prepare(surface: Surface, parameters: Mapping[str, Any]) -> Step:
    """The whole minimisation on this surface."""
    corners = corners_of_edges(surface)

    def step(positions: FloatArray) -> FloatArray:
        from scipy.sparse import csr_array, eye_array
        from scipy.sparse.linalg import splu

        from reebase.mesh.topology_kernels import mean_distance

        count = len(corners)
        if count == 0:
            return np.zeros_like(positions)
        begins = np.arange(0, 4 * count + 1, 4, dtype=np.int32)

        def operator(values: FloatArray) -> Any:
            return csr_array((values.ravel(), corners.ravel(), begins), shape=(count, len(positions)))

        skew = operator(np.tile([1.0, -1.0, 1.0, -1.0], (count, 1)))
        regular = skew.T @ skew
        angle = mean_angle_at(positions, corners)
        length = mean_distance(positions, surface.rings.neighbour_starts, surface.rings.neighbours)
        beta, alpha, flat = FIRST, REGULAR * angle, parameters["flatness"] * angle * length**2
        found, one = positions, eye_array(len(positions), format="csr")
        while beta < LAST:
            bend = operator(coefficients(found, corners))
            delta = bend @ found
            delta[(delta**2).sum(axis=1) <= flat / beta] = 0.0
            matrix = (one + beta * (bend.T @ bend) + alpha * regular).tocsc()
            factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
            found = factors.solve(positions + beta * (bend.T @ delta))
            beta *= GROWTH
            alpha /= 2
            surface.report.within(math.log(min(beta, LAST) / FIRST) / math.log(LAST / FIRST))
        return found - positions

    return step


def corners_of_edges(surface: Surface) -> IntArray:
    """p1, p2, p3, p4 of each edge with two triangles: 1 and 3 are its ends, 2 and 4 opposite, int32, (E, 4)."""
    first, second = sides_across(surface)
    flat = surface.faces.ravel()

    def opposite(sides: IntArray) -> IntArray:
        return np.asarray(flat[sides - sides % 3 + (sides + 2) % 3])

    ends = flat[first], flat[first - first % 3 + (first + 1) % 3]
    # Side (p, q) of triangle (p, q, r): r lies opposite. So 3 -> 1 is the side of (1, 2, 3).
    return np.stack([ends[1], opposite(first), ends[0], opposite(second)], axis=1).astype(np.int32)


def mean_angle_at(positions: FloatArray, corners: IntArray) -> float:
    """The mean angle between the normals beside an edge, in radians."""
    p1, p2, p3, p4 = positions[corners].transpose(1, 0, 2)
    one, other = np.cross(p2 - p1, p3 - p1), np.cross(p3 - p1, p4 - p1)
    return float(np.arctan2(lengths(np.cross(one, other)), (one * other).sum(axis=1)).mean())


def coefficients(positions: FloatArray, corners: IntArray) -> FloatArray:
    """Those of D(e) for the four corners of each edge, (E, 4), zero where a triangle or the edge has no extent."""
    p1, p2, p3, p4 = positions[corners].transpose(1, 0, 2)
    a, b = lengths(np.cross(p2 - p1, p3 - p1)), lengths(np.cross(p3 - p1, p4 - p1))
    square = ((p3 - p1) ** 2).sum(axis=1)
    proper = (a > LEAST) & (b > LEAST) & (square > LEAST)
    both = np.where(proper, a + b, 1.0)
    scale = np.where(proper, square, 1.0) * both

    def dot(u: FloatArray, v: FloatArray) -> FloatArray:
        return np.asarray((u * v).sum(axis=1))

    found = np.stack(
        [
            (a * dot(p4 - p3, p3 - p1) + b * dot(p1 - p3, p3 - p2)) / scale, b / both,
            (a * dot(p3 - p1, p1 - p4) + b * dot(p2 - p1, p1 - p3)) / scale, a / both,
        ],
        axis=1,
    )  # fmt: skip
    return np.where(proper[:, None], found, 0.0)


L0 = Filter(
    name="l0",
    summary="bends along as few edges as possible, which keeps creases and flattens the rest (He and Schaefer 2013)",
    prepare=prepare,
    parameters={
        "flatness": Number(0.2, 0.0, 10.0, "lambda over the mean angle at edges and the squared mean edge length"),
    },
)
