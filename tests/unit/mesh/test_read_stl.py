"""STL, text and binary, told apart by what they hold and not by the word solid."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.errors import (
    EmptyFile,
    FormatError,
    NoFaces,
    NonFiniteVertices,
    TooManyFaces,
    TooManyVertices,
    TruncatedFile,
)
from reebase.mesh.read import Limits, read
from reebase.mesh.write import to_bytes
from tests.shapes import icosphere, tetrahedron

SOUP = tetrahedron().vertices[tetrahedron().faces].reshape(-1, 3).astype(np.float32).astype(np.float64)


def text(name: str = "thing", newline: str = "\n") -> str:
    lines = [f"solid {name}"]
    for corners in SOUP.reshape(-1, 3, 3).tolist():
        lines += ["  facet normal 0 0 1", "    outer loop"]
        lines += [f"      vertex {x:e} {y!r} {z!r}" for x, y, z in corners]
        lines += ["    endloop", "  endfacet"]
    return newline.join([*lines, f"endsolid {name}", ""])


def binary(header: bytes = b"", count: int | None = None) -> bytes:
    record = np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    records = np.zeros(len(SOUP) // 3, record)
    records["v"] = SOUP.reshape(-1, 3, 3)
    records["n"] = np.nan  # no reader has business with the normals
    records["a"] = 0xFFFF
    number = len(records) if count is None else count
    return header.ljust(80, b"\0") + number.to_bytes(4, "little") + records.tobytes()


@pytest.mark.parametrize(
    "data",
    [
        binary(),
        binary(b"solid made by a CAD program"),
        binary(b"solid facet".ljust(80, b" ")),
        binary() + b"\0\0trailing",
        binary(b"solid x") + b"\0",
        text().encode(),
        text().upper().replace("E+00", "e+00").encode(),
        text(newline="\r\n").encode(),
        text(newline="\r").encode(),
        text(newline=" ").encode(),
        text(name="").encode(),
        text(name="my facet").encode(),
        text(name="a facet of m\u00fcller").encode("latin-1"),
        b"# exported\n" + text().replace("\n", " # c\n").encode(),
        text().replace("endsolid thing\n", "").encode(),
        text().replace("endsolid thing\n", "endsolid").encode(),
        b"\xef\xbb\xbf  \n" + text().encode(),
    ],
)
def test_spellings_of_one_tetrahedron(data: bytes) -> None:
    mesh = read(data, "stl")
    assert np.array_equal(mesh.vertices, SOUP)
    assert np.array_equal(mesh.faces, np.arange(12).reshape(-1, 3))


def test_several_solids_stand_in_their_order() -> None:
    mesh = read((text("one") + text("Two")).encode(), "stl")
    assert np.array_equal(mesh.vertices, np.concatenate([SOUP, SOUP]))
    assert len(mesh.faces) == 8


def test_a_loop_of_four_corners_is_a_polygon() -> None:
    corners = b"vertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\n"
    data = b"solid\nfacet normal 0 0 1\nouter loop\n" + corners + b"endloop\nendfacet\nendsolid\n"
    assert read(data, "stl").faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_long_text_is_read_in_pieces_without_a_seam() -> None:
    rng = np.random.default_rng(5)
    points = rng.normal(size=(9000, 3, 3))
    facets = ""
    for one in points.tolist():
        corners = "".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in one)
        facets += f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n"
    assert len(facets) > 1 << 20
    mesh = read(f"solid\n{facets}endsolid\n".encode(), "stl")
    assert np.array_equal(mesh.vertices, points.reshape(-1, 3))


def test_every_cut_through_a_facet_is_noticed() -> None:
    whole = text().encode()
    complete = {whole.index(b"endfacet", at) + 8 for at in range(len(whole)) if whole.startswith(b"outer", at)}
    ends = [end for start in complete for end in range(start, start + 4)]  # whole facets, white space behind
    first = whole.index(b"facet")
    for cut in range(first + 5, whole.index(b"endsolid")):
        if cut in ends:
            continue
        with pytest.raises((TruncatedFile, FormatError)):
            read(whole[:cut], "stl")


@pytest.mark.parametrize("cut", [10, 84, 85, 134, 250])
def test_truncated_binary(cut: int) -> None:
    with pytest.raises(TruncatedFile):
        read(binary()[:cut], "stl")


@pytest.mark.parametrize("count", [0, 1, 3])
def test_a_count_that_was_never_filled_in_loses_nothing(count: int) -> None:
    whole = to_bytes(tetrahedron(), "stl")
    less = whole[:80] + count.to_bytes(4, "little") + whole[84:]
    assert np.array_equal(read(less, "stl").vertices, read(whole, "stl").vertices)


def test_what_stands_behind_the_triangles_and_is_none_is_passed_over() -> None:
    whole = to_bytes(tetrahedron(), "stl")
    for behind in (b"\x40" * 50, b"junk", b"\xff" * 100):
        assert len(read(whole + behind, "stl").faces) == 4


@pytest.mark.parametrize(
    ("data", "error", "message"),
    [
        (b"", EmptyFile, "empty"),
        (b"Hello, this is a shopping list: milk, eggs, " * 5, FormatError, 'text, but not STL.*"Hello'),
        (b"hello", FormatError, "text, but not STL"),
        (b"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n" * 4, FormatError, "OBJ, OFF or PLY"),
        (b"solid ground is what this letter is about, " * 9, FormatError, "text, but not STL"),
        (binary(count=10**7)[:200], TruncatedFile, "announces 10,000,000 triangles"),
        (binary(count=5), TruncatedFile, "announces 5 triangles"),
        (binary(count=0)[:84], NoFaces, "0 triangles"),
        (b"solid empty\nendsolid empty\n", NoFaces, "no facets"),
        (text().replace("vertex 1", "vertex one").encode(), FormatError, '"one'),
        (text().replace("vertex 1.000000e+00", "vertex nan").encode(), NonFiniteVertices, "vertex"),
    ],
    ids=lambda value: None if isinstance(value, bytes) else str(getattr(value, "code", "")),
)
def test_refusals(data: bytes, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        read(data, "stl")


@pytest.mark.parametrize("data", [binary(), text().encode()], ids=["binary", "text"])
def test_limits(data: bytes) -> None:
    with pytest.raises(TooManyFaces):
        read(data, "stl", limits=Limits(faces=3))
    assert len(read(data, "stl", limits=Limits(vertices=4)).vertices) == 12
    with pytest.raises(TooManyVertices, match="4 vertices or more; the limit is 3"):
        read(data, "stl", limits=Limits(vertices=3))


@pytest.mark.parametrize("subdivisions", [2, 5])
def test_the_limit_on_vertices_counts_different_positions(subdivisions: int) -> None:
    mesh = icosphere(subdivisions)
    count = len(np.unique(mesh.vertices.astype(np.float32), axis=0))
    data = to_bytes(mesh, "stl")
    assert len(read(data, limits=Limits(vertices=count)).faces) == len(mesh.faces)
    with pytest.raises(TooManyVertices):
        read(data, limits=Limits(vertices=count - 1))
