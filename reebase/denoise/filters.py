"""``denoise``: any filter by name, iterated, with one treatment of boundaries for all."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.denoise.filter import Filter, FloatArray, Surface
from reebase.denoise.finite_volume import FINITE_VOLUME
from reebase.denoise.laplacian import LAPLACIAN
from reebase.errors import ParameterError, unknown_name
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import Rings, rings

__all__ = ["BOUNDARIES", "METHODS", "denoise"]

METHODS: dict[str, Filter] = {entry.name: entry for entry in (FINITE_VOLUME, LAPLACIAN)}
"""Every filter by name."""

BOUNDARIES = {
    "curve": "boundary vertices move along the boundary curve only",
    "fixed": "boundary vertices stay where they are",
    "free": "boundary vertices move as the filter says",
}
"""What may become of vertices on the boundary, by name."""

MOST_ITERATIONS = 1000


def denoise(
    mesh: Mesh, method: str = "finite_volume", iterations: int = 1, *, boundary: str = "curve",
    **parameters: Any,
) -> Mesh:  # fmt: skip
    """The mesh with the same faces and its vertices moved by a filter.

    method: a name from METHODS. iterations: 1 to 1000. boundary: a name from BOUNDARIES; "curve" keeps of
    each displacement d its part along the boundary, (d . t) t with t the direction between the two
    neighbours on the boundary, and nothing where the boundary passes a vertex more than once. parameters:
    those of the filter, ``METHODS[method].parameters``. Topology is built once; all geometry is computed
    anew in each iteration. Isolated vertices stay untouched. Invariant to translation, rotation, scale and
    vertex order up to rounding. Raises UnknownName, ParameterError.
    """
    if method not in METHODS:
        raise unknown_name("method", method, METHODS)
    if boundary not in BOUNDARIES:
        raise unknown_name("boundary", boundary, BOUNDARIES)
    if type(iterations) is not int or not 1 <= iterations <= MOST_ITERATIONS:
        raise ParameterError(
            f"iterations must be a whole number from 1 to {MOST_ITERATIONS}; found {iterations!r}.",
            parameter="iterations", found=repr(iterations),
        )  # fmt: skip
    checked = METHODS[method].checked(parameters)

    around = rings(mesh.faces, len(mesh.vertices))
    moving = np.flatnonzero(around.degrees)
    scale = mean_neighbour_distance(mesh.vertices, around)
    if scale == 0:
        return mesh
    # Near the origin and in mean edge lengths, squares neither overflow nor lose digits.
    start = np.zeros_like(mesh.vertices)
    start[moving] = (mesh.vertices[moving] - mesh.vertices[moving[0]]) / scale
    step = METHODS[method].prepare(Surface(start, mesh.faces, around), checked)
    curve, along = around.boundary_curve
    positions = start
    for _ in range(iterations):
        displacements = step(positions)
        if boundary == "fixed":
            displacements[curve] = 0.0
        elif boundary == "curve":
            displacements[curve] = along_curve(positions, displacements[curve], along)
        positions = positions + displacements
    moved = mesh.vertices.copy()
    moved[moving] += scale * (positions - start)[moving]
    return Mesh(moved, mesh.faces)


def along_curve(
    positions: FloatArray, displacements: FloatArray, neighbours: npt.NDArray[np.int32]
) -> FloatArray:
    """The part of each displacement, (b, 3), along the line between the two neighbours on the boundary, (b,
    2)."""
    tangents = positions[neighbours[:, 1]] - positions[neighbours[:, 0]]
    square = (tangents**2).sum(axis=1)
    share = (displacements * tangents).sum(axis=1) / np.where(square > 0, square, 1.0)
    return np.asarray(share[:, None] * tangents)


def mean_neighbour_distance(vertices: FloatArray, around: Rings) -> float:
    """The mean edge length (1.4): every edge is met from both its ends. 0 without edges."""
    source = np.repeat(np.arange(len(vertices)), around.degrees)
    sides = vertices[around.neighbours] - vertices[source]
    largest = float(np.abs(sides).max(initial=0.0))
    if largest == 0:
        return 0.0
    return largest * float(np.sqrt(((sides / largest) ** 2).sum(axis=1)).mean())
