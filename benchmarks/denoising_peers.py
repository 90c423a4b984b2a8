"""Filters of other tools, those that are installed (``pip install reebase[peers]``): positions in, positions out."""

from __future__ import annotations

import importlib
from collections.abc import Callable

import numpy as np

from reebase.mesh.mesh import Mesh

Run = Callable[[Mesh, int], Mesh]


def peers() -> dict[str, Run]:
    """Filter by tool and name; ``iterations`` is what each tool means by it."""
    found: dict[str, Run] = {}
    for package, make in (
        ("trimesh", with_trimesh), ("pymeshlab", with_pymeshlab), ("open3d", with_open3d), ("vtk", with_vtk),
        ("meshlib.mrmeshpy", with_meshlib),
    ):  # fmt: skip
        try:
            importlib.import_module(package)
        except ImportError as error:
            print(f"without {package}: {error}")
            continue
        found |= make()
    return found


def with_trimesh() -> dict[str, Run]:
    """Its filters at their defaults."""
    import trimesh
    from trimesh import smoothing

    def run(smooth: Callable[..., object]) -> Run:
        def filtered(mesh: Mesh, iterations: int) -> Mesh:
            copy = trimesh.Trimesh(mesh.vertices.copy(), mesh.faces.copy(), process=False)
            smooth(copy, iterations=iterations)
            return Mesh(np.array(copy.vertices), mesh.faces)

        return filtered

    return {
        "trimesh laplacian": run(smoothing.filter_laplacian), "trimesh taubin": run(smoothing.filter_taubin),
        "trimesh humphrey": run(smoothing.filter_humphrey),
    }  # fmt: skip


def with_pymeshlab() -> dict[str, Run]:
    """Two-step smoothing with one pass of each part an iteration, and Taubin."""
    import pymeshlab

    def run(name: str, **arguments: object) -> Run:
        def filtered(mesh: Mesh, iterations: int) -> Mesh:
            meshes = pymeshlab.MeshSet()
            meshes.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces))
            steps = {"stepsmoothnum": iterations}
            meshes.apply_filter(name, **{**arguments, **steps})
            return Mesh(meshes.current_mesh().vertex_matrix(), mesh.faces)

        return filtered

    two_step = run("apply_coord_two_steps_smoothing", normalthr=60, stepnormalnum=1, stepfitnum=1)
    return {"pymeshlab two-step": two_step, "pymeshlab taubin": run("apply_coord_taubin_smoothing")}


def with_open3d() -> dict[str, Run]:
    """The simple filter, Laplacian and Taubin."""
    import open3d

    def run(name: str) -> Run:
        def filtered(mesh: Mesh, iterations: int) -> Mesh:
            points = open3d.utility.Vector3dVector(mesh.vertices.copy())
            geometry = open3d.geometry.TriangleMesh(points, open3d.utility.Vector3iVector(mesh.faces.copy()))
            smoothed = getattr(geometry, name)(number_of_iterations=iterations)
            return Mesh(np.asarray(smoothed.vertices).copy(), mesh.faces)

        return filtered

    return {
        "open3d simple": run("filter_smooth_simple"), "open3d laplacian": run("filter_smooth_laplacian"),
        "open3d taubin": run("filter_smooth_taubin"),
    }  # fmt: skip


def with_vtk() -> dict[str, Run]:
    """Windowed sinc with a pass band of 0.05, and Laplacian smoothing."""
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

    def poly(mesh: Mesh) -> object:
        points = vtk.vtkPoints()
        points.SetData(numpy_to_vtk(mesh.vertices))
        cells = vtk.vtkCellArray()
        offsets = numpy_to_vtkIdTypeArray(np.arange(0, 3 * len(mesh.faces) + 1, 3, dtype=np.int64), deep=True)
        cells.SetData(offsets, numpy_to_vtkIdTypeArray(mesh.faces.ravel().astype(np.int64), deep=True))
        data = vtk.vtkPolyData()
        data.SetPoints(points)
        data.SetPolys(cells)
        return data

    def run(kind: str) -> Run:
        def filtered(mesh: Mesh, iterations: int) -> Mesh:
            smooth = getattr(vtk, kind)()
            smooth.SetInputData(poly(mesh))
            smooth.SetNumberOfIterations(iterations)
            smooth.FeatureEdgeSmoothingOff()
            if kind == "vtkWindowedSincPolyDataFilter":
                smooth.SetPassBand(0.05)
                smooth.NormalizeCoordinatesOn()
            smooth.Update()
            found = vtk_to_numpy(smooth.GetOutput().GetPoints().GetData()).astype(np.float64)
            return Mesh(found, mesh.faces)

        return filtered

    return {"vtk sinc": run("vtkWindowedSincPolyDataFilter"), "vtk laplacian": run("vtkSmoothPolyDataFilter")}


def with_meshlib() -> dict[str, Run]:
    """Relaxation, with and without its volume, and denoising by normals."""
    import meshlib.mrmeshnumpy as arrays
    import meshlib.mrmeshpy as meshlib

    def run(change: Callable[[object, int], object]) -> Run:
        def filtered(mesh: Mesh, iterations: int) -> Mesh:
            given = arrays.meshFromFacesVerts(mesh.faces, mesh.vertices)
            change(given, iterations)
            return Mesh(np.array(arrays.getNumpyVerts(given)), mesh.faces)

        return filtered

    def relaxed(name: str) -> Run:
        def change(mesh: object, iterations: int) -> None:
            settings = meshlib.MeshRelaxParams()
            settings.iterations = iterations
            getattr(meshlib, name)(mesh, settings)

        return run(change)

    def by_normals(mesh: object, _: int) -> None:
        meshlib.meshDenoiseViaNormals(mesh, meshlib.DenoiseViaNormalsSettings())

    return {
        "meshlib relax": relaxed("relax"), "meshlib keep volume": relaxed("relaxKeepVolume"),
        "meshlib by normals": run(by_normals),
    }  # fmt: skip
