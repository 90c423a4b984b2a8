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
from reebase.mesh.read.text import integers, lenient_float, pieces, plain_text, quoted, rectangle, without_comments
from reebase.words import counted

__all__ = ["read_obj"]

Ints = npt.NDArray[np.int64]

_VERTEX = (b"v ", b"v\t")
_FACE = (b"f ", b"f\t", b"fo ", b"fo\t")
_SLASHED = re.compile(rb"/\S*")


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
        lines = [line.strip() for line in piece.splitlines()]
        at_vertex = [i for i, line in enumerate(lines) if line.startswith(_VERTEX)]
        at_face = [i for i, line in enumerate(lines) if line.startswith(_FACE)]
        if at_vertex:
            limits.check_vertices(vertex_count + len(at_vertex))
            vertices.append(_positions(lines, at_vertex, text, start))
        if at_face:
            some, some_sizes = _corners(lines, at_face, text, start)
            face_count += int(np.maximum(some_sizes - 2, 0).sum())
            limits.check_faces(face_count)
            if (some <= 0).any():
                before = vertex_count + np.searchsorted(at_vertex, at_face)
                some = _absolute(some, np.repeat(before, some_sizes))
            corners.append(some - 1)
            sizes.append(some_sizes)
        vertex_count += len(at_vertex)
    if not vertex_count and not corners and not _known_keyword(text):
        raise FormatError("The file holds no line of an OBJ file (no v, f, g, o, usemtl, ...).")
    if not corners:
        raise NoFaces(
            f"The OBJ file has {counted(vertex_count, 'vertex')} {'but' if vertex_count else 'and'} no faces "
            "(no line starts with f)."
        )
    positions = np.concatenate(vertices) if vertices else np.zeros((0, 3))
    return build(positions, np.concatenate(corners), np.concatenate(sizes), limits, base=1)


def _positions(lines: list[bytes], at: list[int], text: bytes, start: int) -> npt.NDArray[np.float64]:
    """Vertices of the given lines, shape (len(at), 3)."""
    even = rectangle([lines[i] for i in at])
    try:
        if even is not None and even[1] >= 4:
            tokens, width = even
            columns = [np.fromiter(map(float, tokens[axis::width]), np.float64) for axis in (1, 2, 3)]
            return np.stack(columns, axis=1)
    except ValueError:
        pass
    rows = np.zeros((len(at), 3))  # drawings in the plane leave out z
    for row, i in enumerate(at):
        tokens = lines[i].split()[1:4]
        if len(tokens) < 2:
            raise FormatError(f"OBJ: the vertex in {_line(text, start, i)} has {counted(len(tokens), 'coordinate')}.")
        for axis, token in enumerate(tokens):
            try:
                rows[row, axis] = lenient_float(token)
            except ValueError:
                raise FormatError(
                    f"OBJ: {quoted(token)} in {_line(text, start, i)} stands where a coordinate is expected."
                ) from None
    return rows


def _corners(lines: list[bytes], at: list[int], text: bytes, start: int) -> tuple[Ints, Ints]:
    """(vertex numbers as written, from 1 or negative; corners of each face) of the given lines."""
    faces = [lines[i] for i in at]
    if any(b"/" in face for face in faces):
        faces = [_SLASHED.sub(b"", face) for face in faces]
    even = rectangle(faces)
    try:
        if even is not None:
            tokens, width = even
            del tokens[::width]
            return integers(tokens), np.full(len(at), width - 1)
        rows = [face.split()[1:] for face in faces]
        return integers(chain.from_iterable(rows)), np.fromiter(map(len, rows), np.int64)
    except ValueError:
        pass
    for i in at:
        for token in lines[i].split()[1:]:
            try:
                integers([token.partition(b"/")[0]])
            except ValueError:
                raise FormatError(
                    f"OBJ: {quoted(token)} in {_line(text, start, i)} is not a vertex number."
                ) from None
    raise FormatError("OBJ: a face has a corner that is not a vertex number.")


def _absolute(corners: Ints, before: Ints) -> Ints:
    """Negative numbers count back from the last vertex before the face (-1)."""
    if (corners == 0).any():
        raise FaceIndexOutOfRange("A face refers to vertex 0, but OBJ counts vertices from 1.", vertex=0)
    found = np.where(corners < 0, before + corners + 1, corners)
    if (found <= 0).any():
        at = int(np.flatnonzero(found <= 0)[0])
        raise FaceIndexOutOfRange(
            f"A face refers to vertex {int(corners[at])}, but has {counted(int(before[at]), 'vertex')} before it.",
            vertex=int(corners[at]), vertices=int(before[at]),
        )  # fmt: skip
    return found


def _line(text: bytes, start: int, row: int) -> str:
    return f"line {len(text[:start].splitlines()) + row + 1}"


def _known_keyword(text: bytes) -> bool:
    pattern = rb"(?m)^[ \t]*(v[tnp]?|[flpgos]|usemtl|mtllib|call|csh|vp|deg|cstype)([ \t]|\r?$)"
    return not text.strip() or re.search(pattern, text) is not None
