"""OFF in all its headers and layouts."""

from __future__ import annotations

import struct

import pytest

from reebase.errors import (
    FaceIndexOutOfRange,
    FormatError,
    NoFaces,
    NonFiniteVertices,
    TooManyVertices,
    TruncatedFile,
    UnsupportedFeature,
)
from reebase.mesh.read import Limits, read

CORNERS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
FACES = [[0, 1, 2], [0, 2, 3]]
POINTS = b"0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
SQUARE = POINTS + b"4 0 1 2 3\n"


def rows(extra: bytes) -> bytes:
    return POINTS.replace(b"\n", b" " + extra + b"\n") + b"4 0 1 2 3\n"


@pytest.mark.parametrize(
    "text",
    [
        b"OFF\n4 1 4\n" + SQUARE,
        b"OFF 4 1 4\n" + SQUARE,
        b"OFF4 1 4\n" + SQUARE,
        b"OFF\n4 1\n" + SQUARE,
        b"off\n4 1 0\n" + SQUARE,
        b"4 1 4\n" + SQUARE,
        b"# first\n\n  OFF # word\n\n4 1 0 # counts\n\n" + SQUARE.replace(b"\n", b" # c\n\n") + b"# last",
        (b"OFF\n4 1 4\n" + SQUARE).replace(b"\n", b"\r\n"),
        (b"OFF\n4 1 4\n" + SQUARE).replace(b"\n", b"\r"),
        b"OFF\n4 1 4\n" + SQUARE.rstrip() + b" 1.0 0.0 0.0\n",
        b"OFF\n4 1 4\n" + SQUARE.rstrip() + b" 3\n",
        b"OFF\n4 1 4\n" + rows(b"255 0 0"),
        b"COFF\n4 1 4\n" + rows(b"1 0 0 1"),
        b"COFF\n4 1 4\n" + rows(b"255 0 0"),
        b"NOFF\n4 1 4\n" + rows(b"0 0 1"),
        b"CNOFF\n4 1 4\n" + rows(b"0 0 1 1 0 0 1"),
        b"STOFF\n4 1 4\n" + rows(b"0.5 0.5"),
        b"STCN4OFF\n4 1 4\n" + rows(b"1 0 0 1 1 0 0 1 0.5 0.5"),
        b"4OFF\n4 1 4\n0 0 0 2\n2 0 0 2\n3 3 0 3\n0 1 0 1\n4 0 1 2 3\n",
        b"3OFF\n".replace(b"3", b"n") + b"3\n4 1 4\n" + SQUARE,
        b"OFF 4 1 4 0 0 0 1 0 0 1 1 0 0 1 0 4 0 1 2 3",
        b"OFF\n4\n1\n4\n0 0 0 1 0 0\n1 1 0 0 1 0\n4\n0 1\n2 3\n",
        b"OFF\n4 2 0\n0 0 0 1 0 0 1 1 0 0 1 0\n3 0 1 2 3 0 2 3",
        b"COFF 4 1 4\n0 0 0 1 1 1 1 1 0 0 1 1 1 1\n1 1 0 1 1 1 1 0 1 0 1 1 1 1 4 0 1 2 3",
        b"COFF 4 1 4\n0 0 0 1 1 1 1 0 0 1 1 1\n1 1 0 1 1 1 0 1 0 1 1 1 4 0 1 2 3",
    ],
)
def test_spellings_of_one_square(text: bytes) -> None:
    mesh = read(text, "off")
    assert mesh.vertices.tolist() == CORNERS
    assert mesh.faces.tolist() == FACES


def test_faces_of_all_sizes_with_colours() -> None:
    text = b"OFF\n4 4 0\n" + POINTS + b"3 0 1 2 0.1 0.2 0.3\n2 0 1\n4 0 1 2 3 7\n1 0\n"
    assert read(text, "off").faces.tolist() == [[0, 1, 2], *FACES]


@pytest.mark.parametrize("colour", [[], [1.0, 0.0, 0.0, 1.0]])
def test_binary(colour: list[float]) -> None:
    body = struct.pack(">3i", 4, 2, 0)
    for corner in CORNERS:
        body += struct.pack(">3f", *corner)
    for face in (FACES[0], FACES[1]):
        body += struct.pack(">i3i", 3, *face) + struct.pack(f">i{len(colour)}f", len(colour), *colour)
    mesh = read(b"OFF BINARY\n" + body, "off")
    assert mesh.vertices.tolist() == CORNERS
    assert mesh.faces.tolist() == FACES
    with pytest.raises(TruncatedFile):
        read(b"OFF BINARY\n" + body[:-2], "off")
    with pytest.raises(TruncatedFile):
        read(b"OFF BINARY\n" + body[:7], "off")
    with pytest.raises(TruncatedFile):
        read(b"OFF BINARY\n" + struct.pack(">3i", 4, 10**7, 0) + body[12:], "off")


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        (b"OFF\n353535235358 6 0\n" + SQUARE, TruncatedFile, "announces 353,535,235,358 vertices"),
        (b"OFF\n4 10000000 0\n" + SQUARE, TruncatedFile, "10,000,000 faces"),
        (b"OFF\n4 1 0\n" + SQUARE[:-3], TruncatedFile, "."),
        (b"OFF\n4 1 0\n" + POINTS, TruncatedFile, "."),
        (b"OFF\n4 2 0\n" + SQUARE, TruncatedFile, "."),
        (b"OFF\n", TruncatedFile, "before the counts"),
        (b"OFF\n4\n", TruncatedFile, "before the counts"),
        (b"OFF\n-4 1 0\n" + SQUARE, FormatError, "announces -4"),
        (b"OFF\nfour 1 0\n" + SQUARE, FormatError, "counts are expected"),
        (b"OFF\n4 1 0\n" + SQUARE.replace(b"1 1 0", b"1 x 0"), FormatError, '"x" in line 5'),
        (b"OFF\n4 1 0\n" + POINTS + b"4 0 1 2 9\n", FaceIndexOutOfRange, "vertex 9"),
        (b"OFF\n4 1 0\n" + POINTS + b"-4 0 1 2 3\n", FormatError, "."),
        (b"OFF\n4 1 0\n" + SQUARE.replace(b"1 1 0", b"1 nan 0"), NonFiniteVertices, "vertex 2"),
        (b"4OFF\n4 1 0\n" + rows(b"0"), NonFiniteVertices, "vertex 0"),
        (b"4OFF\n4 1 0\n" + SQUARE, FormatError, "fewer than four"),
        (b"nOFF\n4\n4 1 0\n" + rows(b"1"), UnsupportedFeature, "three dimensions"),
        (b"OFF\n4 0 0\n" + POINTS, NoFaces, "."),
        (b"OFF\n0 0 0\n", NoFaces, "."),
        (b"hello world", FormatError, "not with OFF or counts"),
        (b"\xff\xfe\x00", FormatError, "UTF-16"),
    ],
)
def test_refusals(text: bytes, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        read(text, "off")


def test_limits() -> None:
    with pytest.raises(TooManyVertices):
        read(b"OFF\n4 1 0\n" + SQUARE, "off", limits=Limits(vertices=3))
