"""Wavefront OBJ: positions and polygons; groups, materials, normals, curves and points are passed over."""

from __future__ import annotations

import re
from itertools import chain

import numpy as np
import numpy.typing as npt

from reebase.errors import FaceIndexOutOfRange, FormatError, NoFaces
from reebase.mesh.mesh import Mesh
from reebase.mesh.read.limits import Limits
from reebase.mesh.read.polygons import build
from reebase.mesh.read.text import integers, lenient_float, pieces, plain_text, quoted, without_comments

__all__ = ["read_obj"]


def read_obj(data: bytes, limits: Limits) -> Mesh:
    """The mesh of an OBJ file, vertices and faces in their order, polygons triangulated.

    The fourth number of a ``v`` line is the weight of rational curves (or a colour) and does not move the
    vertex. Raises FormatError, MeshError, LimitError.
    """
    text = plain_text(data)
    if b"\\" in text:
        text = re.sub(rb"\\\r?\n", b"  ", text)
    text = without_comments(text)
    vertices: list[npt.NDArray[np.float64]] = []
    corners: list[npt.NDArray[np.int64]] = []
    sizes: list[npt.NDArray[np.int64]] = []
    vertex_count = face_count = 0
    for start, piece in pieces(text, b"\r\n" if b"\r" in text and b"\n" not in text else b"\n"):
        rows = [line.split() for line in piece.splitlines()]
        at_vertex = [i for i, row in enumerate(rows) if row and row[0] == b"v"]
        at_face = [i for i, row in enumerate(rows) if row and row[0] in (b"f", b"fo")]
        if at_vertex:
            limits.check_vertices(vertex_count + len(at_vertex))
            vertices.append(_positions(rows, at_vertex, text, start))
        if at_face:
            some_sizes = np.fromiter((len(rows[i]) - 1 for i in at_face), np.int64, len(at_face))
            face_count += int(np.maximum(some_sizes - 2, 0).sum())
            limits.check_faces(face_count)
            some = _corners(rows, at_face, text, start)
            if (some <= 0).any():
                before = vertex_count + np.searchsorted(at_vertex, at_face)
                some = _absolute(some, np.repeat(before, some_sizes))
            corners.append(some - 1)
            sizes.append(some_sizes)
        vertex_count += len(at_vertex)
    if not vertex_count and not corners and not _known_keyword(text):
        raise FormatError("The file holds no line of an OBJ file (no v, f, g, o, usemtl, ...).")
    if not corners:
        raise NoFaces(f"The OBJ file has {vertex_count} vertices but no face (no line that starts with f).")
    positions = np.concatenate(vertices) if vertices else np.zeros((0, 3))
    return build(positions, np.concatenate(corners), np.concatenate(sizes), limits, base=1)


def _positions(rows: list[list[bytes]], at: list[int], text: bytes, start: int) -> npt.NDArray[np.float64]:
    chosen = [rows[i][1:4] for i in at]
    try:
        flat = np.fromiter(map(float, chain.from_iterable(chosen)), np.float64)
        if len(flat) == 3 * len(at) and all(len(row) == 3 for row in chosen):
            return flat.reshape(-1, 3)
    except ValueError:
        pass
    for i, row in zip(at, chosen, strict=True):
        if len(row) < 2:
            raise FormatError(f"OBJ: the vertex in {_line(text, start, i)} has {len(row)} coordinates.")
        for token in row:
            try:
                lenient_float(token)
            except ValueError:
                raise FormatError(
                    f"OBJ: {quoted(token)} in {_line(text, start, i)} stands where a coordinate is expected."
                ) from None
    # Drawings in the plane leave out z.
    return np.array([[lenient_float(token) for token in [*row, b"0"][:3]] for row in chosen])


def _corners(rows: list[list[bytes]], at: list[int], text: bytes, start: int) -> npt.NDArray[np.int64]:
    """Vertex numbers as written (from 1, or negative) of the faces in the given rows."""
    try:
        return integers(chain.from_iterable(rows[i][1:] for i in at))
    except ValueError:
        pass
    try:
        return integers(token.partition(b"/")[0] for i in at for token in rows[i][1:])
    except ValueError:
        pass
    for i in at:
        for token in rows[i][1:]:
            try:
                integers([token.partition(b"/")[0]])
            except ValueError:
                raise FormatError(
                    f"OBJ: {quoted(token)} in {_line(text, start, i)} is not a vertex number."
                ) from None
    raise FormatError("OBJ: a face has a corner that is not a vertex number.")


def _absolute(corners: npt.NDArray[np.int64], before: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Negative numbers count back from the last vertex before the face (-1)."""
    if (corners == 0).any():
        raise FaceIndexOutOfRange("A face refers to vertex 0, but OBJ counts vertices from 1.", vertex=0)
    found = np.where(corners < 0, before + corners + 1, corners)
    if (found <= 0).any():
        at = int(np.flatnonzero(found <= 0)[0])
        raise FaceIndexOutOfRange(
            f"A face refers to vertex {int(corners[at])}, but {int(before[at])} vertices stand before it.",
            vertex=int(corners[at]), vertices=int(before[at]),
        )  # fmt: skip
    return found


def _line(text: bytes, start: int, row: int) -> str:
    return f"line {len(text[:start].splitlines()) + row + 1}"


def _known_keyword(text: bytes) -> bool:
    pattern = rb"(?m)^[ \t]*(v[tnp]?|[flpgos]|usemtl|mtllib|call|csh|vp|deg|cstype)([ \t]|\r?$)"
    return not text.strip() or re.search(pattern, text) is not None
