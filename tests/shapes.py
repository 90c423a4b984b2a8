"""Shapes whose geometry is known in closed form, for every test that needs a mesh.

All are oriented outward (counter-clockwise from outside) and share no vertex twice unless said.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.mesh.mesh import Mesh

__all__ = [
    "capsule", "cube", "cylinder", "flipped", "grid", "icosahedron", "icosphere", "joined", "moebius",
    "moved", "permuted", "soup", "tetrahedron", "torus", "uv_sphere", "voxels",
]  # fmt: skip

FloatArray = npt.NDArray[np.float64]


def tetrahedron() -> Mesh:
    """Regular, edge length 2√2, centred on the origin: area 8√3, volume 8/3."""
    vertices = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], dtype=float)
    return Mesh(vertices, np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]))


def cube(side: float = 1.0) -> Mesh:
    """Axis-aligned, centred on the origin, 8 vertices, 12 faces: area 6·side², volume side³."""
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float) - 0.5
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    return Mesh(side * corners, triangulated(np.array(quads)))


def icosahedron() -> Mesh:
    """Regular, circumscribed radius 1."""
    golden = (1 + np.sqrt(5)) / 2
    vertices = np.array([
        [-1, golden, 0], [1, golden, 0], [-1, -golden, 0], [1, -golden, 0],
        [0, -1, golden], [0, 1, golden], [0, -1, -golden], [0, 1, -golden],
        [golden, 0, -1], [golden, 0, 1], [-golden, 0, -1], [-golden, 0, 1],
    ])  # fmt: skip
    faces = [
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4],
        [11, 10, 2], [10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8],
        [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
    ]  # fmt: skip
    return Mesh(vertices / np.linalg.norm(vertices[0]), np.array(faces))


def icosphere(subdivisions: int = 3, radius: float = 1.0) -> Mesh:
    """An icosahedron, its faces quartered and pushed to the sphere: 10·4^s + 2 vertices, 20·4^s faces."""
    mesh = icosahedron()
    vertices, faces = mesh.vertices, mesh.faces.astype(np.int64)
    for _ in range(subdivisions):
        sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
        unique, inverse = np.unique(sides, axis=0, return_inverse=True)
        middle = vertices[unique].sum(axis=1)
        ab, bc, ca = inverse.reshape(3, -1) + len(vertices)
        a, b, c = faces.T
        vertices = np.concatenate([vertices, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        faces = np.concatenate([
            np.stack(corners, axis=1) for corners in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))
        ])  # fmt: skip
    return Mesh(radius * vertices, faces)


def uv_sphere(nu: int = 32, nv: int = 16, radius: float = 1.0) -> Mesh:
    """``nu`` meridians, ``nv`` bands of latitude, poles on the z axis: nu·(nv−1) + 2 vertices."""
    latitude = np.pi * np.arange(1, nv) / nv
    return of_revolution(radius * np.sin(latitude), radius * np.cos(latitude), radius, -radius, nu)


def capsule(length: float = 4.0, radius: float = 0.5, nu: int = 24, nv: int = 8, along: int = 32) -> Mesh:
    """A cylinder of ``length`` on the z axis, closed by two half spheres: genus 0, two ends."""
    cap = 0.5 * np.pi * np.arange(1, nv + 1) / nv
    side = np.linspace(length / 2, -length / 2, along + 1)[1:-1]
    radii = np.concatenate([np.sin(cap), np.ones(len(side)), np.sin(cap[::-1])]) * radius
    heights = np.concatenate([
        length / 2 + radius * np.cos(cap), side, -length / 2 - radius * np.cos(cap[::-1]),
    ])  # fmt: skip
    return of_revolution(radii, heights, length / 2 + radius, -length / 2 - radius, nu)


def torus(R: float = 1.0, r: float = 0.4, nu: int = 48, nv: int = 24) -> Mesh:
    """Around the z axis, ``nu`` steps round the large circle and ``nv`` round the small one: genus 1."""
    u, v = np.meshgrid(2 * np.pi * np.arange(nu) / nu, 2 * np.pi * np.arange(nv) / nv, indexing="ij")
    ring = R + r * np.cos(v)
    vertices = np.stack([ring * np.cos(u), ring * np.sin(u), r * np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij")
    return Mesh(vertices, lattice(i, j, (i + 1) % nu, (j + 1) % nv, nv))


def grid(nx: int = 10, ny: int = 10, width: float = 1.0, height: float = 1.0) -> Mesh:
    """An open rectangle in the plane z = 0, normal +z: (nx+1)·(ny+1) vertices, 2·nx·ny faces."""
    x, y = np.meshgrid(np.linspace(0, width, nx + 1), np.linspace(0, height, ny + 1), indexing="ij")
    i, j = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    vertices = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    return Mesh(vertices, lattice(i, j, i + 1, j + 1, ny + 1))


def cylinder(length: float = 2.0, radius: float = 0.5, nu: int = 24, along: int = 16) -> Mesh:
    """An open tube round the z axis: two boundary loops, Euler characteristic 0."""
    u, z = np.meshgrid(
        2 * np.pi * np.arange(nu) / nu, np.linspace(-length / 2, length / 2, along + 1), indexing="ij"
    )
    vertices = np.stack([radius * np.cos(u), radius * np.sin(u), z], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(nu), np.arange(along), indexing="ij")
    return Mesh(vertices, lattice(i, j, (i + 1) % nu, j + 1, along + 1))


def moebius(nu: int = 40, nv: int = 4, width: float = 0.6) -> Mesh:
    """A strip with one half turn: one boundary loop, Euler characteristic 0, not orientable."""
    u, t = np.meshgrid(
        2 * np.pi * np.arange(nu) / nu, np.linspace(-width / 2, width / 2, nv + 1), indexing="ij"
    )
    ring = 1 + t * np.cos(u / 2)
    vertices = np.stack([ring * np.cos(u), ring * np.sin(u), t * np.sin(u / 2)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(nu - 1), np.arange(nv), indexing="ij")
    strip = lattice(i, j, i + 1, j + 1, nv + 1)
    last = (nu - 1) * (nv + 1) + np.arange(nv)
    first = nv - np.arange(nv)
    seam = triangulated(np.stack([last, first, first - 1, last + 1], axis=1))
    return Mesh(vertices, np.concatenate([strip, seam]))


def voxels(occupied: npt.ArrayLike) -> Mesh:
    """The surface of a boolean grid (x, y, z) of unit cubes: any genus, any branches.

    Manifold as long as no two occupied cubes touch along an edge or at a corner only.
    """
    filled = np.pad(np.asarray(occupied, dtype=bool), 1)
    quads = []
    for axis in range(3):
        u, v = np.eye(3, dtype=int)[(axis + 1) % 3], np.eye(3, dtype=int)[(axis + 2) % 3]
        for step in (1, -1):
            cells = np.argwhere(filled & ~np.roll(filled, -step, axis=axis))
            corner = cells + (np.eye(3, dtype=int)[axis] if step == 1 else 0)
            turn = [corner, corner + u, corner + u + v, corner + v]
            quads.append(np.stack(turn if step == 1 else turn[::-1], axis=1))
    corners = np.concatenate(quads)
    points, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return Mesh(points - 1.0, triangulated(index.reshape(-1, 4)))


def joined(*meshes: Mesh) -> Mesh:
    """Several meshes as one, in order, sharing nothing."""
    offsets = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + offset for mesh, offset in zip(meshes, offsets, strict=False)]),
    )


def moved(mesh: Mesh, by: npt.ArrayLike = (0, 0, 0), *, scale: float = 1.0, seed: int | None = None) -> Mesh:
    """Scaled, rotated at random when a seed is given, then translated."""
    vertices = scale * mesh.vertices
    if seed is not None:
        vertices = vertices @ rotation(seed).T
    return Mesh(vertices + np.asarray(by, dtype=float), mesh.faces)


def permuted(mesh: Mesh, seed: int = 0) -> tuple[Mesh, npt.NDArray[np.int64]]:
    """Vertices, faces and corners in another order, and ``order``: new vertex -> old vertex."""
    random = np.random.default_rng(seed)
    order = random.permutation(len(mesh.vertices))
    rank = np.argsort(order)
    faces = rank[mesh.faces[random.permutation(len(mesh.faces))]]
    turn = (np.arange(3) + random.integers(0, 3, size=(len(faces), 1))) % 3
    return Mesh(mesh.vertices[order], np.take_along_axis(faces, turn, axis=1)), order


def flipped(mesh: Mesh, which: npt.ArrayLike | None = None) -> Mesh:
    """The mesh with the given faces (default: all) turned over."""
    faces = mesh.faces.copy()
    chosen = np.arange(len(faces)) if which is None else np.asarray(which)
    faces[chosen] = faces[chosen][:, ::-1]
    return Mesh(mesh.vertices, faces)


def soup(mesh: Mesh) -> Mesh:
    """Three vertices of its own for each face, as STL stores them."""
    return Mesh(mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3))


def rotation(seed: int) -> FloatArray:
    """A random rotation matrix, (3, 3)."""
    q, r = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return np.asarray(q if np.linalg.det(q) > 0 else -q)


def of_revolution(radii: FloatArray, heights: FloatArray, top: float, bottom: float, nu: int) -> Mesh:
    """Rings of ``nu`` vertices from top to bottom round the z axis, closed by a pole at each end."""
    u = 2 * np.pi * np.arange(nu) / nu
    rings = np.stack(
        [radii[:, None] * np.cos(u), radii[:, None] * np.sin(u), np.repeat(heights[:, None], nu, 1)], axis=-1
    )
    vertices = np.concatenate([[[0, 0, top]], rings.reshape(-1, 3), [[0, 0, bottom]]])
    i, j = np.meshgrid(np.arange(len(radii) - 1), np.arange(nu), indexing="ij")
    body = 1 + lattice(i, j, i + 1, (j + 1) % nu, nu)
    here, after = np.arange(nu), (np.arange(nu) + 1) % nu
    first = np.stack([np.zeros(nu, dtype=int), 1 + here, 1 + after], axis=1)
    start = 1 + (len(radii) - 1) * nu
    last = np.stack([np.full(nu, len(vertices) - 1), start + after, start + here], axis=1)
    return Mesh(vertices, np.concatenate([first, body, last]))


def lattice(
    i: npt.NDArray[np.int64], j: npt.NDArray[np.int64],
    i_next: npt.NDArray[np.int64], j_next: npt.NDArray[np.int64], columns: int,
) -> npt.NDArray[np.int64]:  # fmt: skip
    """Two triangles for each cell of a lattice whose vertex (i, j) has the number i·columns + j."""
    corners = (i * columns + j, i_next * columns + j, i_next * columns + j_next, i * columns + j_next)
    return triangulated(np.stack([corner.ravel() for corner in corners], axis=1))


def triangulated(quads: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Two triangles (a, b, c), (a, c, d) for each quadrilateral."""
    return quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
