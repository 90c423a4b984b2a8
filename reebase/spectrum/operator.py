"""The Laplace-Beltrami operator of a triangle mesh as two matrices: stiffness C and mass R.

Cotangent weights (thesis (4.11)-(4.12)) discretise the Dirichlet energy with piecewise-linear functions;
mixed Voronoi cells (Meyer, Desbrun, Schroeder, Barr 2003, section 3.3) share the area out among the vertices.
Where the mesh has edges with three or more faces, or triangles so thin that their cotangents are noise,
the weights are those of the intrinsic Delaunay triangulation of the tufted cover (Sharp and Crane,
"A Laplacian for Nonmanifold Triangle Meshes", 2020) instead.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from reebase.errors import ComputationError, DegenerateMesh, MissingPackage, NoFaces, unknown_name
from reebase.mesh.mesh import Mesh
from reebase.mesh.parts import Links

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

__all__ = ["KINDS", "Operator", "linked", "mixed_voronoi", "operator", "stiffness"]

KINDS = ("auto", "cotangent", "tufted")
"""What ``operator`` can be asked for; what it built is ``Operator.kind``."""

THIN = 1e-4
"""A triangle is badly shaped when its height over its longest edge is below this share of that edge: its
largest cotangent is then above 5,000, and piecewise-linear functions no longer see the surface across it."""

FLAT = 1e-12
"""Heights below this share of the longest edge are rounding noise; they count as this share, so that
weights stay finite."""

CROWD = 2000
"""Most faces at an edge for which "auto" takes the tufted cover, whose time grows with their square: with 2,000 a tenth
of a second, with 50,000 most of a minute. The cotangent weights are right there too."""


@dataclass(frozen=True, eq=False)
class Operator:
    """C phi = lambda R phi (4.13), in the units of the mesh.

    C: stiffness, symmetric, positive semi-definite, rows sum to 0, float64 CSR, (m, m); without unit.
    mass: diagonal of R, float64, (m,), non-negative, sums to the area of the mesh; squared units of the mesh.
    kind: "cotangent" or "tufted", what C was built from. R is the mixed Voronoi area of the given mesh for
    both, so that node areas, masses and area(M) agree whatever C is.
    mesh: what it is the operator of; with its geometry ``eigenpairs`` is several times faster.
    """

    C: csr_matrix
    mass: npt.NDArray[np.float64]
    kind: str
    mesh: Mesh | None = None

    @property
    def area(self) -> float:
        """Area of the mesh, the sum of the masses."""
        return float(self.mass.sum())

    def __repr__(self) -> str:
        return f"Operator({self.kind}, {len(self.mass)} vertices)"


def operator(mesh: Mesh, kind: str = "auto") -> Operator:
    """Stiffness and mass of a mesh.

    kind: "cotangent" (4.12); "tufted", robust on any triangle soup; or "auto", which is cotangent unless an
    edge has more than two faces or a triangle is badly shaped (height below ``THIN`` of its longest edge), and again
    where an edge has more than ``CROWD`` faces.
    Raises UnknownName, NoFaces, DegenerateMesh (no area at all), MissingPackage when the tufted cover is
    needed and robust-laplacian is not installed, ComputationError when it fails.
    """
    if kind not in KINDS:
        raise unknown_name("operator", kind, KINDS)
    C, mass, bad, crowd = _assembled(mesh)
    area = float(mass.sum())
    if not 0.0 < area < np.inf:
        raise DegenerateMesh(
            f"The area of the mesh comes to {area}, so it has no Laplace-Beltrami operator.", area=str(area)
        )
    if kind == "auto":
        kind = "tufted" if (bad or crowd > 2) and crowd <= CROWD else "cotangent"
    return Operator(C if kind == "cotangent" else _tufted_stiffness(mesh), mass, kind, mesh)


def linked(base: Operator, mesh: Mesh, links: Links) -> Operator:
    """The operator of a mesh in several parts when these are joined at links. base: as ``operator(mesh)`` gives it.

    Each link adds w (phi(p) - phi(q))^2 to the Dirichlet energy, w = s / (gap + s / ``FIRM``) with the spacing s: that
    of a strip as wide as the spacing and as long as the gap, which holds the two together where they touch. So lambda_2
    is above 0, and phi_2 goes on from part to part. C stays symmetric, positive semi-definite, its rows sum to 0.
    """
    from scipy.sparse import csr_matrix

    count = len(links.gaps)
    rows, starts = np.repeat(np.arange(count), 6), 6 * np.arange(count + 1)
    signed = (links.weights * np.array([1.0, -1.0])[:, None]).ravel()
    differences = csr_matrix((signed, mesh.faces[links.faces].ravel(), starts), shape=(count, len(base.mass)))
    widths = links.spacing / (links.gaps + links.spacing / FIRM)
    weighted = csr_matrix((signed * widths[rows], differences.indices, differences.indptr), shape=differences.shape)
    springs = differences.T @ weighted
    C = csr_matrix(base.C + (springs + springs.T) * 0.5)
    C.sort_indices()
    return Operator(C, base.mass, base.kind, mesh)


FIRM = 10.0
"""Weight of a link whose points coincide; cotangent weights are about 1. From 10 to 3,000 skeletons stay the same."""


def stiffness(mesh: Mesh) -> csr_matrix:
    """Cotangent stiffness C (4.11)-(4.12), CSR, (m, m): symmetric, positive semi-definite, rows sum to 0.

    C_ij = -(cot alpha_ij + cot beta_ij) / 2 for an edge with the opposite angles alpha and beta (one term on
    a boundary, which makes the boundary free: Neumann), C_ii = -sum_j C_ij.
    Edges with more faces get one term per face. The weights of a triangle are those of its Gram matrix over
    four times its area, which stays positive semi-definite whatever the area is held to be.
    Raises NoFaces.
    """
    return _assembled(mesh)[0]


def mixed_voronoi(mesh: Mesh) -> npt.NDArray[np.float64]:
    """Mixed Voronoi area of each vertex (Meyer et al. 2003), float64, (m,), summing to the area of the mesh.

    A triangle without obtuse angle is split by its circumcentre: (|e_j|^2 cot_j + |e_k|^2 cot_k) / 8 to
    corner i; one with an obtuse angle gives half of its area to that corner and a quarter to each other.
    Raises NoFaces.
    """
    return _assembled(mesh)[1]


def _assembled(mesh: Mesh) -> tuple[csr_matrix, npt.NDArray[np.float64], int, int]:
    """C, R, how many triangles are badly shaped, and the most faces at an edge."""
    if not len(mesh.faces):
        raise NoFaces("The mesh has no faces, so it has no surface to build an operator on.")
    from scipy.sparse import csr_matrix

    from reebase.spectrum.operator_kernels import assemble

    m = len(mesh.vertices)
    pointers, indices, values, mass, bad, crowd = assemble(mesh.vertices, mesh.faces, FLAT, THIN)
    C = csr_matrix((values, indices, pointers), shape=(m, m))
    C.has_sorted_indices = C.has_canonical_format = True
    return C, mass, bad, crowd


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
