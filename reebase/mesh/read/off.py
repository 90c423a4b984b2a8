"""Geomview OFF in all its headers ([ST][C][N][4]OFF), one record a line or free of lines, and OFF BINARY."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from reebase.errors import FormatError, ReebaseError, TruncatedFile, UnsupportedFeature
from reebase.mesh.mesh import Mesh
from reebase.mesh.read.limits import Limits
from reebase.mesh.read.polygons import build
from reebase.mesh.read.records import BinaryCells, Element, Property, TextCells, read_element
from reebase.mesh.read.text import numbers, plain_text, quoted, repaired, tokens, without_comments
from reebase.words import counted

__all__ = ["HEADER", "read_off"]

HEADER = re.compile(rb"\s*(ST)?(C)?(N)?(4)?(n)?(?i:OFF)(?![A-Za-z_])")
_COUNTS = re.compile(rb"\s*(\S+)\s+(\S+)(?:[ \t]+(\S+))?[ \t]*(?=[\r\n]|\Z)")
_FREE_COUNTS = re.compile(rb"\s*(\S+)\s+(\S+)\s+(\S+)")

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


def read_off(data: bytes, limits: Limits) -> Mesh:
    """The mesh of an OFF file, vertices and faces in their order, polygons triangulated.

    Colours, normals and texture coordinates are passed over; in 4OFF the fourth coordinate divides the
    others. Raises FormatError, MeshError, LimitError.
    """
    start = HEADER.match(data)
    if start is not None and (binary := re.compile(rb"[ \t]+BINARY[^\n]*\n").match(data, start.end())):
        return _binary(data, binary.end(), start, limits)
    text = without_comments(plain_text(data))
    header = HEADER.match(text)
    body = text[header.end() if header else 0 :]
    if header is not None and header.group(5):
        dimension = re.match(rb"\s*(\d+)", body)
        if dimension is None or int(dimension.group(1)[:9]) != 3:
            raise UnsupportedFeature("nOFF: only three dimensions are read.")
        body = body[dimension.end() :]
    if header is None and re.match(rb"\s*\d+\s+\d+\s+\d+\s", body) is None:
        raise FormatError(f"OFF: the file starts with {quoted(body[:16])}, not with OFF or counts.")
    counts = _COUNTS.match(body)
    by_line = None
    if counts is not None:
        vertex_count, face_count = _announced(counts, body, limits)
        by_line = _by_line(body[counts.end() :], vertex_count, face_count)
    if by_line is not None:
        positions, corners, sizes = by_line
    else:
        counts = _FREE_COUNTS.match(body)
        if counts is None:
            raise TruncatedFile("OFF: the file ends before the counts of vertices and faces.")
        vertex_count, face_count = _announced(counts, body, limits)
        start_of_data = len(text) - len(body) + counts.end()
        positions, corners, sizes = _free(text, start_of_data, vertex_count, face_count, header)
    return build(_cartesian(positions, header), corners, sizes, limits)


def _announced(counts: re.Match[bytes], body: bytes, limits: Limits) -> tuple[int, int]:
    """Vertex and face counts of the header, held against the size of the file."""
    try:
        vertices, faces = int(counts.group(1)), int(counts.group(2))
    except ValueError:
        found = quoted(counts.group(0).strip())
        raise FormatError(f"OFF: {found} stands where the counts are expected.") from None
    if vertices < 0 or faces < 0:
        raise FormatError(f"OFF: the header announces {counted(vertices, 'vertex')} and {counted(faces, 'face')}.")
    least = vertices * 6 + faces * 2
    if least - 1 > len(body) - counts.end():
        raise TruncatedFile(
            f"The header announces {counted(vertices, 'vertex')} and {counted(faces, 'face')}, which take at least "
            f"{least:,} bytes, but the file has only {len(body) - counts.end():,} left.",
            vertices=vertices, faces=faces,
        )  # fmt: skip
    limits.check_vertices(vertices)
    limits.check_faces(faces)
    return vertices, faces


def _by_line(body: bytes, vertex_count: int, face_count: int) -> tuple[Floats, Ints, Ints] | None:
    """One record a line, colours behind it; None when the lines do not fit that."""
    values, starts, odd = tokens(body)
    if len(starts) < vertex_count + face_count:
        return None
    ends = np.append(starts[1:], len(values))[: vertex_count + face_count]
    starts = starts[: vertex_count + face_count]
    width = int(ends[0] - starts[0]) if vertex_count else 3
    if width < 3 or (ends - starts != width)[:vertex_count].any():
        return None
    try:
        repaired(values, odd[odd[:, 0] < vertex_count * width], body, "OFF", body, 0)
    except FormatError:
        return None
    positions = values[: vertex_count * width].reshape(-1, width)
    faces = _face_lines(values, starts[vertex_count:], ends[vertex_count:])
    return None if faces is None else (positions, *faces)


def _face_lines(values: Floats, starts: Ints, ends: Ints) -> tuple[Ints, Ints] | None:
    """(corners, sizes) of the lines, colours left out; None when one is too short or says no whole number."""
    counts = values[starts]
    if not ((counts >= 0) & (counts < ends - starts)).all():  # an odd token is NaN
        return None
    sizes = counts.astype(np.int64)
    if len(sizes) and (sizes == sizes[0]).all():
        corners = values[starts[:, None] + np.arange(1, sizes[0] + 1)].ravel()
    else:
        within = np.arange(int(sizes.sum())) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        corners = values[np.repeat(starts + 1, sizes) + within]
    if (counts != sizes).any() or not (np.abs(corners) < 2**53).all() or (corners != np.floor(corners)).any():
        return None
    return corners.astype(np.int64), sizes


def _free(
    text: bytes, start: int, vertex_count: int, face_count: int, header: re.Match[bytes] | None
) -> tuple[Floats, Ints, Ints]:
    """Numbers in a row, lines mean nothing; so there can be no colours of faces."""
    cells = TextCells(numbers(text[start:], "OFF", offset=start, whole=text))
    refusal: ReebaseError | None = None
    for width in _widths(header):
        names = tuple(Property(str(i), "f8") for i in range(width))
        try:
            vertices, at = read_element(cells, 0, Element("vertex", vertex_count, names))
            corner_list = (Property("corners", "i8", "i8"),)
            faces, at = read_element(cells, at, Element("face", face_count, corner_list))
            corners, sizes = faces.list("corners") or (np.zeros(0, np.int64), np.zeros(0, np.int64))
            if at != cells.end:
                raise FormatError(
                    f"OFF: the file goes on for {counted(cells.end - at, 'number')} behind "
                    f"{counted(vertex_count, 'vertex')} and {counted(face_count, 'face')}, and "
                    "does not have one vertex or face a line either."
                )
        except FormatError as error:
            refusal = refusal or error
            continue
        columns = [vertices.scalar(str(i)) for i in range(width)]
        return np.stack([np.asarray(column) for column in columns], axis=1), corners, sizes
    raise refusal or FormatError()


def _widths(header: re.Match[bytes] | None) -> list[int]:
    """Numbers a vertex may have by the header; colours are four by the book and three in the wild."""
    if header is None:
        return [3]
    texture, colour, normal, fourth = (header.group(i) is not None for i in range(1, 5))
    width = 3 + fourth + 3 * normal + 2 * texture
    return [width + 4, width + 3] if colour else [width]


def _cartesian(rows: Floats, header: re.Match[bytes] | None) -> Floats:
    if header is None or not header.group(4):
        return rows[:, :3]
    if rows.shape[1] < 4:
        raise FormatError("4OFF: a vertex has fewer than four coordinates.")
    return rows[:, :3] / rows[:, 3:4]


def _binary(data: bytes, at: int, header: re.Match[bytes], limits: Limits) -> Mesh:
    """Big-endian int32 and float32; a colour of a vertex is four floats, that of a face a list."""
    if header.group(5):
        raise UnsupportedFeature("nOFF BINARY is not read; save the mesh as text OFF or PLY.")
    if len(data) < at + 12:
        raise TruncatedFile("OFF BINARY: the file ends before the counts of vertices and faces.")
    vertex_count, face_count, _ = (int(n) for n in np.frombuffer(data, ">i4", 3, at))
    if vertex_count < 0 or face_count < 0:
        raise FormatError(
            f"OFF BINARY: the header announces {counted(vertex_count, 'vertex')} and {counted(face_count, 'face')}."
        )
    cells = BinaryCells(data, ">")
    width = _widths(header)[0]
    listed = tuple(Property(str(i), "f4") for i in range(width))
    vertices, at = read_element(cells, at + 12, Element("vertex", vertex_count, listed))
    limits.check_vertices(vertex_count)
    corner_list = (Property("corners", "i4", "i4"), Property("colour", "f4", "i4"))
    faces, _ = read_element(cells, at, Element("face", face_count, corner_list))
    limits.check_faces(face_count)
    rows = np.stack([np.asarray(vertices.scalar(str(i)), np.float64) for i in range(width)], axis=1)
    corners, sizes = faces.list("corners") or (np.zeros(0, np.int64), np.zeros(0, np.int64))
    return build(_cartesian(rows, header), corners, sizes, limits)
