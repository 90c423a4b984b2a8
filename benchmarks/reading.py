"""Reading beside trimesh: the same bytes in each format, both in this process.

    ./run python benchmarks/reading.py [--vertices 100000] [--rounds 5]

The mesh is a bumpy torus with two faces a vertex, written by us (the texts with all digits of float64). Times
are medians in milliseconds; trimesh is told not to merge (process=False), as we do not. Both must find the
same triangles; exits 1 otherwise.
"""

from __future__ import annotations

import argparse
import io
import statistics
import sys
import time
from collections.abc import Callable

import numpy as np
import trimesh

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
    corner = lambda i, j: (i % around * across + j % across).ravel()  # noqa: E731
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


def median(run: Callable[[], object], rounds: int) -> float:
    seconds = []
    for _ in range(rounds):
        began = time.perf_counter()
        run()
        seconds.append(time.perf_counter() - began)
    return 1000 * statistics.median(seconds)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vertices", type=int, default=100_000)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    mesh = torus(options.vertices)
    files = {name: (name, to_bytes(mesh, name)) for name in WRITTEN}
    files |= {"ply text": ("ply", as_text_ply(mesh)), "stl text": ("stl", as_text_stl(mesh))}
    print(f"{mesh}, numpy {np.__version__}, trimesh {trimesh.__version__}")
    print(f"{'format':10} {'MB':>6} {'ours ms':>9} {'trimesh ms':>11} {'ratio':>6}")
    wrong = False
    for label, (name, data) in files.items():
        def theirs(data: bytes = data, name: str = name) -> trimesh.Trimesh:
            return trimesh.load(io.BytesIO(data), file_type=name, process=False, force="mesh")

        def ours(data: bytes = data, name: str = name) -> Mesh:
            return read(data, name)

        a, b = ours(), theirs()
        wrong |= not np.allclose(a.vertices[a.faces], b.vertices[b.faces], rtol=1e-6)
        mine, other = median(ours, options.rounds), median(theirs, options.rounds)
        print(f"{label:10} {len(data) / 1e6:6.1f} {mine:9.1f} {other:11.1f} {other / mine:6.1f}")
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main())
