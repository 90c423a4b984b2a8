"""What runs inside the sandbox's child: bytes in, files of arrays out, no database and no blobs.

Every computation takes its arguments (JSON), the input file, the output files by name and a progress
callback, and returns a small JSON answer. Whatever it writes can be read back without unpickling.
"""

from __future__ import annotations

import io
import itertools
import json
import socket
from collections.abc import Callable, Mapping
from typing import Any, BinaryIO

import numpy as np

from reebase.errors import MeshError, MissingPackage
from reebase.mesh.mesh import Mesh

__all__ = ["COMPUTATIONS", "warm"]

Progress = Callable[[str, float], None]
Computation = Callable[[dict[str, Any], BinaryIO, Mapping[str, BinaryIO], Progress], dict[str, Any]]


def describe(
    arguments: dict[str, Any], source: BinaryIO, outputs: Mapping[str, BinaryIO], progress: Progress
) -> dict[str, Any]:
    """Read the mesh in ``source`` and walk the pipeline.

    arguments: ``format`` (or None: sniffed), ``profile``, ``limits``. outputs: ``description``; ``cleaned``
    and ``denoised`` (PLY, the latter with the field as ``phi2``) where they are asked for.
    """
    from reebase import pipeline
    from reebase.mesh import read, write

    progress("read", 0.0)
    mesh = read.read(source.read(), arguments["format"], limits=read.Limits(**arguments["limits"]))
    description = pipeline.describe(mesh, pipeline.Profile(**arguments["profile"]), progress=progress)
    progress("write", 0.95)
    if "cleaned" in outputs:
        outputs["cleaned"].write(write.to_bytes(description.cleaned, "ply"))
    if "denoised" in outputs:
        scalars = {"phi2": description.field}
        outputs["denoised"].write(write.to_bytes(description.denoised, "ply", scalars=scalars))
    description.save(outputs["description"])
    return {"seconds": description.seconds}


def evaluate(
    arguments: dict[str, Any], source: BinaryIO, outputs: Mapping[str, BinaryIO], progress: Progress
) -> dict[str, Any]:
    """All dissimilarities of stacked features and the measures of retrieval on them.

    source: npz of ``features`` (total, 3) and ``offsets`` (n + 1,). arguments: ``labels`` and ``names`` (n
    each), ``measure``, ``bootstrap``, ``seed``. outputs: ``report`` (JSON), ``matrix`` (npy, (n, n)).
    """
    from reebase.evaluation import matrix, measures

    progress("matrix", 0.0)
    with np.load(io.BytesIO(source.read()), allow_pickle=False) as stacked:
        features, offsets = stacked["features"], stacked["offsets"]
    shapes = [features[start:end] for start, end in itertools.pairwise(offsets)]
    dissimilarities = matrix.dissimilarity_matrix(shapes, arguments["measure"])
    progress("measures", 0.5)
    evaluation = measures.evaluate(
        dissimilarities, arguments["labels"], arguments["names"],
        bootstrap=arguments["bootstrap"], seed=arguments["seed"],
    )  # fmt: skip
    outputs["report"].write(json.dumps(evaluation.to_json()).encode())
    np.save(outputs["matrix"], dissimilarities, allow_pickle=False)
    return {}


def probe(_: dict[str, Any], __: BinaryIO, ___: Mapping[str, BinaryIO], ____: Progress) -> dict[str, Any]:
    """Nothing but an attempt at what must be refused; the child reports its guards beside the answer."""
    try:
        socket.socket().close()
    except OSError:
        return {"network": False}
    return {"network": True}


COMPUTATIONS: dict[str, Computation] = {"describe": describe, "evaluate": evaluate, "probe": probe}


def warm() -> None:
    """Walk every computation once on small meshes, so that all modules are imported and all kernels ready."""
    from reebase import pipeline
    from reebase import warm as kernels
    from reebase.mesh import write

    kernels.warm()
    sample = kernels.sample()
    profile = pipeline.Profile().to_json()
    # A mesh in each format loads its reader; the last has an edge of four faces, for the operator of such.
    for mesh, name in [*((sample, name) for name in _FORMATS), (_two_tetrahedra(), "ply")]:
        outputs = {name: io.BytesIO() for name in ("description", "cleaned", "denoised")}
        try:
            source = io.BytesIO(write.to_bytes(mesh, name))
            describe({"format": name, "limits": {}, "profile": profile}, source, outputs, _silent)
        except (MissingPackage, MeshError):
            continue  # what is not installed, or refused, needs no warming
    stacked = io.BytesIO()
    np.savez(stacked, features=np.tile(_SOME_FEATURES, (4, 1)), offsets=np.arange(0, 9, 2))
    stacked.seek(0)
    labelled = {"labels": ["a", "a", "b", "b"], "names": ["0", "1", "2", "3"]}
    outputs = {name: io.BytesIO() for name in ("report", "matrix")}
    evaluate(
        {**labelled, "measure": "matching", "bootstrap": 2, "seed": 0}, stacked, outputs, _silent
    )


_FORMATS = ("ply", "obj", "off", "stl", "glb")
_SOME_FEATURES = np.array([[0.5, 0.5, 0.5], [-0.5, -0.5, -0.5]])


def _silent(_: str, __: float) -> None:
    return


def _two_tetrahedra() -> Mesh:
    """Two tetrahedra that share one edge."""
    corners = [[0, 0, 0], [0, 0, 1], [1, 0, 0.5], [1, 1, 0.5], [-1, 0, 0.5], [-1, -1, 0.5]]
    vertices = np.array(corners, dtype=np.float64)
    tetrahedra = [(0, 1, 2, 3), (0, 1, 4, 5)]
    sides = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    faces = [[four[i] for i in side] for four in tetrahedra for side in sides]
    return Mesh(vertices, np.array(faces, dtype=np.int32))
