"""The Reeb graph of phi_2 beside VTK's vtkPolyDataToReebGraphFilter, same mesh and values, in this process.

    OPENBLAS_NUM_THREADS=1 ./run python benchmarks/reeb.py [--vertices 5000 20000] [--bands 64] [FILE ...]

Wants the package `vtk`; without it only ours is timed. At 100,000 vertices VTK takes about a minute and 7 GB. Times
are medians in milliseconds of processor time, one thread, ours warm; VTK runs once where it takes above a second. Its
mesh and scalars are set up before its clock starts. VTK's graph has a node at every critical point, so the two are
compared in their cycles alone, which must be the genus. Exits 1 when they differ.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import statistics
import sys
import time
from pathlib import Path

import numpy as np
from lobes import five_lobes

from reebase.mesh.clean import clean
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read
from reebase.mesh.topology import largest_component
from reebase.skeleton import reeb_graph
from reebase.spectrum import eigenpairs, operator

try:
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
except ImportError:
    vtk = None


def by_vtk(mesh: Mesh, values: np.ndarray) -> tuple[float, int]:
    """Milliseconds, and cycles of the graph."""
    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(mesh.vertices.copy(), deep=1))
    cells = vtk.vtkCellArray()
    offsets = np.arange(0, 3 * len(mesh.faces) + 1, 3)
    corners = mesh.faces.astype(np.int64).ravel()
    cells.SetData(numpy_to_vtkIdTypeArray(offsets, deep=1), numpy_to_vtkIdTypeArray(corners, deep=1))
    surface = vtk.vtkPolyData()
    surface.SetPoints(points)
    surface.SetPolys(cells)
    scalars = numpy_to_vtk(values.copy(), deep=1)
    scalars.SetName("phi_2")
    surface.GetPointData().SetScalars(scalars)
    taken: list[float] = []
    while len(taken) < 3 and sum(taken) < 1.0:
        reeb = vtk.vtkPolyDataToReebGraphFilter()
        reeb.SetInputData(surface)
        reeb.SetFieldId(0)
        began = time.process_time()
        reeb.Update()
        taken.append(time.process_time() - began)
    graph = reeb.GetOutput()
    return statistics.median(taken) * 1000, graph.GetNumberOfEdges() - graph.GetNumberOfVertices() + 1


def measure(name: str, mesh: Mesh, bands: int, rounds: int) -> bool:
    values = eigenpairs(operator(mesh)).fiedler
    graph = reeb_graph(mesh, values, bands)
    taken = []
    for _ in range(rounds):
        began = time.process_time()
        reeb_graph(mesh, values, bands)
        taken.append(time.process_time() - began)
    ours = statistics.median(taken) * 1000
    theirs, cycles = by_vtk(mesh, values) if vtk else (float("nan"), graph.cycles)
    print(
        f"{name:<24}{len(mesh.vertices):>8}{ours:>10.2f}{theirs:>12.1f}{theirs / ours:>8.0f} x"
        f"{graph.cycles:>8}{cycles:>6}", flush=True,
    )  # fmt: skip
    return graph.cycles == cycles


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--vertices", nargs="*", type=int, default=[5_000, 20_000])
    parser.add_argument("--bands", type=int, default=64)
    parser.add_argument("--rounds", type=int, default=9)
    chosen = parser.parse_args()
    version = f"vtk {importlib.metadata.version('vtk')}" if vtk else "without vtk"
    print(f"Python {sys.version.split()[0]}, {version}, {chosen.bands} bands, median ms")
    print(f"{'':<24}{'vertices':>8}{'ours':>10}{'VTK':>12}{'':>10}{'cycles':>8}{'VTK':>6}")
    right = True
    for vertices in chosen.vertices:
        right &= measure("five lobes", five_lobes(vertices), chosen.bands, chosen.rounds)
    for path in chosen.files:
        mesh = largest_component(clean(read(path))[0])[0]
        right &= measure(path.name, mesh, chosen.bands, chosen.rounds)
    return 0 if right else 1


if __name__ == "__main__":
    sys.exit(main())
