"""Operator and eigenpairs beside LaPy, libigl, robust-laplacian and potpourri3d, from arrays to results, in one run.

    OPENBLAS_NUM_THREADS=1 ./run python benchmarks/spectrum.py [--vertices 5000 20000] [--many 20000] [FILE ...]
    OPENBLAS_NUM_THREADS=1 ./run python benchmarks/spectrum.py --convergence

Wants the packages `lapy`, `libigl`, `robust-laplacian` and `potpourri3d`, and `scikit-sparse` for what goes by CHOLMOD;
what is not installed is left out. Times are medians of milliseconds of processor time, as other work on the machine
disturbs them less than wall time; the tools take turns, every one runs on one thread, and ours is warm. The meshes
have five lobes (lobes.py), numbered along a spiral or, with --shuffled, at random; FILEs are read, cleaned, and their
largest component is taken.

Operator: C and R. The first three, and the first 50 eigenpairs (up to --many vertices), assembly included: LaPy's
Solver.eigs (lumped, splu), and scipy's eigsh on the matrices of libigl with CHOLMOD's factor, or of robust-laplacian
with splu. Ours with the default tolerance, and with that of signatures. Under them the errors of eigenvalues (relative)
and of phi_2 (norm of R) against eigsh on our operator at tolerance 0 (up to --exact vertices). Exits 1 when an
eigenvalue is off by more than 1e-8 or phi_2 by more than 1e-5.

--convergence: errors of the first 15 eigenvalues beyond 0 on finer and finer meshes of the sphere and the rectangle,
which have closed forms, and the torus, whose problem separates into ordinary differential equations, and their order.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import importlib.metadata
import io
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from lobes import five_lobes
from scipy.sparse import csc_matrix, diags_array
from scipy.sparse.linalg import LinearOperator, eigsh

from reebase.mesh.clean import clean
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read
from reebase.mesh.topology import largest_component
from reebase.spectrum import Spectrum, eigenpairs, operator


def package(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


lapy, igl, robust, pp3d = (package(name) for name in ("lapy", "igl", "robust_laplacian", "potpourri3d"))
cholmod = package("sksparse.cholmod")

BUDGET = 3.0
"""Seconds after which a tool is not repeated: what takes so long varies little."""

SIGNATURES = 1e-4
"""Tolerance of the eigenpairs that signatures are made of."""

Array = npt.NDArray[np.float64]
Tools = dict[str, Callable[[], Any]]


def medians(tools: Tools, rounds: int) -> dict[str, float]:
    """Milliseconds of processor time of each tool; they take turns."""
    taken: dict[str, list[float]] = {name: [] for name in tools}
    for _ in range(rounds):
        for name, run in tools.items():
            if sum(taken[name]) < BUDGET:
                began = time.process_time()
                with contextlib.redirect_stdout(io.StringIO()):  # LaPy prints what it does
                    run()
                taken[name].append(time.process_time() - began)
    return {name: statistics.median(times) * 1000 for name, times in taken.items()}


def with_igl(mesh: Mesh) -> tuple[Any, Any]:
    faces = mesh.faces.astype(np.int64)
    return -igl.cotmatrix(mesh.vertices, faces), igl.massmatrix(mesh.vertices, faces, igl.MASSMATRIX_TYPE_VORONOI)


def with_lapy(mesh: Mesh) -> Any:
    return lapy.Solver(lapy.TriaMesh(mesh.vertices, mesh.faces), lump=True, use_cholmod=False)


def by_cholmod(mesh: Mesh, k: int) -> Any:
    C, R = with_igl(mesh)
    factor = cholmod.cholesky(csc_matrix(0.01 * R / R.sum() + C), mode="simplicial")
    return eigsh(C, k, R, sigma=-0.01 / R.sum(), OPinv=LinearOperator(C.shape, matvec=factor, dtype=np.float64))


def by_splu(mesh: Mesh, k: int) -> Any:
    C, R = robust.mesh_laplacian(mesh.vertices, mesh.faces)
    return eigsh(C, k, R, sigma=-0.01 / R.sum())


def operators(mesh: Mesh) -> Tools:
    tools: Tools = {"ours": lambda: operator(mesh)}
    if igl:
        tools["libigl"] = lambda: with_igl(mesh)
    if lapy:
        tools["LaPy"] = lambda: with_lapy(mesh)
    if pp3d:
        tools["potpourri3d"] = lambda: (
            pp3d.cotan_laplacian(mesh.vertices, mesh.faces), pp3d.vertex_areas(mesh.vertices, mesh.faces)
        )  # fmt: skip
    if robust:
        tools["robust"] = lambda: robust.mesh_laplacian(mesh.vertices, mesh.faces)
    return tools


def solvers(mesh: Mesh, k: int) -> Tools:
    tools: Tools = {"ours": lambda: eigenpairs(operator(mesh), k)}
    if k > 4:
        tools["signatures"] = lambda: eigenpairs(operator(mesh), k, SIGNATURES)
    if lapy:
        tools["LaPy"] = lambda: with_lapy(mesh).eigs(k=k)
    if igl and cholmod:
        tools["CHOLMOD"] = lambda: by_cholmod(mesh, k)
    if robust:
        tools["robust"] = lambda: by_splu(mesh, k)
    return tools


def table(title: str, times: dict[str, float]) -> None:
    own = times["ours"]
    cells = "".join(f"  {name} {ms:.1f} ({ms / own:.1f} x)" for name, ms in times.items() if name != "ours")
    print(f"  {title:<14}ours {own:.2f} ms{cells}", flush=True)


def errors(found: Spectrum, mass: Array, values: Array, vectors: Array) -> tuple[float, float]:
    """Worst relative error of the eigenvalues beyond 0, and error of phi_2 off the space of its eigenvalue."""
    k = len(found.eigenvalues)
    same = vectors[:, np.abs(values / found.eigenvalues[1] - 1) < 1e-6]
    off = found.fiedler - same @ (same.T @ (mass * found.fiedler))
    return float(np.abs(found.eigenvalues[1:] / values[1:k] - 1).max()), float(np.sqrt(mass @ off**2))


def measure(name: str, mesh: Mesh, rounds: int, many: int, exact: int) -> bool:
    """Print the table of one mesh; whether the errors are below what is promised."""
    m = len(mesh.vertices)
    made = operator(mesh)
    print(f"{name}: {m} vertices, {made.kind}")
    table("operator", medians(operators(mesh), rounds))
    counts = [3, 50] if m <= many else [3]
    for k in counts:
        eigenpairs(made, k)
        table(f"{k} eigenpairs", medians(solvers(mesh, k), rounds))
    if m > exact:
        return True
    mass = made.mass / made.area
    values, vectors = eigsh(
        csc_matrix(made.C), counts[-1] + 6, csc_matrix(diags_array(mass)), sigma=-0.01, v0=np.ones(m)
    )
    right = True
    for k in counts:
        of_values, of_vector = errors(eigenpairs(made, k), mass, values, vectors)
        right &= of_values <= 1e-8 and of_vector <= 1e-5
        loose = errors(eigenpairs(made, k, SIGNATURES), mass, values, vectors)[0]
        print(f"  errors of {k:<4} eigenvalues {of_values:.0e}, phi_2 {of_vector:.0e}; for signatures {loose:.0e}")
    return right


def sphere(level: int) -> Mesh:
    """An octahedron, its triangles cut into four so often, on the unit sphere."""
    points = np.vstack([np.eye(3), -np.eye(3)])
    faces = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]])
    for _ in range(level):
        pairs = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        edges, of = np.unique(pairs, axis=0, return_inverse=True)
        middle = len(points) + of.reshape(-1, 3)
        points = np.vstack([points, points[edges].mean(axis=1)])
        points /= np.linalg.norm(points, axis=1, keepdims=True)
        (a, b, c), (ab, bc, ca) = faces.T, middle.T
        faces = np.vstack([np.stack(t, axis=1) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
    return Mesh(points, faces)


def sheet(n: int, m: int, *, closed: bool) -> tuple[Array, Array, npt.NDArray[np.int64]]:
    """Parameters in [0, 1] of a grid of n by m cells, and its triangles; opposite sides are one if closed."""
    i, j = np.meshgrid(np.arange(n + (not closed)), np.arange(m + (not closed)), indexing="ij")
    a, b = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    i_count, j_count = i.shape

    def at(i: npt.NDArray[np.int64], j: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        return (i % i_count) * j_count + j % j_count

    p, q, r, s = (at(a + x, b + y).ravel() for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return i.ravel() / n, j.ravel() / m, np.vstack([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)])


def rectangle(level: int) -> Mesh:
    """2 by 1.3, in right triangles."""
    u, v, faces = sheet(6 * 2**level, 4 * 2**level, closed=False)
    return Mesh(np.stack([2.0 * u, 1.3 * v, 0.0 * u], axis=1), faces)


def torus(level: int) -> Mesh:
    """Radii 1 and 0.4."""
    u, v, faces = sheet(12 * 2**level, 6 * 2**level, closed=True)
    u, v = 2 * np.pi * u, 2 * np.pi * v
    ring = 1.0 + 0.4 * np.cos(v)
    return Mesh(np.stack([ring * np.cos(u), ring * np.sin(u), 0.4 * np.sin(v)], axis=1), faces)


def of_sphere(k: int) -> Array:
    """l (l + 1), 2 l + 1 times, over the radius squared; the area is 4 pi."""
    return 4 * np.pi * np.array([l * (l + 1) for l in range(k) for _ in range(2 * l + 1)])[:k]  # noqa: E741 - the degree


def of_rectangle(k: int) -> Array:
    """Free boundary: pi^2 (i^2 / a^2 + j^2 / b^2), times the area a b."""
    i, j = np.meshgrid(np.arange(k), np.arange(k))
    return np.sort((np.pi**2 * 2.0 * 1.3 * (i**2 / 2.0**2 + j**2 / 1.3**2)).ravel())[:k]


def of_torus(k: int, nodes: int = 63) -> Array:
    """-(w f')' / (r^2 w) + n^2 f / w^2 = lambda f, w = R + r cos v, of e^(i n u) f(v), twice for n > 0; times the area.

    Trigonometric collocation at so many nodes, an odd number, exact to rounding.
    """
    at = np.arange(nodes)
    w = 1.0 + 0.4 * np.cos(2 * np.pi * at / nodes)
    apart = at[:, None] - at
    with np.errstate(divide="ignore"):
        D = np.where(apart == 0, 0.0, 0.5 * (-1.0) ** apart / np.sin(np.pi * apart / nodes))
    found: list[float] = []
    for n in range(k):
        values = np.linalg.eigvals(-(D @ (w[:, None] * D)) / (0.16 * w[:, None]) + np.diag(n**2 / w**2)).real
        found += [*values] * (2 if n else 1)
    return np.sort(np.array(found))[:k] * 4 * np.pi**2 * 0.4


def convergence(k: int = 16) -> bool:
    """Print errors and orders; whether all orders are 2 to within a tenth."""
    right = True
    for name, shape, exact, levels in (
        ("sphere", sphere, of_sphere, range(3, 7)), ("rectangle", rectangle, of_rectangle, range(2, 6)),
        ("torus", torus, of_torus, range(2, 6)),
    ):  # fmt: skip
        expected, before, points_before, order = exact(k)[1:], np.zeros(0), 0, np.zeros(0)
        print(f"{name}: lambda_2 = {expected[0]:.6f} at unit area, the first {k - 1} beyond 0")
        for level in levels:
            made = operator(shape(level))
            found = eigenpairs(made, k).eigenvalues[1:]
            m, error = len(made.mass), np.abs(found / expected - 1)
            said = ""
            if points_before:
                order = np.log(before / error) / np.log(np.sqrt(m / points_before))  # h goes with the root
                said = f"; order of each {order.min():.2f} to {order.max():.2f}"
            print(f"  {m:>7} vertices: error {error.min():.1e} to {error.max():.1e}{said}", flush=True)
            before, points_before = error, m
        right &= 1.9 < float(np.median(order)) < 2.1
    return right


def versions(*names: str) -> str:
    found = []
    for name in names:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found.append(f"{name} {importlib.metadata.version(name)}")
    return ", ".join(found)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--vertices", nargs="*", type=int, default=[5_000, 20_000, 100_000, 350_000])
    parser.add_argument("--many", type=int, default=100_000, help="50 eigenpairs up to so many vertices")
    parser.add_argument("--exact", type=int, default=20_000, help="errors up to so many vertices")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--shuffled", action="store_true", help="vertices in random order")
    parser.add_argument("--convergence", action="store_true", help="errors against closed forms instead of times")
    chosen = parser.parse_args()
    if chosen.convergence:
        return 0 if convergence() else 1
    peers = ("lapy", "libigl", "robust-laplacian", "potpourri3d", "scikit-sparse")
    print(f"Python {sys.version.split()[0]}, {versions('numpy', 'scipy', 'numba', *peers)}")
    eigenpairs(operator(five_lobes(2_000)), 3)
    right = True
    for vertices in chosen.vertices:
        mesh = five_lobes(vertices, 0 if chosen.shuffled else None)
        right &= measure("five lobes", mesh, chosen.rounds, chosen.many, chosen.exact)
    for path in chosen.files:
        mesh = largest_component(clean(read(path))[0])[0]
        right &= measure(path.name, mesh, chosen.rounds, chosen.many, chosen.exact)
    return 0 if right else 1


if __name__ == "__main__":
    sys.exit(main())
