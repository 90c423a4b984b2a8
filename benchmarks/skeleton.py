"""The Reeb graph of phi_2 with its endpoints beside VTK's Reeb graph and skeletor's wavefront, in this process.

    OPENBLAS_NUM_THREADS=1 ./run python benchmarks/skeleton.py [--vertices 5000 20000] [--bands 64] [FILE ...]

Wants the extra `peers` (vtk, skeletor, trimesh); what is missing is left out. All get the mesh, and ours and VTK's the
field; ours is timed from arrays to the pruned graph with its endpoints, warm, VTK's vtkPolyDataToReebGraphFilter from a
vtkPolyData to the graph, skeletor's by_wavefront from a trimesh.Trimesh made anew, as it keeps what it computed.
At 100,000 vertices VTK takes about a minute and 7 GB: give --vertices 100000 for it.

Times are medians in milliseconds of processor time of one thread, the tools in turns; a peer that takes above a second
runs once. The peers' times over ours follow. VTK's graph has a node at every critical point, so the two are compared
in their cycles alone, which must be the genus. Exits 1 when they differ.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import logging
import os
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from lobes import five_lobes

from reebase.mesh.clean import clean
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read
from reebase.mesh.topology import largest_component
from reebase.skeleton import prune, reeb_graph
from reebase.spectrum import eigenpairs, operator

try:
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
except ImportError:
    vtk = None
try:
    import skeletor
    import trimesh
except ImportError:
    skeletor = None

Timed = Callable[[], Callable[[], object]]
"""Prepares one run, and returns what is timed."""
ENOUGH = 1.0
"""Seconds after which a peer is not run again."""


def ours(mesh: Mesh, values: np.ndarray, bands: int, levels: str) -> Timed:
    return lambda: lambda: prune(reeb_graph(mesh, values, bands, levels), 0.01)


def by_vtk(mesh: Mesh, values: np.ndarray) -> Timed:
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

    def prepared() -> Callable[[], object]:
        reeb = vtk.vtkPolyDataToReebGraphFilter()
        reeb.SetInputData(surface)
        reeb.SetFieldId(0)

        def run() -> object:
            reeb.Update()
            return reeb.GetOutput()

        return run

    return prepared


def by_wavefront(mesh: Mesh, step: int) -> Timed:
    def prepared() -> Callable[[], object]:
        surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
        return lambda: skeletor.skeletonize.by_wavefront(surface, waves=1, step_size=step, progress=False)

    return prepared


def in_turns(tools: dict[str, Timed], rounds: int) -> tuple[dict[str, float], dict[str, object]]:
    """Median milliseconds of each tool, and its last result."""
    taken: dict[str, list[float]] = {name: [] for name in tools}
    results: dict[str, object] = {}
    for _ in range(rounds):
        for name, prepare in tools.items():
            if name != "ours" and sum(taken[name]) > ENOUGH:
                continue
            run = prepare()
            began = time.process_time()
            results[name] = run()
            taken[name].append(time.process_time() - began)
    return {name: statistics.median(times) * 1000 for name, times in taken.items()}, results


def measure(name: str, mesh: Mesh, bands: int, rounds: int) -> bool:
    values = eigenpairs(operator(mesh)).fiedler
    tools: dict[str, Timed] = {"ours": ours(mesh, values, bands, "width"), "by area": ours(mesh, values, bands, "area")}
    tools["ours"]()(), tools["by area"]()()
    if vtk:
        tools["VTK"] = by_vtk(mesh, values)
    if skeletor:
        tools |= {f"wavefront {step}": by_wavefront(mesh, step) for step in (1, 10)}
    times, results = in_turns(tools, rounds)
    graph = reeb_graph(mesh, values, bands)
    cycles = results["VTK"].GetNumberOfEdges() - results["VTK"].GetNumberOfVertices() + 1 if vtk else graph.cycles
    row = f"{name:<20}{len(mesh.vertices):>8}{times['ours']:>9.2f}{times['by area']:>9.2f}"
    for tool in ("VTK", "wavefront 1", "wavefront 10"):
        found = times.get(tool, float("nan"))
        row += f"{found:>11.1f}{found / times['ours']:>6.0f} x"
    print(f"{row}{graph.cycles:>7}{cycles:>5}{len(results['ours'].endpoints):>10}", flush=True)
    return graph.cycles == cycles


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--vertices", nargs="*", type=int, default=[5_000, 20_000])
    parser.add_argument("--bands", type=int, default=64)
    parser.add_argument("--rounds", type=int, default=15)
    chosen = parser.parse_args()
    logging.disable(logging.WARNING)
    there = [name for name, found in (("vtk", vtk), ("skeletor", skeletor)) if found]
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in there) or "no peer"
    load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors"
    print(f"Python {sys.version.split()[0]}, {versions}, {chosen.bands} bands, {load}, median ms")
    peers = "".join(f"{tool:>19}" for tool in ("VTK", "wavefront 1", "wavefront 10"))
    print(f"{'':<20}{'vertices':>8}{'ours':>9}{'by area':>9}{peers}{'cycles':>7}{'VTK':>5}{'endpoints':>10}")
    right = True
    for vertices in chosen.vertices:
        right &= measure("five lobes", five_lobes(vertices), chosen.bands, chosen.rounds)
    for path in chosen.files:
        mesh = largest_component(clean(read(path))[0])[0]
        right &= measure(path.name, mesh, chosen.bands, chosen.rounds)
    return 0 if right else 1


if __name__ == "__main__":
    sys.exit(main())
