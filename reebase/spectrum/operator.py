"""The Laplace-Beltrami operator of a triangle mesh as two matrices: stiffness C and mass R.

Cotangent weights (thesis (4.11)-(4.12)) discretise the Dirichlet energy with piecewise-linear functions;
mixed Voronoi cells (Meyer, Desbrun, Schroeder, Barr 2003, section 3.3) share the area out among the vertices.
Where the mesh has edges with three or more faces, or triangles so thin that their cotangents are noise,
the weights are those of the intrinsic Delaunay triangulation of the tufted cover (Sharp and Crane,
"A Laplacian for Nonmanifold Triangle Meshes", 2020) instead.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from reebase.errors import ComputationError, DegenerateMesh, MissingPackage, NoFaces, unknown_name
from reebase.mesh.mesh import Mesh

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

__all__ = [
    "KINDS", "Operator", "badly_shaped", "mixed_voronoi", "non_manifold_edges", "operator", "stiffness",
]  # fmt: skip

KINDS = ("auto", "cotangent", "tufted")
"""What ``operator`` can be asked for; what it built is ``Operator.kind``."""

THIN = 1e-4
"""A triangle is badly shaped when its height over its longest edge is below this share of that edge: its
largest cotangent is then above 5,000, and piecewise-linear functions no longer see the surface across it."""

FLAT = 1e-12
"""Heights below this share of the longest edge are rounding noise; they count as this share, so that
weights stay finite."""


@dataclass(frozen=True, eq=False)
class Operator:
    """C phi = lambda R phi (4.13), in the units of the mesh.

    C: stiffness, symmetric, positive semi-definite, rows sum to 0, float64 CSR, (m, m); without unit.
    mass: diagonal of R, float64, (m,), non-negative, sums to the area of the mesh; squared units of the mesh.
    kind: "cotangent" or "tufted", what C was built from. R is the mixed Voronoi area of the given mesh for
    both, so that node areas, masses and area(M) agree whatever C is.
    """

    C: csr_matrix
    mass: npt.NDArray[np.float64]
    kind: str

    @property
    def area(self) -> float:
        """Area of the mesh, the sum of the masses."""
        return float(self.mass.sum())

    def __repr__(self) -> str:
        return f"Operator({self.kind}, {len(self.mass)} vertices)"


def operator(mesh: Mesh, kind: str = "auto") -> Operator:
    """Stiffness and mass of a mesh.

    kind: "cotangent" (4.12); "tufted", robust on any triangle soup; or "auto", which is cotangent unless an
    edge has more than two faces or a triangle is badly shaped (height below ``THIN`` of its longest edge).
    Raises UnknownName, NoFaces, DegenerateMesh (no area at all), MissingPackage when the tufted cover is
    needed and robust-laplacian is not installed, ComputationError when it fails.
    """
    if kind not in KINDS:
        raise unknown_name("operator", kind, KINDS)
    triangles = _triangles(mesh)
    mass = _mixed_voronoi(mesh, triangles)
    area = float(mass.sum())
    if not 0.0 < area < np.inf:
        raise DegenerateMesh(
            f"The area of the mesh comes to {area}, so it has no Laplace-Beltrami operator.", area=str(area)
        )
    if kind == "auto":
        needed = _badly_shaped(triangles).any() or len(non_manifold_edges(mesh))
        kind = "tufted" if needed else "cotangent"
    C = _stiffness(mesh, triangles) if kind == "cotangent" else _tufted_stiffness(mesh)
    return Operator(C, mass, kind)


def stiffness(mesh: Mesh) -> csr_matrix:
    """Cotangent stiffness C (4.11)-(4.12), CSR, (m, m): symmetric, positive semi-definite, rows sum to 0.

    C_ij = -(cot alpha_ij + cot beta_ij) / 2 for an edge with the opposite angles alpha and beta (one term on
    a boundary, which makes the boundary free: Neumann), C_ii = -sum_j C_ij.
    Edges with more faces get one term per face. The weights of a triangle are those of its Gram matrix over
    four times its area, which stays positive semi-definite whatever the area is held to be.
    Raises NoFaces.
    """
    return _stiffness(mesh, _triangles(mesh))


def mixed_voronoi(mesh: Mesh) -> npt.NDArray[np.float64]:
    """Mixed Voronoi area of each vertex (Meyer et al. 2003), float64, (m,), summing to the area of the mesh.

    A triangle without obtuse angle is split by its circumcentre: (|e_j|^2 cot_j + |e_k|^2 cot_k) / 8 to
    corner i; one with an obtuse angle gives half of its area to that corner and a quarter to each other.
    Raises NoFaces.
    """
    return _mixed_voronoi(mesh, _triangles(mesh))


def badly_shaped(mesh: Mesh) -> npt.NDArray[np.bool_]:
    """Which triangles are nearly degenerate: height below ``THIN`` of the longest edge, bool, (n,).

    Raises NoFaces.
    """
    return _badly_shaped(_triangles(mesh))


def non_manifold_edges(mesh: Mesh) -> npt.NDArray[np.int64]:
    """Edges with more than two faces, vertex indices in increasing order, int64, (e, 2)."""
    keys, _ = _edge_keys(len(mesh.vertices), mesh.faces)
    keys.sort()
    if len(keys) < 3:
        return np.empty((0, 2), np.int64)
    crowded = np.unique(keys[2:][keys[2:] == keys[:-2]])
    return np.stack(np.divmod(crowded, len(mesh.vertices)), axis=1)


class _Triangles(NamedTuple):
    """Dot product of the two edges that leave each corner (n, 3), twice the area (n,), longest edge squared (n,).

    The cotangent at a corner is its dot product over twice the area.
    """

    gram: npt.NDArray[np.float64]
    double_area: npt.NDArray[np.float64]
    longest_squared: npt.NDArray[np.float64]


def _triangles(mesh: Mesh) -> _Triangles:
    if not len(mesh.faces):
        raise NoFaces("The mesh has no faces, so it has no surface to build an operator on.")
    corners = mesh.vertices[mesh.faces]
    edges = corners[:, (2, 0, 1)] - corners[:, (1, 2, 0)]  # edges[:, i] lies opposite corner i
    with np.errstate(over="ignore", invalid="ignore"):  # `operator` refuses an area that is not finite
        gram = -np.einsum("nij,nij->ni", edges[:, (1, 2, 0)], edges[:, (2, 0, 1)])
        squared = np.einsum("nij,nij->ni", edges, edges)
        # The cross product of the two shortest edges is the least cancelled one.
        first = (np.argmax(squared, axis=1) + 1) % 3
        row = np.arange(len(edges))
        double_area = np.linalg.norm(np.cross(edges[row, first], edges[row, (first + 1) % 3]), axis=1)
    return _Triangles(gram, double_area, squared.max(axis=1))


def _stiffness(mesh: Mesh, triangles: _Triangles) -> csr_matrix:
    floor = np.maximum(FLAT * triangles.longest_squared, np.finfo(np.float64).tiny)
    weights = 0.5 * triangles.gram / np.maximum(triangles.double_area, floor)[:, None]
    return _laplacian(len(mesh.vertices), mesh.faces, weights)


def _mixed_voronoi(mesh: Mesh, triangles: _Triangles) -> npt.NDArray[np.float64]:
    gram, double_area, _ = triangles
    # |e_j|^2 = gram_k + gram_i and so on: the products at its two ends sum to the squared length of an edge.
    squared = gram[:, (1, 2, 0)] + gram[:, (2, 0, 1)]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        shares = squared * gram
        voronoi = (shares[:, (1, 2, 0)] + shares[:, (2, 0, 1)]) / (8.0 * double_area)[:, None]
    mixed = np.where(gram < 0.0, 0.25, 0.125) * double_area[:, None]
    cells = np.where(gram.min(axis=1, keepdims=True) < 0.0, mixed, voronoi)
    cells[double_area == 0.0] = 0.0
    summed = np.bincount(mesh.faces.ravel(), cells.ravel(), minlength=len(mesh.vertices))
    return np.asarray(summed, dtype=np.float64)


def _badly_shaped(triangles: _Triangles) -> npt.NDArray[np.bool_]:
    return np.asarray(triangles.double_area <= THIN * triangles.longest_squared)


def _edge_keys(
    m: int, faces: npt.NDArray[np.int32]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """smaller * m + larger vertex of the edge opposite each corner, (3n,), and which edges are loops."""
    start, end = faces[:, (1, 2, 0)].ravel().astype(np.int64), faces[:, (2, 0, 1)].ravel().astype(np.int64)
    return np.minimum(start, end) * m + np.maximum(start, end), start == end


def _laplacian(m: int, faces: npt.NDArray[np.int32], weights: npt.NDArray[np.float64]) -> csr_matrix:
    """CSR Laplacian from the weight of the edge opposite each corner, (n, 3); weights of one edge add up."""
    from scipy.sparse import csr_matrix, diags_array

    keys, loop = _edge_keys(m, faces)
    keys, values = keys[~loop], weights.ravel()[~loop]
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    starts = np.flatnonzero(np.diff(keys, prepend=-1))
    edges = keys[starts]
    summed = np.add.reduceat(values[order], starts) if len(starts) else np.empty(0)
    pointers = np.searchsorted(edges, np.arange(m + 1, dtype=np.int64) * m)
    upper = csr_matrix((-summed, (edges % m).astype(np.int32), pointers.astype(np.int32)), shape=(m, m))
    # The transpose of one half makes C symmetric to the last bit, which sums in file order would not.
    off_diagonal = csr_matrix(upper + upper.T)
    degree = np.asarray(off_diagonal.sum(axis=1)).ravel()
    C = csr_matrix(off_diagonal + diags_array(-degree))
    C.sort_indices()
    return C


def _tufted_stiffness(mesh: Mesh) -> csr_matrix:
    try:
        import robust_laplacian
    except ImportError:
        raise MissingPackage(
            "This mesh has edges with more than two faces or nearly degenerate triangles; its operator needs "
            "the package robust-laplacian: pip install 'reebase[robust]'.",
            package="robust-laplacian", extra="robust",
        ) from None  # fmt: skip
    from scipy.sparse import csr_matrix

    try:
        C = csr_matrix(robust_laplacian.mesh_laplacian(mesh.vertices, mesh.faces)[0])
    except RuntimeError as error:
        raise ComputationError(f"The tufted cover of the mesh could not be built: {error}") from error
    if not np.isfinite(C.data).all():
        raise ComputationError("The tufted cover of the mesh has weights that are not finite.")
    C = csr_matrix((C + C.T) * 0.5)
    C.sort_indices()
    return C
