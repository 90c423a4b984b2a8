"""Wavefront OBJ: positions and polygons; groups, materials, normals, curves and points are passed over."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from reebase.errors import FaceIndexOutOfRange, FormatError, NoFaces, ReebaseError
from reebase.mesh.mesh import Mesh
from reebase.mesh.read.limits import Limits
from reebase.mesh.read.polygons import build
from reebase.mesh.read.text import as_bytes, line_of, pieces, plain_text, quoted, repaired, without_comments
from reebase.words import counted

__all__ = ["read_obj"]

Ints = npt.NDArray[np.int64]


def read_obj(data: bytes, limits: Limits) -> Mesh:
    """The mesh of an OBJ file, vertices and faces in their order, polygons triangulated.

    The fourth number of a ``v`` line is the weight of rational curves (or a colour) and does not move the
    vertex. Raises FormatError, MeshError, LimitError.
    """
    text = plain_text(data)
    if b"\\" in text:
        text = re.sub(rb"\\[ \t]*(\r\n|\r|\n)", b"  ", text)
    text = without_comments(text)
    vertices: list[npt.NDArray[np.float64]] = []
    corners: list[npt.NDArray[np.int64]] = []
    sizes: list[npt.NDArray[np.int64]] = []
    vertex_count = face_count = 0
    for start, piece in pieces(text, b"\r\n" if b"\r" in text and b"\n" not in text else b"\n"):
        some_vertices, some_corners, some_sizes = _records(piece, vertex_count, text, start)
        vertex_count += len(some_vertices)
        face_count += int(np.maximum(some_sizes - 2, 0).sum())
        limits.check_vertices(vertex_count)
        limits.check_faces(face_count)
        vertices.append(some_vertices)
        corners.append(some_corners)
        sizes.append(some_sizes)
    faces = sum(map(len, sizes))
    if not vertex_count and not faces and not _known_keyword(text):
        raise FormatError("The file holds no line of an OBJ file (no v, f, g, o, usemtl, ...).")
    if not faces:
        raise NoFaces(
            f"The OBJ file has {counted(vertex_count, 'vertex')} {'but' if vertex_count else 'and'} no faces "
            "(no line starts with f)."
        )
    return build(np.concatenate(vertices), np.concatenate(corners), np.concatenate(sizes), limits, base=1)


def _records(
    piece: bytes, before: int, text: bytes, start: int
) -> tuple[npt.NDArray[np.float64], Ints, Ints]:
    """(vertices (n, 3), vertex numbers of all faces from 0, corners of each face) of the piece, which stands at
    ``start`` in the text, behind so many vertices."""
    from reebase.mesh.read.text_kernels import scan_obj

    most = len(piece) // 2 + 1
    values, odd = np.empty(3 * (most // 2 + 1)), np.empty((most, 2), np.int64)
    corners, sizes = np.empty(most, np.int64), np.empty(most, np.int64)
    vertices, faces, count, strange, fault, offset, known = scan_obj(
        as_bytes(piece), before, values, corners, sizes, odd
    )
    if fault:
        repaired(values, odd[:strange], piece, "OBJ", text, start)
        raise _refusal(fault, piece[offset:], line_of(text, start + offset), known)
    positions = repaired(values[: 3 * vertices], odd[:strange], piece, "OBJ", text, start)
    return positions.reshape(-1, 3), corners[:count], sizes[:faces]


def _refusal(fault: int, rest: bytes, line: int, known: int) -> ReebaseError:
    """Why the kernel stopped at the rest of the piece; known: coordinates of the line, or vertices before it."""
    from reebase.mesh.read.text_kernels import BAD_CORNER, SHORT_VERTEX

    if fault == SHORT_VERTEX:
        return FormatError(f"OBJ: the vertex in line {line} has {counted(known, 'coordinate')}.", line=line)
    token = rest[:64].split(maxsplit=1)[0]
    if fault == BAD_CORNER:
        return FormatError(f"OBJ: {quoted(token)} in line {line} is not a vertex number.", line=line)
    number = int(token.partition(b"/")[0])
    if number == 0:
        return FaceIndexOutOfRange("A face refers to vertex 0, but OBJ counts vertices from 1.", vertex=0)
    return FaceIndexOutOfRange(
        f"A face refers to vertex {number}, but has {counted(known, 'vertex')} before it.",
        vertex=number, vertices=known,
    )  # fmt: skip


def _known_keyword(text: bytes) -> bool:
    pattern = rb"(?m)^[ \t]*(v[tnp]?|[flpgos]|usemtl|mtllib|call|csh|vp|deg|cstype)([ \t]|\r?$)"
    return not text.strip() or re.search(pattern, text) is not None
