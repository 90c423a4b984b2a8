"""Reading beside the peers: the same bytes in each format, all in this process, by turns.

    ./run python benchmarks/reading.py [--vertices 100000] [--rounds 7]

The mesh is a bumpy torus with two faces a vertex, written by us (the texts with all digits of float64). Figures are
medians of CPU milliseconds on one core. trimesh comes with the development environment; VTK, MeshLib and Open3D take
part where they are installed (pip install vtk meshlib open3d) and find the bytes in a temporary folder. STL repeats
every vertex: for it our time includes merging, as that of VTK and MeshLib does; trimesh does not merge. All
must find the same number of triangles, and trimesh the same triangles; exits 1 otherwise.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import numpy.typing as npt
import trimesh

from reebase.mesh.clean import merged
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read
from reebase.mesh.write import WRITTEN, to_bytes


def torus(vertices: int) -> Mesh:
    across = int(np.sqrt(vertices / 2))
    around = vertices // across
    u, v = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    a, b = 2 * np.pi * u.ravel() / around, 2 * np.pi * v.ravel() / across
    tube = 1 + 0.1 * np.sin(7 * a) * np.cos(5 * b)
    points = np.stack(
        [(3 + tube * np.cos(b)) * np.cos(a), (3 + tube * np.cos(b)) * np.sin(a), tube * np.sin(b)], axis=1
    )

    def corner(i: npt.NDArray[np.int64], j: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        return (i % around * across + j % across).ravel()

    p, q, r, s = corner(u, v), corner(u + 1, v), corner(u + 1, v + 1), corner(u, v + 1)
    return Mesh(points, np.concatenate([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)]))


def as_text_ply(mesh: Mesh) -> bytes:
    lines = ["ply", "format ascii 1.0", f"element vertex {len(mesh.vertices)}"]
    lines += [f"property double {axis}" for axis in "xyz"]
    lines += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [f"{x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist()]
    return "\n".join([*lines, ""]).encode()


def as_text_stl(mesh: Mesh) -> bytes:
    parts = ["solid mesh\n"]
    for corners in mesh.vertices[mesh.faces].tolist():
        loop = "".join(f"      vertex {x:.9e} {y:.9e} {z:.9e}\n" for x, y, z in corners)
        parts.append(f"  facet normal 0 0 0\n    outer loop\n{loop}    endloop\n  endfacet\n")
    return ("".join(parts) + "endsolid mesh\n").encode()


Reader = Callable[[bytes, str, Path], int]
"""Takes the bytes, the format and a file that holds them; gives the number of triangles."""


def ours(data: bytes, name: str, _: Path) -> int:
    mesh = read(data, name)
    return len(merge(mesh).faces if name == "stl" else mesh.faces)


def merge(mesh: Mesh) -> Mesh:
    return Mesh(*merged(mesh.vertices, mesh.vertices, mesh.faces, 0.0, {}))


def with_trimesh(data: bytes, name: str, _: Path) -> int:
    return len(trimesh.load(io.BytesIO(data), file_type=name, process=False, force="mesh").faces)


def peers() -> dict[str, Reader]:
    found: dict[str, Reader] = {"trimesh": with_trimesh}
    with contextlib.suppress(ImportError):
        import vtk

        readers = {
            "obj": vtk.vtkOBJReader, "off": vtk.vtkOFFReader, "ply": vtk.vtkPLYReader, "stl": vtk.vtkSTLReader,
            "glb": vtk.vtkGLTFReader,
        }  # fmt: skip

        def with_vtk(_: bytes, name: str, path: Path) -> int:
            reader = readers[name]()
            reader.SetFileName(str(path))
            reader.Update()
            if name == "glb":
                blocks = reader.GetOutput()
                leaf = blocks.GetBlock(0).GetBlock(0).GetBlock(0)
                return int(leaf.GetNumberOfCells())
            return int(reader.GetOutput().GetNumberOfCells())

        found["VTK"] = with_vtk
    with contextlib.suppress(ImportError):
        from meshlib import mrmeshpy

        def with_meshlib(_: bytes, name: str, path: Path) -> int:
            return int(mrmeshpy.loadMesh(str(path)).topology.numValidFaces())

        found["MeshLib"] = with_meshlib
    with contextlib.suppress(ImportError):
        import open3d

        def with_open3d(_: bytes, name: str, path: Path) -> int:
            return len(open3d.io.read_triangle_mesh(str(path)).triangles)

        found["Open3D"] = with_open3d
    return found


def by_turns(readers: dict[str, Reader], data: bytes, name: str, path: Path, rounds: int) -> dict[str, float]:
    """Median CPU milliseconds of each reader; one that cannot read the format is left out."""
    seconds: dict[str, list[float]] = {reader: [] for reader in readers}
    for _ in range(rounds):
        for reader, spent in seconds.items():
            began = time.process_time()
            readers[reader](data, name, path)
            spent.append(time.process_time() - began)
    return {reader: 1000 * statistics.median(spent) for reader, spent in seconds.items()}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vertices", type=int, default=100_000)
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    mesh = torus(options.vertices)
    files = {name: (name, to_bytes(mesh, name)) for name in WRITTEN}
    files |= {"ply text": ("ply", as_text_ply(mesh)), "stl text": ("stl", as_text_stl(mesh))}
    readers = peers()
    print(f"{mesh}, numpy {np.__version__}; CPU ms")
    print(f"{'format':10} {'MB':>6} {'Reebase':>9}" + "".join(f"{name:>9}" for name in readers) + "   best peer / ours")
    wrong = False
    with tempfile.TemporaryDirectory() as folder:
        for label, (name, data) in files.items():
            path = Path(folder) / f"mesh.{name}"
            path.write_bytes(data)
            a, b = read(data, name), trimesh.load(io.BytesIO(data), file_type=name, process=False, force="mesh")
            wrong |= not np.allclose(a.vertices[a.faces], b.vertices[b.faces], rtol=1e-6)
            able = {"Reebase": ours} | {
                peer: reader for peer, reader in readers.items() if agrees(reader, data, name, path, len(a.faces))
            }
            times = by_turns(able, data, name, path, options.rounds)
            row = "".join(f"{times[peer]:9.1f}" if peer in times else f"{'-':>9}" for peer in ["Reebase", *readers])
            best = min(spent for peer, spent in times.items() if peer != "Reebase")
            print(f"{label:10} {len(data) / 1e6:6.1f} {row} {best / times['Reebase']:10.2f}")
    return int(wrong)


def agrees(reader: Reader, data: bytes, name: str, path: Path, faces: int) -> bool:
    """Whether the reader can read the format and finds as many triangles; the first call is the warm-up."""
    try:
        return reader(data, name, path) == faces
    except (RuntimeError, KeyError, ValueError, AttributeError, TypeError):
        return False


if __name__ == "__main__":
    sys.exit(main())
