"""OBJ as people write it, and as it should be refused."""

from __future__ import annotations

import numpy as np
import pytest

from reebase.errors import FaceIndexOutOfRange, FormatError, NoFaces, NonFiniteVertices, TooManyFaces, TooManyVertices
from reebase.mesh.read import Limits, read

SQUARE = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
CORNERS = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


@pytest.mark.parametrize(
    "face",
    [
        b"f 1 2 3 4", b"f 1/1 2/2 3/3 4/4", b"f 1//1 2//1 3//1 4//1", b"f 1/1/1 2/2/1 3/3/1 4/4/1",
        b"f -4 -3 -2 -1", b"f -4/-1 -3/-1 -2/-1 -1/-1", b"f 1 2 \\\n 3 4", b"f 1 2 \\\r\n3 4", b"  f\t1  2 3\t4  ",
        b"f 1 2 3 4 # a comment", b"fo 1 2 3 4",
    ],
)  # fmt: skip
def test_spellings_of_one_face(face: bytes) -> None:
    mesh = read(SQUARE + face + b"\n", "obj")
    assert mesh.vertices.tolist() == CORNERS
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize("newline", [b"\n", b"\r\n", b"\r"])
def test_line_ends(newline: bytes) -> None:
    text = (b"# made by hand\n" + SQUARE + b"f 1 2 3\nf 1 3 4").replace(b"\n", newline)
    assert read(text, "obj").faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_what_is_no_geometry_is_passed_over() -> None:
    text = (
        b"\xef\xbb\xbfmtllib a b.mtl\no f 1 2 9\ng An f Three Other Things\nvn 0 0 1\nvt 0 0\nusemtl v 1\ns off\n"
        + SQUARE
        + b"l 1 2 3\np 1\nf 1 2 3\ncurv 0 1 1 2\n"
    )
    assert read(text, "obj").faces.tolist() == [[0, 1, 2]]


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1), ("+2.", 2), ("-.5", -0.5), ("1e2", 100), ("1E-2", 0.01), ("2.e1", 20), ("3.1+e2", 310),
        ("1.5D+02", 150), ("1d3", 1000), ("0x", None), ("1,5", None), ("abc", None),
    ],
)  # fmt: skip
def test_numbers(text: str, value: float | None) -> None:
    data = SQUARE + f"v {text} 0 0\nf 1 2 3\n".encode()
    if value is None:
        with pytest.raises(FormatError, match="line 5"):
            read(data, "obj")
    else:
        assert read(data, "obj").vertices[4, 0] == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize("extra", [b"1.0", b"0.5", b"0.1 0.2 0.3", b"0.1 0.2 0.3 1"])
def test_weights_and_colours_do_not_move_a_vertex(extra: bytes) -> None:
    text = SQUARE.replace(b"\n", b" " + extra + b"\n") + b"f 1 2 3\n"
    assert read(text, "obj").vertices.tolist() == CORNERS


def test_vertices_of_different_length_and_drawings_in_the_plane() -> None:
    mesh = read(b"v 0 0\nv 1 0 0 1\nv 1 1 0 .1 .2 .3\nf 1 2 3\n", "obj")
    assert mesh.vertices.tolist() == CORNERS[:3]


def test_faces_may_come_before_their_vertices() -> None:
    assert read(b"f 1 2 3\n" + SQUARE, "obj").faces.tolist() == [[0, 1, 2]]


def test_negative_numbers_count_from_the_line_of_the_face() -> None:
    text = SQUARE + b"f -4 -3 -2\n" + SQUARE + b"f -4 -3 -2\nf -8 -1 2\n"
    assert read(text, "obj").faces.tolist() == [[0, 1, 2], [4, 5, 6], [0, 7, 1]]


def test_long_files_are_read_in_pieces_without_a_seam() -> None:
    rng = np.random.default_rng(3)
    vertices = rng.normal(size=(40_000, 3))
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    for at in range(3, 40_000, 40):
        lines.insert(at, f"f -{at % 3 + 1} -2 -3")
    mesh = read("\n".join(lines).encode(), "obj")
    assert np.array_equal(mesh.vertices, vertices)
    before = [sum(line[0] == "v" for line in lines[:i]) for i, line in enumerate(lines) if line[0] == "f"]
    ends = [[int(t) for t in line.split()[1:]] for line in lines if line[0] == "f"]
    assert mesh.faces.tolist() == [[n + i for i in face] for n, face in zip(before, ends, strict=True)]


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        (SQUARE, NoFaces, "4 vertices but no face"),
        (b"# nothing\n", NoFaces, "0 vertices and no faces"),
        (b"v 1 2 3\n", NoFaces, "1 vertex but no faces"),
        (SQUARE + b"l 1 2\n", NoFaces, "no face"),
        (SQUARE + b"f 1 2\n", NoFaces, "."),
        (SQUARE + b"f 1 2 5\n", FaceIndexOutOfRange, "Face 1 refers to vertex 5, but there are only 4"),
        (SQUARE + b"f 0 1 2\n", FaceIndexOutOfRange, "counts vertices from 1"),
        (SQUARE + b"f -5 1 2\n", FaceIndexOutOfRange, "vertex -5, but has 4 vertices"),
        (SQUARE + b"f 1 2 x\n", FormatError, '"x" in line 5'),
        (SQUARE + b"f 1 2 3.5\n", FormatError, "line 5"),
        (SQUARE + b"f 1 2 99999999999999999999\n", FormatError, "line 5"),
        (SQUARE + b"v 1\nf 1 2 3\n", FormatError, "line 5 has 1 coordinate\\."),
        (SQUARE + b"v nan 0 0\nf 1 2 5\n", NonFiniteVertices, "vertex 4"),
        (SQUARE + b"v 1.#QNAN 0 0\nf 1 2 5\n", NonFiniteVertices, "vertex 4"),
        (SQUARE + b"v 1e999 0 0\nf 1 2 5\n", NonFiniteVertices, "vertex 4"),
        (b"Dear Sir or Madam,\nthe mesh is attached.\n", FormatError, "no line of an OBJ"),
        (b"f " + b"1 " * 10_000_000, FormatError, "a line of more than"),
    ],
    ids=lambda value: None if isinstance(value, bytes) else str(getattr(value, "code", "")),
)
def test_refusals(text: bytes, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        read(text, "obj")


def test_limits_hold_before_the_end_of_the_file() -> None:
    with pytest.raises(TooManyVertices):
        read(SQUARE + b"f 1 2 3\n", "obj", limits=Limits(vertices=3))
    with pytest.raises(TooManyFaces):
        read(SQUARE + b"f 1 2 3 4\n", "obj", limits=Limits(faces=1))
