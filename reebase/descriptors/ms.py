"""``ms``: parts of the medial surface (after Siddiqi, Zhang, Macrini, Shokoufandeh, Bouix, Dickinson, "Retrieving
Articulated 3-D Models Using Medial Surfaces and Their Graph Spectra", Machine Vision and Applications 19, 2008).

The idea: the points inside a shape that have two nearest points on its surface or more form its medial surface, which
bends as the shape does, and how far the surface is from there says how thick the shape is. Cut where the thickness
changes, it falls into parts: trunk, limbs, fingers; parts that touch are joined in a graph.
Use it where shapes are solid and bend. It needs a surface that encloses something, at the resolution of its voxels:
what is thinner than two of them is as thick as two.

As in the paper the voxels of the medial surface are found by average outward flux, with thinning that keeps the
topology. Parts are cut by thickness, where the paper cuts at the junctions of sheets, which at this resolution come and
go; and the nodes of two graphs are matched by D with charges, each knowing its place in its graph, where the paper
descends both graphs by their spectra.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reebase.descriptors.surface import Surface
from reebase.descriptors.views import canonical_frames
from reebase.mesh.geometry import face_areas, lengths
from reebase.mesh.mesh import Mesh

__all__ = ["MedialParts", "describe", "medial_parts"]

Array = npt.NDArray[np.float64]

FINENESS = 64
"""Voxels to the root of the area: a ball of that area is 36 of them wide."""

MOST_VOXELS = 3_000_000
"""Of the box round a shape; larger ones, of wires, are made of larger voxels."""

FLUX = -0.3
"""Average outward flux below which a voxel belongs to the medial surface (a plane between two others has -0.4)."""

SCALE = 1.15
"""Balls that vanish in larger ones when all grow by this factor are of edges and bumps, not of parts."""

NARROWING = 0.6
"""A part ends where the shape is narrower than this share of the part's widest place."""

NECK = 0.8
"""Two wide places are two parts where all ways between them are narrower than this share of the narrower one."""

LEAST = 0.005
"""Parts of a smaller share of the volume are left out."""

CHARGE = (0.2, 3.0)
"""The charge of a part is the cube root of its share times the second, and at least the first."""


class MedialParts(NamedTuple):
    """The parts of a medial surface, in units of the root of the area, along the principal axes of the surface.

    shares: of the volume, (p,). centres: of the voxels, (p, 3). radii: mean distance to the surface, (p,).
    spreads: root mean square distance of the voxels from the centre, (p,). touch: bool, (p, p).
    """

    shares: Array
    centres: Array
    radii: Array
    spreads: Array
    touch: npt.NDArray[np.bool_]


def describe(surface: Surface) -> Array:
    """A row for each part of half a percent of the volume or more, float64, (p, 6), p >= 1; the last is its charge.

    Logarithms of radius and of length (spread and radius), the cube root of the share, the length of the way along the
    graph from the largest part, and the root of the count of parts that it touches, each over about its spread.
    """
    from scipy.sparse.csgraph import dijkstra

    parts = medial_parts(surface.body)
    largest = int(parts.shares.argmax())
    apart = np.where(parts.touch, lengths(parts.centres[:, None] - parts.centres), 0.0)
    ways = dijkstra(apart, indices=np.array([largest]))[0]
    counted = parts.shares >= LEAST
    counted[largest] = True
    root = np.cbrt(parts.shares)
    rows = np.column_stack([
        np.log(parts.radii), np.log(parts.spreads + parts.radii), 3.0 * root,
        2.0 * np.where(np.isfinite(ways), ways, 0.0), 0.3 * np.sqrt(parts.touch[:, counted].sum(axis=1)),
        np.maximum(CHARGE[1] * root, CHARGE[0]),
    ])  # fmt: skip
    return rows[counted]


def medial_parts(mesh: Mesh) -> MedialParts:
    """The medial surface of what a mesh encloses, in parts. A mesh with holes encloses what its voxels do."""
    from scipy.ndimage import distance_transform_edt

    from reebase.descriptors.ms_kernels import outward_flux, part_of, salient, thin

    solid, size = _solid(mesh)
    away, nearest = distance_transform_edt(solid, return_indices=True)
    cells = np.argwhere(solid)
    cells = cells[np.argsort(away[solid], kind="stable")]
    kept = outward_flux(cells, nearest, solid) < FLUX
    widest = np.flatnonzero(kept)[::-1]
    kept[widest] = salient(cells[widest], away[tuple(cells[widest].T)], SCALE)
    medial = solid.copy()
    thin(cells, kept, medial)
    cells = np.argwhere(medial)
    order = np.argsort(-away[medial], kind="stable")
    cells, radii = cells[order], away[medial][order]
    grid = np.full(solid.shape, -1, np.int32)
    grid[tuple(cells.T)] = np.arange(len(cells))
    _, part = np.unique(part_of(cells, radii, grid, NARROWING, NECK), return_inverse=True)
    counts = np.bincount(part)
    closest = distance_transform_edt(~medial, return_distances=False, return_indices=True)
    shares = np.bincount(part[grid[tuple(closest[:, solid])]], minlength=len(counts)) / solid.sum()
    centres = np.stack([np.bincount(part, cells[:, axis]) / counts for axis in range(3)], axis=1)
    spreads = np.sqrt(np.bincount(part, ((cells - centres[part]) ** 2).sum(axis=1)) / counts)
    touch = np.zeros((len(counts), len(counts)), dtype=bool)
    for step in np.ndindex(3, 3, 3):
        other = grid[tuple((cells + np.array(step) - 1).T)]
        touch[part[other >= 0], part[other[other >= 0]]] = True
    np.fill_diagonal(touch, False)
    # The nearest empty voxel's centre lies half a voxel beyond the surface.
    return MedialParts(
        shares, centres * size, (np.bincount(part, radii) / counts - 0.5) * size, spreads * size, touch
    )  # fmt: skip


def _solid(mesh: Mesh) -> tuple[npt.NDArray[np.bool_], float]:
    """Voxels on the surface or enclosed by it, along its principal axes, and their width over the root of the area."""
    from scipy.ndimage import binary_fill_holes

    from reebase.descriptors.ms_kernels import mark_surface

    centroid, _, (frame, _) = canonical_frames(mesh)
    areas = face_areas(mesh)
    placed = (mesh.vertices - centroid) @ frame / np.sqrt(areas.sum())
    # Towards the longer tail, so that the same shape meets the same grid.
    placed *= np.where(areas @ placed[mesh.faces].mean(axis=1) ** 3 < 0, -1.0, 1.0)
    volume = float(np.prod(np.ptp(placed, axis=0) * FINENESS + 4))
    size = max(1.0, np.cbrt(volume / MOST_VOXELS)) / FINENESS
    placed = placed / size
    low = np.floor(placed.min(axis=0)) - 2
    corners = np.ascontiguousarray((placed - low)[mesh.faces])
    sides = lengths(corners - corners[:, [1, 2, 0]]).max(axis=1)
    solid = np.zeros(np.floor(placed.max(axis=0) - low).astype(int) + 3, dtype=bool)
    # Points less than half a voxel apart leave no gap through which the inside would drain.
    mark_surface(corners, np.maximum(np.ceil(sides / 0.45), 1.0).astype(np.int64), solid)
    return np.asarray(binary_fill_holes(solid)), size
