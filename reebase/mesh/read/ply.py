"""Stanford PLY: text and both binary orders, any elements and properties, polygons and triangle strips."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from reebase.errors import FormatError, NoFaces, TruncatedFile, UnsupportedFeature
from reebase.mesh.mesh import Mesh
from reebase.mesh.read.limits import Limits
from reebase.mesh.read.polygons import build, strips
from reebase.mesh.read.records import BinaryCells, Cells, Element, Property, Table, TextCells, read_element
from reebase.mesh.read.text import numbers, quoted
from reebase.words import counted

__all__ = ["read_ply", "read_ply_scalars"]

Ints = npt.NDArray[np.int64]

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
INDEX_LISTS = ("vertex_indices", "vertex_index")
MOST_ELEMENTS = 256
LONGEST_HEADER = 1 << 20


def read_ply(data: bytes, limits: Limits) -> Mesh:
    """The mesh of a PLY file, vertices and faces in their order, polygons and strips triangulated.

    Raises FormatError, MeshError, LimitError.
    """
    return read_ply_scalars(data, limits)[0]


def read_ply_scalars(data: bytes, limits: Limits) -> tuple[Mesh, dict[str, npt.NDArray[np.float64]]]:
    """The mesh and every other scalar property of its vertices, float64, shape (m,)."""
    layout, elements, body = _header(data)
    tables = _tables(_cells(data, body, layout), 0 if layout == "ascii" else body, elements, limits)
    if "vertex" not in tables:
        raise FormatError("PLY: the header announces no vertex element.")
    vertex = tables["vertex"]
    columns = [vertex.scalar(name) for name in "xyz"]
    if any(column is None for column in columns):
        raise FormatError("PLY: the vertex element lacks a scalar property x, y or z.")
    positions = np.stack([np.asarray(column, dtype=np.float64) for column in columns], axis=1)
    corners, sizes = _polygons(tables, len(positions))
    mesh = build(positions, corners, sizes, limits)
    names = [p.name for e in elements if e.name == "vertex" for p in e.properties]
    scalars = {}
    for name in names:
        column = vertex.scalar(name)
        if name not in "xyz" and column is not None:
            scalars[name] = np.asarray(column, dtype=np.float64)
    return mesh, scalars


def _header(data: bytes) -> tuple[str, list[Element], int]:
    """(layout, elements, offset of the body)."""
    match = re.match(rb"(?:\xef\xbb\xbf)?(?i:ply)[ \t]*(\r\n|\n|\r)", data)
    if match is None:
        raise FormatError(f"PLY: the file starts with {quoted(data[:16])}, not with a line that says ply.")
    newline = match.group(1)
    end = re.search(newline + rb"[ \t]*end_header[ \t]*(" + newline + rb"|\Z)", data[:LONGEST_HEADER])
    if end is None:
        raise TruncatedFile(f"PLY: there is no line end_header in the first {LONGEST_HEADER:,} bytes.")
    layout = ""
    found: list[tuple[str, int, list[Property]]] = []
    for line in data[match.end() : end.start()].split(newline):
        words = line.decode("latin-1").split()
        if not words or words[0] in ("comment", "obj_info"):
            continue
        try:
            if words[0] == "format":
                layout = words[1]
            elif words[0] == "element":
                found.append((words[1], int(words[2]), []))
            elif words[0] == "property":
                found[-1][2].append(_property(words))
            else:
                raise FormatError(f"PLY: the header has a line that starts with {quoted(words[0].encode())}.")
        except (IndexError, ValueError, KeyError):
            raise FormatError(f"PLY: the header line {quoted(line, 80)} is not understood.") from None
    if layout not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise FormatError(
            f"PLY: the format is {layout!r}, not ascii, binary_little_endian or binary_big_endian."
        )
    if len(found) > MOST_ELEMENTS or any(count < 0 for _, count, _ in found):
        raise FormatError(
            "PLY: the header announces a negative count, or more elements than any writer makes."
        )
    return layout, [Element(name, count, tuple(listed)) for name, count, listed in found], end.end()


def _property(words: list[str]) -> Property:
    if words[1] != "list":
        return Property(words[2], TYPES[words[1]])
    if TYPES[words[2]][0] == "f":
        raise FormatError(f"PLY: the list {words[4]!r} has a length of type {words[2]}.")
    return Property(words[4], TYPES[words[3]], TYPES[words[2]])


def _cells(data: bytes, body: int, layout: str) -> Cells:
    if layout != "ascii":
        return BinaryCells(data, "<" if layout == "binary_little_endian" else ">")
    text = data[body:]
    try:
        return TextCells(numbers(text, "PLY", offset=body, whole=data))
    except FormatError:
        # Some writers go on with comments behind the header; blanked, so that line numbers in messages stay right.
        blanked = re.sub(rb"(?m)^[ \t]*(comment|obj_info)[^\r\n]*", lambda found: b" " * len(found.group()), text)
        if blanked == text:
            raise
        return TextCells(numbers(blanked, "PLY", offset=body, whole=data))


def _tables(cells: Cells, start: int, elements: list[Element], limits: Limits) -> dict[str, Table]:
    tables: dict[str, Table] = {}
    for element in elements:
        table, start = read_element(cells, start, element)
        if element.name == "vertex":
            limits.check_vertices(element.count)
        tables.setdefault(element.name, table)
        if element.name == "face":
            limits.check_faces(element.count)
    return tables


def _polygons(tables: dict[str, Table], vertices: int) -> tuple[Ints, Ints]:
    """(corners, sizes) of the faces, then of the triangle strips."""
    corners: list[Ints] = []
    sizes: list[Ints] = []
    if "face" in tables and tables["face"].count:
        lists = [found for name in INDEX_LISTS if (found := tables["face"].list(name)) is not None]
        if not lists:
            raise UnsupportedFeature("PLY: the face element has no list vertex_indices or vertex_index.")
        corners.append(_whole(lists[0][0]))
        sizes.append(lists[0][1])
    if "tristrips" in tables and tables["tristrips"].count:
        lists = [found for name in INDEX_LISTS if (found := tables["tristrips"].list(name)) is not None]
        if lists:
            values, lengths = _whole(lists[0][0]), lists[0][1]
            corners.append(strips(np.insert(values, np.cumsum(lengths)[:-1], -1), restart=-1).ravel())
            sizes.append(np.full(len(corners[-1]) // 3, 3, dtype=np.int64))
    if not corners:
        raise NoFaces(f"The PLY file has {counted(vertices, 'vertex')} {'but' if vertices else 'and'} no faces.")
    return np.concatenate(corners), np.concatenate(sizes)


def _whole(values: npt.NDArray[np.generic]) -> Ints:
    """Vertex numbers as int64; some writers declare them as floats."""
    if values.dtype.kind in "iu":
        return values.astype(np.int64)
    floats = values.astype(np.float64)
    if not (np.abs(floats) < 2**53).all() or (floats != np.floor(floats)).any():
        raise FormatError("PLY: a face has a corner that is not a whole number.")
    return floats.astype(np.int64)
