"""Operator and eigenpairs beside LaPy, libigl and scipy, from arrays to results, in this process, one after another.

    OPENBLAS_NUM_THREADS=1 ./run python benchmarks/spectrum.py [--vertices 5000 20000] [--many 20000] [FILE ...]

Wants the packages `lapy` and `libigl`, and `scikit-sparse` for the rows with CHOLMOD; a column whose package is not
installed stays empty. Times are medians in milliseconds of processor time, as other work on the machine disturbs them
less than wall time; every tool runs on one thread, and ours is warm. The meshes have five lobes (lobes.py), numbered
along a spiral or, with --shuffled, at random; FILEs are read, cleaned, and their largest component is taken.

Operator: C and R of ours beside libigl's cotmatrix + massmatrix. First three, and first 50 eigenpairs (up to --many
vertices), assembly included: ours, LaPy's Solver.eigs (lumped, splu), and scipy's eigsh on libigl's matrices with
CHOLMOD's factor. Then the errors of lambda_2, lambda_3 (relative) and phi_2 (norm of R) against eigsh on our operator
at tolerance 0 (up to 100,000 vertices). Exits 1 when they are above 1e-8 or 1e-5.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib.metadata
import io
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from lobes import five_lobes
from scipy.sparse import csc_matrix, diags_array
from scipy.sparse.linalg import LinearOperator, eigsh

from reebase.mesh.clean import clean
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read
from reebase.mesh.topology import largest_component
from reebase.spectrum import Spectrum, eigenpairs, operator

try:
    import lapy
except ImportError:
    lapy = None
try:
    import igl
except ImportError:
    igl = None
try:
    from sksparse.cholmod import cholesky
except ImportError:
    cholesky = None

CONVERGED_UP_TO = 100_000
BUDGET = 1.0
"""Seconds after which a tool is not repeated: what takes so long varies little."""


def median(run: Callable[[], object], rounds: int) -> float:
    """Milliseconds of processor time."""
    taken: list[float] = []
    while len(taken) < rounds and sum(taken) < BUDGET * rounds ** (len(taken) < 2):
        began = time.process_time()
        with contextlib.redirect_stdout(io.StringIO()):  # LaPy prints what it does
            run()
        taken.append(time.process_time() - began)
    return statistics.median(taken) * 1000


def with_igl(mesh: Mesh) -> tuple[Any, Any]:
    faces = mesh.faces.astype(np.int64)
    return igl.cotmatrix(mesh.vertices, faces), igl.massmatrix(mesh.vertices, faces, igl.MASSMATRIX_TYPE_VORONOI)


def with_lapy(mesh: Mesh, k: int) -> object:
    return lapy.Solver(lapy.TriaMesh(mesh.vertices, mesh.faces), lump=True, use_cholmod=False).eigs(k=k)


def with_cholmod(mesh: Mesh, k: int) -> object:
    L, M = with_igl(mesh)
    shifted = csc_matrix(0.01 * M / M.sum() - L)
    inverse = LinearOperator(L.shape, matvec=cholesky(shifted, mode="simplicial"), dtype=np.float64)
    return eigsh(-L, k, M, sigma=-0.01 / M.sum(), OPinv=inverse)


def errors(mesh: Mesh, found: Spectrum) -> tuple[float, float]:
    """Worst relative error of lambda_2 and lambda_3, and error of phi_2 off the space of its eigenvalue."""
    made = operator(mesh)
    mass = made.mass / made.area
    values, vectors = eigsh(csc_matrix(made.C), 8, csc_matrix(diags_array(mass)), sigma=-0.01, v0=np.ones(len(mass)))
    same = vectors[:, np.abs(values / found.eigenvalues[1] - 1) < 1e-6]
    off = found.fiedler - same @ (same.T @ (mass * found.fiedler))
    return float(np.abs(found.eigenvalues[1:3] / values[1:3] - 1).max()), float(np.sqrt(mass @ off**2))


def row(name: str, own: float, peers: dict[str, float | None]) -> None:
    others = "".join(
        f"{'-':>18}" if ms is None else f"{ms:>10.1f} {f'({ms / own:.1f} x)':>7}" for ms in peers.values()
    )
    print(f"  {name:<20}{own:>9.2f}{others}", flush=True)


def measure(name: str, mesh: Mesh, rounds: int, many: int) -> bool:
    """Print the table of one mesh; whether the errors are below what is promised."""
    m = len(mesh.vertices)
    kind = operator(mesh).kind
    print(f"{name}: {m} vertices, {kind}\n  {'ms':<20}{'ours':>9}{'libigl':>18}{'LaPy':>18}{'eigsh + CHOLMOD':>18}")
    ours = median(lambda: operator(mesh), rounds)
    row("operator", ours, {"libigl": median(lambda: with_igl(mesh), rounds) if igl else None})
    for k in (3, 50):
        if k == 50 and m > many:
            continue
        eigenpairs(operator(mesh), k)
        peers = {
            "libigl": None,
            "LaPy": median(lambda k=k: with_lapy(mesh, k), rounds) if lapy else None,
            "CHOLMOD": median(lambda k=k: with_cholmod(mesh, k), rounds) if igl and cholesky else None,
        }
        row(f"{k} eigenpairs", median(lambda k=k: eigenpairs(operator(mesh), k), rounds), peers)
    if m > CONVERGED_UP_TO:
        return True
    of_value, of_vector = errors(mesh, eigenpairs(operator(mesh)))
    print(f"  error of lambda_2, lambda_3: {of_value:.1e}; of phi_2: {of_vector:.1e}")
    return of_value <= 1e-8 and of_vector <= 1e-5


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
    parser.add_argument("--many", type=int, default=20_000, help="50 eigenpairs up to so many vertices")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--shuffled", action="store_true", help="vertices in random order")
    chosen = parser.parse_args()
    print(f"Python {sys.version.split()[0]}, {versions('numpy', 'scipy', 'numba', 'lapy', 'libigl', 'scikit-sparse')}")
    eigenpairs(operator(five_lobes(2_000)), 3)
    right = True
    for vertices in chosen.vertices:
        mesh = five_lobes(vertices, 0 if chosen.shuffled else None)
        right &= measure("five lobes", mesh, chosen.rounds, chosen.many)
    for path in chosen.files:
        right &= measure(path.name, largest_component(clean(read(path))[0])[0], chosen.rounds, chosen.many)
    return 0 if right else 1


if __name__ == "__main__":
    sys.exit(main())
