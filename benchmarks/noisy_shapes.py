"""The project's own noisy meshes with their truths: what denoising is measured on where no scans are at hand.

Three kinds: ``cad`` (extruded profiles and polyhedra, straight, twisted or bent, with vertices along every edge),
``organic`` (posed figures and lobes) and ``scan`` (the same with relief down to the length of an edge, one open). Noise
is Gaussian along the normals, in all directions, or in impulses. All of it follows from seeds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from lobes import five_lobes
from scipy.spatial import ConvexHull, Delaunay

from reebase.denoise import add_noise
from reebase.evaluation.synthetic import synthetic_shape
from reebase.mesh.geometry import mean_edge_length, vertex_normals
from reebase.mesh.mesh import Mesh

Profile = np.ndarray
Warp = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Pair:
    """A noisy mesh and its truth. kind: of the shape."""

    name: str
    shape: str
    kind: str
    noisy: Mesh
    truth: Mesh


def noisy_pairs(strengths: tuple[float, ...] = (0.1, 0.2, 0.3)) -> Iterator[Pair]:
    """Every shape at every strength, in mean edge lengths along normals, and once with another kind of noise."""
    for number, (shape, (kind, make)) in enumerate(SHAPES.items()):
        truth = make()
        for strength in strengths:
            yield Pair(f"{shape} {strength:g}", shape, kind, add_noise(truth, strength, seed=number), truth)
        if number % 3 == 0:
            noisy = impulses(truth, 0.2, 0.7, seed=number)
            yield Pair(f"{shape} impulses", shape, kind, noisy, truth)
        elif number % 3 == 1:
            noisy = add_noise(truth, 0.15, "isotropic", seed=number)
            yield Pair(f"{shape} isotropic", shape, kind, noisy, truth)
        else:
            yield Pair(f"{shape} 0.5", shape, kind, add_noise(truth, 0.5, seed=number), truth)


def impulses(mesh: Mesh, share: float, strength: float, seed: int) -> Mesh:
    """Noise along the normals on a share of the vertices alone."""
    random = np.random.default_rng(seed)
    draws = random.standard_normal(len(mesh.vertices)) * (random.random(len(mesh.vertices)) < share)
    moved = strength * mean_edge_length(mesh) * draws[:, None] * vertex_normals(mesh)
    return Mesh(mesh.vertices + moved, mesh.faces)


def profile(corners: np.ndarray, spacing: float) -> Profile:
    """Points along a closed polygon, its corners among them, about ``spacing`` apart, (k, 2)."""
    found = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = max(1, round(float(np.linalg.norm(end - start)) / spacing))
        found.append(start + np.arange(count)[:, None] / count * (end - start))
    return np.concatenate(found)


def inside(points: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """Whether each point lies in the polygon: by the crossings of a ray."""
    x, y = points[:, None, 0], points[:, None, 1]
    start, end = polygon, np.roll(polygon, -1, axis=0)
    across = (start[:, 1] > y) != (end[:, 1] > y)
    slope = (end[:, 0] - start[:, 0]) / np.where(start[:, 1] == end[:, 1], 1.0, end[:, 1] - start[:, 1])
    return (across & (x < start[:, 0] + slope * (y - start[:, 1]))).sum(axis=1) % 2 == 1


def extruded(corners: np.ndarray, height: float, spacing: float, seed: int, warp: Warp | None = None) -> Mesh:
    """A closed prism over a polygon: Delaunay caps over a jittered grid, and walls, then warped."""
    random = np.random.default_rng(seed)
    rim = profile(corners, spacing)
    low, high = rim.min(axis=0), rim.max(axis=0)
    across, up = np.arange(low[0], high[0], spacing), np.arange(low[1], high[1], spacing * 0.87)
    grid = np.stack(np.meshgrid(across, up, indexing="ij"), axis=-1)
    grid[:, 1::2, 0] += spacing / 2
    grid = grid.reshape(-1, 2) + random.uniform(-0.2, 0.2, (len(across) * len(up), 2)) * spacing
    near = np.linalg.norm(grid[:, None] - rim, axis=2).min(axis=1)
    flat = np.concatenate([rim, grid[inside(grid, rim) & (near > 0.65 * spacing)]])
    faces = Delaunay(flat).simplices
    faces = faces[inside(flat[faces].mean(axis=1), rim)]
    a, b, c = flat[faces].transpose(1, 0, 2)
    turned = np.cross(b - a, c - a) < 0
    faces[turned] = faces[turned][:, ::-1]
    levels = max(2, round(height / spacing))
    k, m = len(rim), len(flat)
    bottom, top = np.c_[flat, np.zeros(m)], np.c_[flat, np.full(m, height)]
    between = np.repeat(np.arange(1, levels) * height / levels, k) + random.uniform(-0.2, 0.2, k * (levels - 1)) * (
        height / levels
    )
    walls = np.c_[np.tile(rim, (levels - 1, 1)), between]
    vertices = np.concatenate([bottom, top, walls])
    rows = np.concatenate([[np.arange(k)], 2 * m + np.arange(k * (levels - 1)).reshape(-1, k), [m + np.arange(k)]])
    here, there = rows[:, :, None], np.roll(rows, -1, axis=1)[:, :, None]
    one = np.concatenate([here[:-1], there[:-1], there[1:]], axis=2)
    other = np.concatenate([here[:-1], there[1:], here[1:]], axis=2)
    walled = np.concatenate([one.reshape(-1, 3), other.reshape(-1, 3)])
    mesh = np.concatenate([faces[:, ::-1], faces + m, walled])
    return Mesh(vertices if warp is None else warp(vertices), mesh)


def polyhedron(points: int, splits: int, seed: int) -> Mesh:
    """The hull of random points on a sphere, every side of its faces cut into so many."""
    drawn = np.random.default_rng(seed).standard_normal((points, 3))
    drawn /= np.linalg.norm(drawn, axis=1)[:, None]
    faces = ConvexHull(drawn).simplices
    a, b, c = drawn[faces].transpose(1, 0, 2)
    turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - drawn.mean(axis=0)) < 0
    faces[turned] = faces[turned][:, ::-1]
    i, j = (side.ravel() for side in np.meshgrid(np.arange(splits + 1), np.arange(splits + 1), indexing="ij"))
    i, j = i[i + j <= splits], j[i + j <= splits]
    place = np.full((splits + 2, splits + 2), -1)
    place[i, j] = np.arange(len(i))
    low = i + j < splits
    small = np.stack([place[i[low], j[low]], place[i[low] + 1, j[low]], place[i[low], j[low] + 1]], axis=1)
    low = i + j < splits - 1
    more = np.stack([place[i[low] + 1, j[low]], place[i[low] + 1, j[low] + 1], place[i[low], j[low] + 1]], axis=1)
    weights = np.stack([splits - i - j, i, j], axis=1) / splits
    vertices = np.einsum("kc,fcx->fkx", weights, drawn[faces]).reshape(-1, 3)
    pattern = np.concatenate([small, more])
    found = (pattern[None] + len(i) * np.arange(len(faces))[:, None, None]).reshape(-1, 3)
    _, first, back = np.unique(vertices.round(9), axis=0, return_index=True, return_inverse=True)
    return Mesh(vertices[first], back.ravel()[found])


def relief(mesh: Mesh, amplitude: float, shortest: float, seed: int) -> Mesh:
    """Waves in random directions along the normals, octave by octave down to ``shortest`` mean edge lengths."""
    random = np.random.default_rng(seed)
    points = mesh.vertices / mean_edge_length(mesh)
    heights, length = np.zeros(len(points)), 24.0
    while length >= shortest:
        for _ in range(6):
            direction = random.standard_normal(3)
            direction *= 2 * np.pi / length / np.linalg.norm(direction)
            heights += amplitude * (length / 24.0) ** 0.9 * np.sin(points @ direction + random.uniform(0, 2 * np.pi))
        length /= 2
    return Mesh((points + heights[:, None] * vertex_normals(mesh)) * mean_edge_length(mesh), mesh.faces)


def terrain(seed: int) -> Mesh:
    """An open patch with relief."""
    x, y = np.meshgrid(np.arange(72.0), np.arange(64.0), indexing="ij")
    random = np.random.default_rng(seed)
    flat = np.stack([x + 0.5 * (y % 2), 0.87 * y, 0 * x], axis=-1)
    flat[1:-1, 1:-1, :2] += random.uniform(-0.15, 0.15, flat[1:-1, 1:-1, :2].shape)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([a, c, d], axis=-1).reshape(-1, 3)])
    return relief(Mesh(flat.reshape(-1, 3), faces), 0.4, 4.0, seed)


def around(radii: np.ndarray) -> np.ndarray:
    """Corners at these radii, evenly round the origin, (k, 2)."""
    turn = 2 * np.pi * np.arange(len(radii)) / len(radii)
    return radii[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def twisted(angle: float) -> Warp:
    def warp(points: np.ndarray) -> np.ndarray:
        turn = angle * points[:, 2]
        x, y, z = points.T
        return np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, z], axis=1)

    return warp


def bent(radius: float) -> Warp:
    def warp(points: np.ndarray) -> np.ndarray:
        turn, out = points[:, 2] / radius, radius + points[:, 0]
        return np.stack([out * np.cos(turn), points[:, 1], out * np.sin(turn)], axis=1)

    return warp


ELL = np.array([[0, 0], [2, 0], [2, 0.7], [0.7, 0.7], [0.7, 2], [0, 2.0]])
TEE = np.array([[0.8, 0], [1.4, 0], [1.4, 1.3], [2.2, 1.3], [2.2, 1.9], [0, 1.9], [0, 1.3], [0.8, 1.3]])
WEDGE = np.array([[0, 0], [2.2, 0], [1.5, 1.2], [0.5, 1.5]])
PLUS = 0.4 * np.array(
    [[1, 0], [2, 0], [2, 1], [3, 1], [3, 2], [2, 2], [2, 3], [1, 3], [1, 2], [0, 2], [0, 1], [1, 1.0]]
)
STAR = around(np.tile([1.2, 0.65], 5))
DISC = around(np.ones(90))

SHAPES: dict[str, tuple[str, Callable[[], Mesh]]] = {
    "ell": ("cad", lambda: extruded(ELL, 1.2, 0.055, 1)),
    "tee": ("cad", lambda: extruded(TEE, 1.0, 0.06, 2, bent(2.0))),
    "wedge": ("cad", lambda: extruded(WEDGE, 1.2, 0.06, 3, twisted(0.6))),
    "plus": ("cad", lambda: extruded(PLUS, 1.0, 0.05, 4)),
    "star": ("cad", lambda: extruded(STAR, 1.2, 0.055, 5, twisted(0.5))),
    "disc": ("cad", lambda: extruded(DISC, 0.8, 0.05, 6)),
    "rock": ("cad", lambda: polyhedron(14, 12, 7)),
    "gem": ("cad", lambda: polyhedron(40, 7, 8)),
    "lobes": ("organic", lambda: five_lobes(5000, 9)),
    **{
        label: ("organic", lambda label=label: synthetic_shape(label, 0, vertices=5000).mesh)
        for label in ("hands", "humans", "octopuses", "teddy-bears", "crabs")
    },
    "bark": ("scan", lambda: relief(five_lobes(6000, 10), 0.5, 3.0, 10)),
    "pelt": ("scan", lambda: relief(synthetic_shape("teddy-bears", 1, vertices=6000).mesh, 0.9, 4.0, 11)),
    "fur": ("scan", lambda: relief(five_lobes(8000, 12), 0.9, 2.2, 12)),
    "hide": ("scan", lambda: relief(synthetic_shape("humans", 1, vertices=6000).mesh, 0.7, 6.0, 13)),
    "terrain": ("scan", lambda: terrain(14)),
}
"""Kind and maker of each shape."""
