"""The mesh: two arrays, checked once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.errors import FaceIndexOutOfRange, MeshError, NonFiniteVertices

__all__ = ["Mesh"]


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh.

    vertices: positions, float64, shape (m, 3), in the units of the file.
    faces: vertex indices of each triangle, int32, shape (n, 3), counter-clockwise from outside.

    Coordinates are finite at every vertex that a face refers to; one that no face refers to may hold
    anything, as files in the wild do, and cleaning removes it. Both arrays are C-contiguous and read-only;
    what is passed is copied only if it must be. Raises MeshError for wrong shapes, NonFiniteVertices,
    FaceIndexOutOfRange.
    """

    vertices: npt.NDArray[np.float64]
    faces: npt.NDArray[np.int32]

    def __post_init__(self) -> None:
        try:
            given = np.asarray(self.faces)
            found = np.asarray(self.vertices)
        except ValueError as error:
            raise MeshError(f"Vertices and faces must be arrays of rows of three: {error}.") from None
        if given.size and given.dtype.kind not in "iu":
            raise MeshError(f"Faces must be integers; found {given.dtype}.")
        if found.size and found.dtype.kind not in "iuf":
            raise MeshError(f"Vertices must be real numbers; found {found.dtype}.")
        vertices = np.ascontiguousarray(found, dtype=np.float64)
        if vertices.size == 0:
            vertices = vertices.reshape(0, 3)
        if vertices.ndim != 2 or vertices.shape[1] != 3:
            raise MeshError(f"Vertices must have shape (m, 3); found {vertices.shape}.")
        if given.size == 0:
            given = given.reshape(0, 3)
        if given.ndim != 2 or given.shape[1] != 3:
            raise MeshError(f"Faces must have shape (n, 3); found {given.shape}.")
        if given.size and (given.min() < 0 or given.max() >= len(vertices)):
            bad = int(np.flatnonzero(((given < 0) | (given >= len(vertices))).any(axis=1))[0])
            raise FaceIndexOutOfRange(
                f"Face {bad} refers to vertices {given[bad].tolist()}, but there are {len(vertices)}.",
                face=bad, vertices=len(vertices),
            )  # fmt: skip
        faces = np.ascontiguousarray(given, dtype=np.int32)
        refuse_non_finite(vertices, faces)
        for name, array in (("vertices", vertices), ("faces", faces)):
            view = array.view()
            view.flags.writeable = False
            object.__setattr__(self, name, view)

    def __repr__(self) -> str:
        return f"Mesh({len(self.vertices)} vertices, {len(self.faces)} faces)"


def refuse_non_finite(vertices: npt.NDArray[np.float64], faces: npt.NDArray[np.integer[Any]]) -> None:
    """Raise NonFiniteVertices when faces, of any shape, refer to a vertex with a NaN or infinite coordinate."""
    finite = np.isfinite(vertices)
    if finite.all():
        return
    whole = np.asarray(finite.all(axis=1))
    bad = np.unique(faces[~whole[faces]])
    if len(bad):
        raise NonFiniteVertices(
            f"Of the vertices that faces refer to {len(bad):,} {'has' if len(bad) == 1 else 'have'} a NaN or infinite "
            f"coordinate, the first is vertex {int(bad[0])}, counted from 0. Delete or repair "
            f"{'it' if len(bad) == 1 else 'them'} and send the mesh again.",
            count=len(bad), first=int(bad[0]),
        )  # fmt: skip
