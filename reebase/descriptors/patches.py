"""``patches``: what the surface is like round points that are spread over it, to find the whole of a part (Kacem,
section 5.2.1).

The idea: a limb, or half of a scan, looks from close by as the whole does there, whatever is missing. Round each of 256
points the surface is described in growing geodesic discs: how much area they hold, how far their normals turn, how high
they rise, each free of pose. A disc that reaches the border of the part, or is smaller than the mesh resolves, is left
unknown. Then every patch of the query looks for its closest one in the other shape; what only the other has costs
nothing. Discs grow by a constant factor, so that another scale is a shift along them.
Use it when the query is a part: with ``absolute`` where part and wholes have one unit, as scans have, else with
``relative``. For whole shapes the other descriptors rank better.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.descriptors.surface import Surface
from reebase.errors import ParameterError
from reebase.matching import Comparison, Match, Pair, Stack, Unmatched
from reebase.mesh.geodesics import Spread, distance_to, farthest_points
from reebase.mesh.geometry import face_areas, face_normals, mean_edge_length, vertex_normals
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import edges

__all__ = ["PATCHES", "describe", "place"]

Array = npt.NDArray[np.float64]

POINTS = 256
"""Patches of a shape. With 64 a point of the part is too far from the nearest of the whole: of limbs of a tenth of the
area 0.15 found their whole first, and 0.85 do."""

FEWEST_POINTS = 64
STEPS = 2_500_000
"""Of a mesh with more vertices there are fewer patches, so that they and the vertices multiply to no more than this,
but not fewer than ``FEWEST_POINTS``: round each point distances spread over the whole surface."""

ASKED = 32
"""Patches of a query that look for theirs: the first ones, which are spread over it as evenly as all."""

FACTOR = 2 ** (1 / 3)
"""By which a disc is wider than the one before."""

RADII: Array = 0.05 * FACTOR ** np.arange(12, dtype=np.float64)
"""Of the discs, over the root of the area: from a fingertip to half of the shape."""

RESOLVED = 2.0
"""Discs of fewer mean edge lengths than these are unknown."""

WEIGHTS = (1.0, 1.0, 2.0)
"""Of area over that of a flat disc, of the mean cosine of the normals, and of the mean height over the radius."""

FEWEST = 3
"""Discs that two patches must both know, unless the query's knows fewer."""

FARTHEST = 2.0
"""Cost of a patch that finds no other: that of a plane beside a ball's far side."""

SHIFTS = np.arange(0.0, -8.5, -0.5)
"""Of the discs of a part against those of its whole, which is larger: the part has from all down to a fortieth of its
area."""


def describe(surface: Surface) -> Array:
    """A row for each patch, float64, (64 to 256, 39): the first disc that is known, one after the last, three values a
    disc, and the logarithm of the root of the area in the units of the mesh.

    Fewer rows where the mesh has fewer vertices. Values of discs that are not known are 0.
    """
    from reebase.descriptors.patches_kernels import gather

    mesh, size = _at_unit_area(surface.body)
    spread, free = _spread(mesh, 1.25 * RADII[-1])
    areas, normals, middles = face_areas(mesh), face_normals(mesh), mesh.vertices[mesh.faces].mean(axis=1)
    outward = vertex_normals(mesh, "area")
    found = np.empty((len(spread.vertices), len(RADII), 3))
    for vertex, distances, values in zip(spread.vertices, spread.distances, found, strict=True):
        away = distances[mesh.faces].mean(axis=1)
        gather(away, areas, normals, middles - mesh.vertices[vertex], outward[vertex], RADII, values)
    found[..., 0] /= np.pi * RADII**2
    first = np.full(len(found), np.searchsorted(RADII, RESOLVED * mean_edge_length(mesh)))
    after = np.maximum(np.searchsorted(RADII, free[: len(found)], side="right"), first)
    known = (np.arange(len(RADII)) >= first[:, None]) & (np.arange(len(RADII)) < after[:, None])
    values = np.where(known[..., None], found * WEIGHTS, 0.0).reshape(len(found), -1)
    return np.column_stack([first, after, values, np.full(len(found), np.log(size))])


def place(surface: Surface) -> Array:
    """Where the patches lie, in the order of the rows of ``describe``, float64, (k, 3)."""
    return surface.body.vertices[_spread(_at_unit_area(surface.body)[0], 0.0)[0].vertices]


def _spread(mesh: Mesh, reach: float) -> tuple[Spread, Array]:
    """Points clear of one another and of the border, and how far each is from that."""
    count = int(np.clip(STEPS // len(mesh.vertices), FEWEST_POINTS, POINTS))
    joined = edges(mesh.faces)
    border = np.unique(joined.vertices[joined.boundary])
    if not len(border):
        return farthest_points(mesh, count, reach), np.full(count, np.inf)
    clear = distance_to(mesh, border)
    spread = farthest_points(mesh, count, reach, clear)
    return spread, clear[spread.vertices]


def _at_unit_area(mesh: Mesh) -> tuple[Mesh, float]:
    """The mesh, and the root of its area, by which it was divided."""
    size = float(np.sqrt(face_areas(mesh).sum()))
    return Mesh(mesh.vertices / size, mesh.faces), size


def _as_patches(kept: npt.ArrayLike, name: str) -> Array:
    rows = np.ascontiguousarray(kept, dtype=np.float64)
    width = 3 + 3 * len(RADII)
    if rows.ndim != 2 or rows.shape[1] != width or not len(rows) or not np.isfinite(rows).all():
        raise ParameterError(f"{name} must be finite, of shape (k, {width}); found {rows.shape}.", parameter=name)
    if not ((rows[:, 0] >= 0) & (rows[:, 0] <= rows[:, 1]) & (rows[:, 1] <= len(RADII))).all():
        raise ParameterError(f"{name} names discs that there are not.", parameter=name)
    return rows


def _shifts(part: Array, whole: Array, measure: str) -> Array:
    if measure == "relative":
        return SHIFTS
    return np.array([(part[0, -1] - whole[0, -1]) / np.log(FACTOR)])


def _closest(part: Array, whole: Array, measure: str) -> tuple[float, npt.NDArray[np.int64], Array]:
    from reebase.descriptors.patches_kernels import closest_patches

    asked = part[:ASKED, :-1].copy()
    partner, costs = np.full(len(asked), -1), np.empty(len(asked))
    shifts = _shifts(part, whole, measure)
    total = closest_patches(asked, whole[:, :-1].copy(), shifts, FEWEST, FARTHEST, partner, costs)
    return float(total), partner, costs


def _one_to_many(query: Array, stack: Stack, measure: str) -> Array:
    ends, values = stack.offsets[1:], np.asarray(stack.values, dtype=np.float64)
    shapes = (values[start:end] for start, end in zip(stack.offsets, ends, strict=False))
    return np.array([_closest(query, shape, measure)[0] for shape in shapes])


def _explain(first: npt.ArrayLike, second: npt.ArrayLike, measure: str) -> Match:
    total, partner, costs = _closest(_as_patches(first, "first"), _as_patches(second, "second"), measure)
    return Match(
        total, measure,
        tuple(Pair(i, int(j), float(costs[i])) for i, j in enumerate(partner) if j >= 0),
        tuple(Unmatched(i, float(costs[i])) for i, j in enumerate(partner) if j < 0),
        (),
        "Only patches of the query look for one in the other shape, and several may find the same.",
    )  # fmt: skip


PATCHES = Comparison(_as_patches, _one_to_many, frozenset({"relative", "absolute"}), _explain)
"""Mean difference of the query's patches from their closest ones: ``relative``, at the best scale; ``absolute``, at
that of the units. Row = query = the part."""
