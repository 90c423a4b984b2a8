"""Cleaning: what every mesh goes through before any mathematics, and the report on it.

What is done, in this order; each step is counted in ``Health.repairs`` when it did something:

- ``removed_unreferenced_vertices``: vertices that no face uses, whatever their coordinates. A file whose
  only NaN stand in such vertices is therefore accepted.
- ``merged_vertices``: vertices at the same place become the first of them (STL has three for each face).
- ``removed_degenerate_faces``: faces with a corner twice, or without area to within the rounding of
  coordinates.
- ``removed_duplicate_faces``: a face on the same three vertices as an earlier one, whichever way it turns.
- ``removed_fin_faces``: two faces back to back that stick out of a surface, too small to matter
  (duplicates.py).
- ``collapsed_edges``, ``flipped_edges``: how faces without area were removed without tearing the surface
  open.
- ``sewn_vertices``: vertices of the boundary that are apart by no more than the rounding of single precision
  become one where that closes a gap (seams.py).
- ``reoriented_faces``: faces turned over, so that neighbours agree and closed components face outward.

Vertices and faces that stay keep their order. Components are kept. Non-manifold edges and vertices are
counted and not split: the operator has its own cover for such edges, bands of a Reeb graph join through
edges alone, and coordinates at one place stay one vertex, so that what is shown is what was sent.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.errors import DegenerateMesh, MeshError, NoFaces, ParameterError
from reebase.mesh.duplicates import without_duplicates
from reebase.mesh.health import Health
from reebase.mesh.mesh import Mesh
from reebase.mesh.orient import faces_to_turn
from reebase.mesh.seams import NEAR, without_seams
from reebase.mesh.slivers import without_flat_faces
from reebase.mesh.topology import Edges, edges
from reebase.words import counted

__all__ = ["clean"]

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]

SMALLEST, LARGEST = 1e-65, 1e65
"""Half extents between which areas and volumes, and their squares, are ordinary numbers, those of faces a
millionth as long as well."""


def clean(mesh: Mesh, *, merge_tolerance: float = 0.0) -> tuple[Mesh, Health]:
    """A mesh without duplicates and degenerate faces, consistently oriented, and the report on it.

    merge_tolerance: vertices within this share of the bounding box's diagonal are merged, too, into the
    first of them that was kept; in [0, 0.1], 0 merges equal coordinates only. No vertex moves farther than
    that. Raises NoFaces, DegenerateMesh when no triangle with area is left, MeshError for an extent that
    floating point cannot square, ParameterError.
    """
    if not (merge_tolerance == 0 or 1e-15 <= merge_tolerance <= 0.1):
        raise ParameterError(
            "merge_tolerance is a share of the bounding box's diagonal, 0 or in [1e-15, 0.1]; "
            f"found {merge_tolerance}.",
            parameter="merge_tolerance", found=merge_tolerance,
        )  # fmt: skip
    if len(mesh.faces) == 0:
        raise NoFaces
    repairs: dict[str, int] = {}
    # A copy: kernels are compiled anew for arrays that are read-only.
    vertices, faces = without_unreferenced(mesh.vertices, mesh.faces.copy(), repairs)
    centre, scale = frame(vertices)
    # Coordinates far from the origin carry rounding of their own size, which the unit frame magnifies.
    rounding = float(np.finfo(np.float64).eps) * max(1.0, float(np.abs(vertices).max()) / scale)

    vertices, faces = merged(vertices, (vertices - centre) / scale, faces, merge_tolerance, repairs)
    unit = (vertices - centre) / scale
    faces = without_repeated_corners(faces, repairs)
    faces = without_duplicates(unit, faces, repairs)
    with_area = without_flat_faces(unit, faces, 8 * rounding, repairs)
    faces = with_area if with_area is faces else without_duplicates(unit, with_area, repairs)
    if len(faces) == 0:
        done = ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in repairs.items())
        raise DegenerateMesh(
            f"No triangle with area is left of {counted(len(mesh.faces), 'face')} ({done}).",
            faces_read=len(mesh.faces), repairs=repairs,
        )  # fmt: skip
    vertices, faces = without_unreferenced(vertices, faces, repairs)
    unit = (vertices - centre) / scale

    joined = edges(faces)
    if len(joined.boundary):
        # Far from the origin single precision is coarser than the unit frame shows, up to a point.
        near = NEAR * min(max(1.0, float(np.abs(vertices).max()) / scale), 100.0)
        sewn = without_seams(unit, joined, near, repairs)
        if sewn is not joined.faces:
            vertices, faces = without_unreferenced(vertices, without_duplicates(unit, sewn, repairs), {})
            unit = (vertices - centre) / scale
            joined = edges(faces)
    turn = faces_to_turn(unit, joined)
    if turn.any():
        note(repairs, "reoriented_faces", int(turn.sum()))
        joined = edges(np.where(turn[:, None], faces[:, ::-1], faces))
    read = (len(mesh.vertices), len(mesh.faces))
    return Mesh(vertices, joined.faces), report(unit, joined, scale, read, repairs)


def note(repairs: dict[str, int], name: str, count: int) -> None:
    """Count a repair that did something."""
    if count:
        repairs[name] = repairs.get(name, 0) + count


def frame(vertices: FloatArray) -> tuple[FloatArray, float]:
    """The centre of the bounding box, (3,), and half its longest side, 1 for a single point."""
    low, high = vertices.min(axis=0) / 2, vertices.max(axis=0) / 2
    scale = float((high - low).max())
    if scale != 0 and not SMALLEST <= scale <= LARGEST:
        raise MeshError(
            f"The mesh is {2 * scale:.3g} units long; areas and volumes of that size are beyond "
            f"floating point. Rescale it to between {2 * SMALLEST:g} and {2 * LARGEST:g}.",
            extent=2 * scale,
        )  # fmt: skip
    return low + high, scale or 1.0


def without_unreferenced(
    vertices: FloatArray, faces: IntArray, repairs: dict[str, int]
) -> tuple[FloatArray, IntArray]:
    """The vertices that faces use, and the faces on them."""
    used = np.zeros(len(vertices), dtype=bool)
    used[faces.ravel()] = True
    if used.all():
        return vertices, faces
    note(repairs, "removed_unreferenced_vertices", int(len(used) - used.sum()))
    rank = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return vertices[used], rank[faces]


def merged(
    vertices: FloatArray, unit: FloatArray, faces: IntArray, tolerance: float, repairs: dict[str, int]
) -> tuple[FloatArray, IntArray]:
    """The first vertex at each place (within a share of the diagonal), and the faces on them."""
    from reebase.mesh.topology_kernels import first_within

    if tolerance == 0:
        # Adding zero turns -0.0 into 0.0: equal numbers then have equal bits.
        first = first_within(vertices + 0.0, (vertices + 0.0).view(np.int64), 0, 0.0)
    else:
        width = tolerance * float(np.linalg.norm(np.ptp(unit, axis=0)))
        cells = np.floor(unit / (width or 1.0)).astype(np.int64)
        first = first_within(unit, cells, 1, width)
    kept = first == np.arange(len(vertices))
    if kept.all():
        return vertices, faces
    note(repairs, "merged_vertices", int(len(kept) - kept.sum()))
    rank = np.cumsum(kept, dtype=np.int32) - np.int32(1)
    return vertices[kept], rank[first[faces]]


def without_repeated_corners(faces: IntArray, repairs: dict[str, int]) -> IntArray:
    """The faces with three different corners."""
    a, b, c = faces.T
    proper = (a != b) & (b != c) & (c != a)
    note(repairs, "removed_degenerate_faces", int(len(faces) - proper.sum()))
    return faces if proper.all() else faces[proper]


def report(
    unit: FloatArray, joined: Edges, scale: float, read: tuple[int, int], repairs: dict[str, int]
) -> Health:
    """The health of a cleaned mesh whose vertices are ``scale`` times ``unit``, up to a translation."""
    from reebase.mesh.topology_kernels import triangle_measures

    faces = joined.faces
    areas, _, _, volumes = triangle_measures(unit, faces, np.zeros(len(faces), dtype=np.int32)).T
    area = float(areas.sum())
    components, component = joined.components
    share = min(1.0, float(np.bincount(component, weights=areas).max()) / area)
    fan_count, fan = joined.fans
    vertex_of_fan = np.empty(fan_count, dtype=np.int32)
    vertex_of_fan[fan] = faces.ravel()
    pinched = int((np.bincount(vertex_of_fan, minlength=len(unit)) > 1).sum())
    closed = len(joined.boundary) == 0
    euler = len(unit) - len(joined) + len(faces)
    manifold = pinched == 0 and len(joined.non_manifold) == 0
    ends = unit[joined.vertices]
    lengths = np.sqrt(((ends[:, 1] - ends[:, 0]) ** 2).sum(axis=1))
    flags = {
        "several_components": components > 1,
        "open_surface": not closed,
        "non_manifold": len(joined.non_manifold) > 0 or not joined.oriented,
    }
    return Health(
        vertices_read=read[0],
        faces_read=read[1],
        vertices=len(unit),
        faces=len(faces),
        edges=len(joined),
        components=components,
        boundary_edges=len(joined.boundary),
        boundary_loops=joined.boundary_loops,
        non_manifold_edges=len(joined.non_manifold),
        non_manifold_vertices=pinched,
        euler_characteristic=euler,
        genus=components - euler // 2 if closed and manifold and joined.oriented else None,
        closed=closed,
        oriented=joined.oriented,
        area=area * scale**2,
        volume=float(volumes.sum()) * scale**3 if closed and joined.balanced.all() else None,
        mean_edge_length=float(lengths.mean()) * scale,
        largest_component_share=share,
        repairs=repairs,
        flags=tuple(sorted(name for name, present in flags.items() if present)),
    )
