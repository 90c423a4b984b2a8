"""PLY in text and both binary orders, from a writer of any element that lives here and knows nothing of the reader."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from reebase.errors import (
    FaceIndexOutOfRange,
    FormatError,
    NoFaces,
    NonFiniteVertices,
    TooManyFaces,
    TooManyVertices,
    TruncatedFile,
    UnsupportedFeature,
)
from reebase.mesh.read import Limits, read, read_scalars

CODES = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f", "double": "d",
    "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float32": "f",
    "float64": "d",
}  # fmt: skip
LAYOUTS = ("ascii", "binary_little_endian", "binary_big_endian")
XYZ = ["float x", "float y", "float z"]
CORNERS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
INDICES = "list uchar int vertex_indices"

Element = tuple[str, list[str], Sequence[Sequence[Any]]]


def ply(layout: str, *elements: Element, newline: str = "\n", comment: str = "comment obj_info") -> bytes:
    """A PLY file: each element is (name, properties as in the header, rows of numbers and lists)."""
    header = ["ply", f"format {layout} 1.0", comment]
    for name, properties, rows in elements:
        header += [f"element {name} {len(rows)}", *(f"property {p}" for p in properties)]
    body = b""
    order = ">" if "big" in layout else "<"
    for _, properties, rows in elements:
        for row in rows:
            words = []
            for declared, value in zip(properties, row, strict=True):
                types = declared.split()[:-1]
                values = [len(value), *value] if types[0] == "list" else [value]
                codes = CODES[types[-2]] + CODES[types[-1]] * len(value) if types[0] == "list" else CODES[types[0]]
                words += [repr(v) for v in values]
                body += struct.pack(order + codes, *values) if layout != "ascii" else b""
            body += (" ".join(words) + newline).encode() if layout == "ascii" else b""
    return newline.join([*header, "end_header", ""]).encode() + body


def square(layout: str, **kwargs: Any) -> bytes:
    return ply(layout, ("vertex", XYZ, CORNERS), ("face", [INDICES], [[[0, 1, 2, 3]]]), **kwargs)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_line_ends(layout: str, newline: str) -> None:
    mesh = read(square(layout, newline=newline), "ply")
    assert mesh.vertices.tolist() == CORNERS
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_body_that_starts_like_a_line_end(layout: str) -> None:
    # 0x0A as the first byte of the body must not be taken for the end of a CR LF.
    first = struct.unpack("<f", b"\n\x00\x00\x41")[0]
    data = ply(layout, ("vertex", XYZ, [[first, 0, 0], *CORNERS[1:]]), ("face", [INDICES], [[[0, 1, 2]]]), newline="\r")
    assert read(data, "ply").vertices[0, 0] == pytest.approx(first)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("length", ["uchar", "char", "ushort", "short", "uint", "int", "uint8", "int32"])
@pytest.mark.parametrize("kind", ["char", "uchar", "short", "ushort", "int", "uint", "int32", "uint16", "float"])
def test_lists_of_any_type(layout: str, length: str, kind: str) -> None:
    rows = [[[0, 1, 2]], [[0, 1, 2, 3]], [[1, 2]], [[2, 3, 0]]]
    data = ply(layout, ("vertex", XYZ, CORNERS), ("face", [f"list {length} {kind} vertex_index"], rows))
    assert read(data, "ply").faces.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3], [2, 3, 0]]


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("even", [True, False])
def test_extra_elements_and_properties_anywhere(layout: str, even: bool) -> None:
    listed = [[3.0, 4.0]] * 4 if even else [[], [1.0], [2.0, 3.0], [1.0, 2.0, 3.0]]
    vertices = [[7, *point, extra, 9] for point, extra in zip(CORNERS, listed, strict=True)]
    faces = [[0.5, [0.0] * 6, [0, 1, 2], 255], [0.5, [0.0] * (6 if even else 2), [0, 2, 3], 255]]
    data = ply(
        layout,
        ("material", ["list uchar char name", "float shine"], [[[65, 66], 0.5], [[67], 1.0]]),
        ("face", ["float quality", "list uchar float texcoord", INDICES, "uchar red"], faces),
        ("nothing", [], [[], [], []]),
        ("edge", ["int vertex1", "int vertex2"], [[0, 1], [1, 2]]),
        ("vertex", ["int label", *XYZ, "list ushort double samples", "uchar flag"], vertices),
    )
    mesh, scalars = read_scalars(data)
    assert mesh.vertices.tolist() == CORNERS
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert {name: values.tolist() for name, values in scalars.items()} == {"label": [7.0] * 4, "flag": [9.0] * 4}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("kind", ["float", "double", "int", "uchar", "short"])
def test_coordinates_of_any_type_in_any_order(layout: str, kind: str) -> None:
    rows = [[z, x, y] for x, y, z in CORNERS]
    data = ply(layout, ("vertex", [f"{kind} z", f"{kind} x", f"{kind} y"], rows), ("face", [INDICES], [[[0, 1, 2]]]))
    assert read(data, "ply").vertices.tolist() == CORNERS


@pytest.mark.parametrize("layout", LAYOUTS)
def test_doubles_are_exact(layout: str) -> None:
    points = np.random.default_rng(1).normal(size=(50, 3))
    vertices = ("vertex", ["double x", "double y", "double z"], points.tolist())
    data = ply(layout, vertices, ("face", [INDICES], [[[0, 1, 2]]]))
    assert np.array_equal(read(data, "ply").vertices, points)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_triangle_strips(layout: str) -> None:
    strip = [[0, 1, 2, 3, -1, 3, 2, 1]]
    data = ply(layout, ("vertex", XYZ, CORNERS), ("tristrips", ["list int int vertex_indices"], [strip, [[0, 1, 2]]]))
    assert read(data, "ply").faces.tolist() == [[0, 1, 2], [3, 2, 1], [3, 2, 1], [0, 1, 2]]


def test_text_is_free_in_its_lines_and_may_hold_comments() -> None:
    data = square("ascii").replace(b"end_header\n", b"end_header\n\ncomment one\n")
    data = data.replace(b"1 1 0\n", b"1\n1 0 comment\n".replace(b" comment", b"") + b"  comment two 2\n\n")
    assert read(data, "ply").faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_bytes_behind_the_last_element_are_passed_over() -> None:
    assert len(read(square("binary_little_endian") + b"\0more", "ply").faces) == 2


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("even", [True, False])
def test_every_truncation_of_the_body_is_noticed(layout: str, even: bool) -> None:
    faces = [[[0, 1, 2]], [[0, 2, 3] if even else [0, 1, 2, 3]], [[1, 2, 3]]]
    data = ply(layout, ("vertex", XYZ, CORNERS), ("face", [INDICES], faces))
    start = data.index(b"end_header") + 11
    end = len(data) if layout != "ascii" else len(data.rstrip())
    for cut in range(start, end):
        with pytest.raises(TruncatedFile):
            read(data[:cut], "ply")
    with pytest.raises(TruncatedFile, match="end_header"):
        read(data[: start - 5], "ply")


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("announced", [3, 10**7, 10**30])
def test_a_header_that_lies(layout: str, announced: int) -> None:
    data = square(layout).replace(b"element face 1", f"element face {announced}".encode())
    with pytest.raises(TruncatedFile, match=f"announces {announced:,} face records|ends within"):
        read(data, "ply")
    data = square(layout).replace(b"element vertex 4", f"element vertex {announced * 10}".encode())
    with pytest.raises(TruncatedFile, match=f"announces {announced * 10:,} vertex records"):
        read(data, "ply")


def _with(old: bytes, new: bytes, layout: str = "ascii") -> bytes:
    data = square(layout)
    assert old in data
    return data.replace(old, new)


@pytest.mark.parametrize(
    ("data", "error", "message"),
    [
        (b"solid\n", FormatError, "starts with"),
        (_with(b"ascii", b"utf8"), FormatError, "'utf8'"),
        (_with(b"float x", b"half x"), FormatError, "half x"),
        (_with(b"float x", b"float t"), FormatError, "lacks"),
        (_with(b"property float x", b"list uchar float x"), FormatError, "a line that starts with"),
        (_with(b"property float x", b"property list uchar float x"), FormatError, "."),
        (_with(b"element vertex 4", b"element vertex many"), FormatError, "many"),
        (_with(b"element vertex 4", b"element vertex -4"), FormatError, "negative"),
        (_with(b"element vertex 4", b"element point 4"), FormatError, "no vertex element"),
        (_with(b"list uchar int", b"list float int"), FormatError, "length of type float"),
        (_with(b"vertex_indices", b"corners"), UnsupportedFeature, "vertex_indices"),
        (_with(b"1 1 0\n", b"1 one 0\n"), FormatError, '"one" in line 13'),
        (_with(b"4 0 1 2 3", b"4 0 1 2 7"), FaceIndexOutOfRange, "vertex 7"),
        (_with(b"4 0 1 2 3", b"4 0 1 2 -1"), FaceIndexOutOfRange, "vertex -1"),
        (_with(b"4 0 1 2 3", b"4 0 1 2 2.5"), FormatError, "fraction"),
        (_with(b"4 0 1 2 3", b"4 0 1 2 1e300"), FormatError, "integer"),
        (_with(b"4 0 1 2 3", b"-4 0 1 2 3"), FormatError, "length -4"),
        (_with(b"4 0 1 2 3", b"3.5 0 1 2 3"), FormatError, "not a whole number"),
        (_with(b"4 0 1 2 3", b"1e300 0 1 2 3"), TruncatedFile, "."),
        (_with(b"1 1 0\n", b"1 nan 0\n"), NonFiniteVertices, "vertex 2"),
        (_with(b"1 1 0\n", b"1 -inf 0\n"), NonFiniteVertices, "vertex 2"),
        (ply("ascii", ("vertex", XYZ, CORNERS)), NoFaces, "4 vertices but no faces"),
        (ply("ascii", ("vertex", XYZ, CORNERS), ("face", [INDICES], [])), NoFaces, "."),
        (ply("ascii", ("vertex", XYZ, []), ("face", [INDICES], [])), NoFaces, "."),
        (ply("ascii", ("vertex", XYZ, CORNERS), ("face", [INDICES], [[[0, 1]], [[]]])), NoFaces, "."),
    ],
    ids=lambda value: None if isinstance(value, bytes) else str(getattr(value, "code", "")),
)
def test_refusals(data: bytes, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        read(data, "ply")


@pytest.mark.parametrize("layout", LAYOUTS)
def test_limits(layout: str) -> None:
    with pytest.raises(TooManyVertices):
        read(square(layout), "ply", limits=Limits(vertices=3))
    with pytest.raises(TooManyFaces):
        read(square(layout), "ply", limits=Limits(faces=1))


def test_a_signalling_nan_is_refused_without_a_warning() -> None:
    data = bytearray(square("binary_little_endian"))
    at = data.index(b"end_header\n") + 11
    data[at : at + 4] = b"\x01\x00\xa0\x7f"
    with pytest.raises(NonFiniteVertices):
        read(bytes(data), "ply")
