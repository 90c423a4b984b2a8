"""The spectral Reeb graph (Algorithm 1): a surface cut into bands by the levels of a scalar field.

The piecewise-linear surface is cut exactly: nothing is sampled, so areas add up, cycles are handles, and a
finer tessellation of the same surface and field gives the same graph.

What meets in a band is decided by stretches, not points. Two pieces in a band join when the edge
between their faces meets the (closed) band in more than a point, so a saddle on a level does not join what it
separates. An edge within a level belongs to the bands on both sides of it, and a face within a level gives
half of its area to each. The rules are the same for f and -f.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reebase.errors import DegenerateMesh, LimitError, MeshError, NoFaces, ParameterError, unknown_name
from reebase.mesh.geometry import face_areas
from reebase.mesh.mesh import Mesh
from reebase.mesh.parts import Links
from reebase.skeleton.graph import Skeleton
from reebase.skeleton.levels import LEVELS, by_area

__all__ = ["MAX_BANDS", "reeb_graph", "reeb_nodes"]

MAX_BANDS = 1024

ON_LEVEL = 1e-9
"""Values nearer to a level than this share of the band width count as on it: what is a tie
does not depend on rounding, nor on the field's sign."""

CONSTANT = 1e-12
"""A field whose range is below this share of its largest magnitude is constant up to rounding."""

Array = npt.NDArray[np.float64]


def reeb_graph(
    mesh: Mesh, values: Array, bands: int = 64, levels: str = "width", links: Links | None = None
) -> Skeleton:
    """The Reeb graph of a scalar field on a connected surface, in bands from its minimum to its maximum (METHOD §4).

    values: the field at the vertices, (m,), linear on faces. bands: N, 2 to ``MAX_BANDS``. levels: "width" for bands of
    equal width in the field, as the thesis has them, or "area" for bands of equal area (``reebase.skeleton.levels``).
    Node = connected component of a band, placed at its area centroid; edge = two nodes in adjacent bands
    that share a stretch of level curve. Node areas sum to area(M); ``cycles`` is the genus of a closed
    surface once the bands resolve its handles. Nodes are numbered by band, then by decreasing area. A
    constant field gives a single node.
    links: of a surface in several parts, the places where these are joined. Where two parts touch, their pieces in a
    band are one component, as if the surface went on there. Parts that this does not connect are connected by edges,
    their ``joins``, the links between the nearest bands first, ties by their gaps.

    ``ring_areas`` are those of the extremal vertex of each component, the one that is furthest from its
    neighbours: the lowest where all neighbours are above, the highest where all are below, else the one with
    the value furthest from the middle of the range; ties take the larger ring; 0 for a slice without
    vertices.

    Raises NoFaces, DegenerateMesh (no area), MeshError when the surface is in several parts, ParameterError,
    UnknownName for other levels, and LimitError when the bands cut the faces into more than ``MAX_PIECES``.
    """
    if levels not in LEVELS:
        raise unknown_name("level sets", levels, LEVELS)
    values = _checked(mesh, values, bands)
    if levels == "area" and not _is_constant(values) and face_areas(mesh).sum() > MIN_AREA:
        values = by_area(mesh, values)
    return _cut(mesh, values, bands, links)[0]


def reeb_nodes(mesh: Mesh, values: Array, bands: int = 64) -> tuple[Skeleton, npt.NDArray[np.int32]]:
    """The Reeb graph, and of each vertex the node that it lies in, or just above: (m,), -1 where no face meets it.

    A maximum that persists by more than the width of a band has a node of its own. Raises as ``reeb_graph``.
    """
    graph, pieces = _cut(mesh, _checked(mesh, values, bands), bands)
    return graph, _below(mesh.faces, pieces)


class _Pieces(NamedTuple):
    """Of each face the pieces in the bands that it meets, from ``first`` on, (n,): offset[f] ... offset[f + 1].

    u: the field in units of the band width, (m,). node: of each piece.
    """

    u: Array
    first: npt.NDArray[np.int32]
    offset: npt.NDArray[np.int64]
    node: npt.NDArray[np.int32]


def _checked(mesh: Mesh, values: Array, bands: int) -> Array:
    if bands % 1 or not 2 <= bands <= MAX_BANDS:
        raise ParameterError(
            f"The number of bands must be a whole number from 2 to {MAX_BANDS}; found {bands!r}.",
            parameter="bands", minimum=2, maximum=MAX_BANDS,
        )  # fmt: skip
    values = np.asarray(values, dtype=np.float64)
    if values.shape != (len(mesh.vertices),):
        raise ParameterError(
            f"The field must have one value a vertex, shape ({len(mesh.vertices)},); found {values.shape}.",
            parameter="values",
        )
    if not len(mesh.faces):
        raise NoFaces("The mesh has no faces, so there is no surface to cut into bands.")
    if not np.isfinite(values).all():
        raise ParameterError("The field has values that are NaN or infinite.", parameter="values")
    return values


def _cut(mesh: Mesh, values: Array, bands: int, links: Links | None = None) -> tuple[Skeleton, _Pieces]:
    from reebase.skeleton import reeb_kernels as kernels

    u = _in_bands(values, bands)
    first, offset = kernels.cut_faces(u, mesh.faces, bands)
    if offset[-1] > MAX_PIECES:
        raise LimitError(
            f"{bands} bands cut the {len(mesh.faces)} faces into {offset[-1]} pieces, more than {MAX_PIECES}: "
            "take fewer bands, or denoise the mesh first.",
            pieces=int(offset[-1]), maximum=MAX_PIECES,
        )  # fmt: skip
    pairs, ends, parts = kernels.adjacent_faces(u, mesh.faces, first, offset)
    if parts > 1 and links is None:
        raise MeshError(
            f"The surface is in {parts} separate parts; a Reeb graph is of one: take the largest component.",
            components=parts,
        )
    component, band, adjacent = kernels.join_pieces(u, bands, first, offset, pairs, ends)
    across = np.empty((0, 2), np.int64)
    if parts > 1 and links is not None:
        ends_of_links = component[_pieces_at(mesh, links, u, first, offset)]
        component, band, adjacent, across = _joined(component, band, adjacent, ends_of_links, links)
    areas, centroids, rings = kernels.measure_components(
        mesh.vertices, mesh.faces, u, first, offset, component, len(band)
    )
    if not areas.sum() > MIN_AREA:
        raise DegenerateMesh("The surface has no area, so its Reeb graph has no nodes.")
    edges, is_join = _unique_edges(adjacent, across, len(band))
    extremes, extreme_rings = kernels.extreme_rings(
        mesh.faces, u, first, offset, component, rings, len(band)
    )
    extremes = np.where(np.isfinite(extremes), extremes - bands / 2, 0.0)  # a slice without vertices has none
    ring_areas = _extremal_rings(band, edges, extremes, extreme_rings)

    order = np.lexsort((-areas, band))
    rank = np.empty(len(order), np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    edges = np.sort(rank[edges], axis=1)
    by_nodes = np.lexsort((edges[:, 1], edges[:, 0]))
    edges, is_join = edges[by_nodes], is_join[by_nodes]
    centre = areas @ centroids / areas.sum()
    root = int(np.argmin(np.linalg.norm(centroids[order] - centre, axis=1)))
    graph = Skeleton.assembled(
        centroids[order], areas[order], ring_areas[order], band[order], edges.astype(np.int32), root, is_join
    )
    return graph, _Pieces(u, first, offset, rank[component])


def _pieces_at(
    mesh: Mesh, links: Links, u: Array, first: npt.NDArray[np.int32], offset: npt.NDArray[np.int64]
) -> npt.NDArray[np.int64]:
    """The pieces that hold the two points of each link, (l, 2)."""
    at = np.einsum("lsi,lsi->ls", links.weights, u[mesh.faces[links.faces]])
    last = np.diff(offset)[links.faces] - 1
    return np.asarray(offset[links.faces] + np.clip(np.floor(at).astype(np.int64) - first[links.faces], 0, last))


def _joined(
    component: npt.NDArray[np.int64], band: npt.NDArray[np.int32], adjacent: npt.NDArray[np.int64],
    ends: npt.NDArray[np.int64], links: Links,
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32], npt.NDArray[np.int64], npt.NDArray[np.int64]]:  # fmt: skip
    """Components, their bands and neighbours when parts are joined at links, whose components are ``ends``, (l, 2);
    and the edges that connect what is still apart."""
    from reebase.mesh.topology_kernels import label

    steps = np.abs(band[ends[:, 0]] - band[ends[:, 1]])
    same = ends[(steps == 0) & links.touch].astype(np.int32)
    count, merged = label(same[:, 0], same[:, 1], len(band))
    band_of = np.empty(count, np.int32)
    band_of[merged] = band
    adjacent, ends = merged[adjacent].astype(np.int64), merged[ends].astype(np.int64)
    of_graph = label(adjacent[:, 0].astype(np.int32), adjacent[:, 1].astype(np.int32), count)[1]
    needed = []
    for link in np.lexsort((links.gaps, steps)):
        a, b = of_graph[ends[link]]
        if a != b:
            of_graph[of_graph == b] = a
            needed.append(ends[link])
    return merged[component].astype(np.int64), band_of, adjacent, np.array(needed, np.int64).reshape(-1, 2)


def _unique_edges(
    adjacent: npt.NDArray[np.int64], across: npt.NDArray[np.int64], count: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """Every edge once, (E, 2), and whether it is one of those across a gap."""
    keys = np.unique(adjacent @ (count, 1))
    every = np.concatenate([keys, across @ (count, 1)])
    return np.stack(np.divmod(every, count), axis=1), np.arange(len(every)) >= len(keys)


def _below(faces: npt.NDArray[np.int32], pieces: _Pieces) -> npt.NDArray[np.int32]:
    """The node of the piece just below each vertex: of one of its faces there, or else of the lowest of the faces."""
    wanted = np.maximum(np.ceil(pieces.u[faces]) - 1, 0).astype(np.int64)
    lowest = pieces.first[:, None].astype(np.int64)
    met = np.minimum(wanted, lowest + np.diff(pieces.offset)[:, None] - 1)
    found = np.full(len(pieces.u), -1, np.int32)
    for corners in (met < lowest, met >= lowest):  # what is said last holds
        piece = pieces.offset[:-1, None] + np.maximum(met - lowest, 0)
        found[faces[corners]] = pieces.node[piece[corners]]
    return found


MAX_PIECES = 40_000_000
"""A piece takes about 25 bytes while the graph is made. A smooth field cuts a face about once; only noise as large as
the whole shape comes near this."""

MIN_AREA = 1e-190
"""Pieces without area count 1e-200 each, so that even their centroids are defined; that is no area."""


def _in_bands(values: Array, bands: int) -> Array:
    """The field in units of the band width from 0 to ``bands``, snapped to the levels; 1/2 if it is constant.

    Measured from the middle of the range, so that f and -f mirror each other to the last bit.
    """
    if _is_constant(values):
        return np.full(len(values), 0.5)
    low, high = float(values.min()), float(values.max())
    middle, half = low / 2 + high / 2, high / 2 - low / 2
    u = np.clip((values - middle) / half * (bands / 2) + bands / 2, 0.0, bands)
    level = np.rint(u)
    return np.where(np.abs(u - level) < ON_LEVEL, level, u)


def _is_constant(values: Array) -> bool:
    low, high = float(values.min()), float(values.max())
    return high / 2 - low / 2 <= CONSTANT * max(-low, high)


def _extremal_rings(
    band: npt.NDArray[np.int32], edges: npt.NDArray[np.int64], extremes: Array, rings: Array
) -> Array:
    """Ring area of each component's extremal vertex; ``extremes`` count from the middle of the range."""
    above = np.bincount(edges[:, 0], minlength=len(band)) > 0
    below = np.bincount(edges[:, 1], minlength=len(band)) > 0
    outside = np.sign(np.abs(extremes[:, 1]) - np.abs(extremes[:, 0]))
    side = np.where(above == below, outside, np.where(below, 1.0, -1.0))
    return np.where(side == 0.0, rings.max(axis=1), np.where(side > 0.0, rings[:, 1], rings[:, 0]))
