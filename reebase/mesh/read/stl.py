"""STL, text and binary: three vertices a triangle, not merged (that is cleaning's work)."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from reebase.errors import FormatError, NoFaces, TruncatedFile
from reebase.mesh.mesh import Mesh
from reebase.mesh.read.limits import Limits
from reebase.mesh.read.polygons import build
from reebase.mesh.read.text import PIECE, lenient_float, plain_text, quoted, without_comments
from reebase.words import counted

__all__ = ["is_text", "looks_like_text_stl", "read_stl"]

HEADER = 84
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_LOOP = re.compile(rb"(?<!\S)vertex\s+(\S+)\s+(\S+)\s+(\S+)|(?<!\S)(endloop)(?!\S)")
TOKENS = 21
"""Words and numbers of a facet: facet normal n n n outer loop, three times vertex x y z, endloop endfacet."""
_LAYOUT = {
    0: b"facet", 1: b"normal", 5: b"outer", 6: b"loop", 7: b"vertex", 11: b"vertex", 15: b"vertex",
    19: b"endloop", 20: b"endfacet",
}  # fmt: skip
_OPENED = re.compile(rb"(?<!\S)facet\s+normal(\s|\Z)")
_OPENING = re.compile(rb"(?<!\S)facet(\s+\S*)?\Z")


def read_stl(data: bytes, limits: Limits) -> Mesh:
    """The mesh of an STL file: vertices (3 n, 3), faces (n, 3) in the file's order.

    Whether it is text or binary is judged by its size and content, not by the word solid, which many
    binary files start with. The limit on vertices is held against the number of different positions.
    Raises FormatError, MeshError, LimitError.
    """
    announced = int.from_bytes(data[80:HEADER], "little") if len(data) >= HEADER else None
    exact = announced is not None and HEADER + RECORD.itemsize * announced == len(data)
    if not exact and looks_like_text_stl(data):
        return _text(data, limits)
    if announced is None or (not exact and is_text(data)):
        if is_text(data):
            raise FormatError(
                f"This is text, but not STL: text STL starts with solid and has facets, this starts with "
                f"{quoted(data[:32].strip())}. If the file is an OBJ, OFF or PLY, name it so."
            )
        raise TruncatedFile(f"A binary STL has a header of {HEADER} bytes; the file has {len(data)}.")
    return _binary(data, announced, limits)


def is_text(data: bytes) -> bool:
    """Whether the file starts as text: no control characters but white space in its first 1,024 bytes."""
    return re.search(rb"[\x00-\x08\x0e-\x1f\x7f]", data[:1024]) is None


def looks_like_text_stl(data: bytes) -> bool:
    """Whether the file starts with the word solid and goes on as text STL does."""
    start = without_comments(plain_text(data[:65536])).lstrip()[:5].lower()
    if start != b"solid" or not is_text(data):
        return False
    return re.search(rb"(?i)(?<!\S)(facet|endsolid)(?!\S)", data) is not None


def _binary(data: bytes, announced: int, limits: Limits) -> Mesh:
    needed = HEADER + RECORD.itemsize * announced
    if needed > len(data):
        raise TruncatedFile(
            f"The header announces {counted(announced, 'triangle')}, which take {needed:,} bytes, but the file has "
            f"{len(data):,}.",
            announced=announced, needed=needed, found=len(data),
        )  # fmt: skip
    if not announced:
        raise NoFaces("The STL file announces 0 triangles.")
    limits.check_faces(announced)
    corners = np.frombuffer(data, RECORD, announced, HEADER)["corners"]
    return _soup(corners.reshape(-1, 3).astype(np.float64), np.full(announced, 3), limits)


def _text(data: bytes, limits: Limits) -> Mesh:
    text = without_comments(plain_text(data))
    vertices: list[npt.NDArray[np.float64]] = []
    sizes: list[int] = []
    found = 0
    for start, end in _spans(text):
        piece = text[start:end].lower()
        values, some_sizes = _regular(piece) or _loops(piece)
        found += len(values) // 3
        sizes += some_sizes
        limits.check_faces(max(len(sizes), found // 3))
        if len(values) != 3 * sum(some_sizes) or (end == len(text) and _is_cut(piece, bool(some_sizes))):
            raise TruncatedFile("The text STL ends in the middle of a facet.", facets=len(sizes))
        vertices.append(_positions(values, text, start))
    if not sizes:
        raise NoFaces("The text STL has no facets.")
    return _soup(np.concatenate(vertices), np.array(sizes, dtype=np.int64), limits)


def _is_cut(piece: bytes, facets: bool) -> bool:
    """Whether the file's last piece has the beginning of a facet, or something unknown, at its end."""
    tail = piece[piece.rfind(b"endfacet") + len(b"endfacet") :] if facets else piece
    tail = tail.strip()
    if not tail.startswith((b"endsolid", b"solid")) and not b"endsolid".startswith(tail):
        return True
    _, ended, rest = tail.rpartition(b"endsolid")
    # Behind endsolid stands a name, which may be any word.
    return _OPENED.search(rest) is not None or (not ended and _OPENING.search(rest) is not None)


def _regular(piece: bytes) -> tuple[list[bytes], list[int]] | None:
    """As ``_loops``, for a piece that is nothing but facets of three vertices in the usual order, else None."""
    tokens = piece.split()
    facets, rest = divmod(len(tokens), TOKENS)
    if rest or any(tokens[at::TOKENS].count(word) != facets for at, word in _LAYOUT.items()):
        return None
    values = [b""] * (9 * facets)
    for corner in range(3):
        for axis in range(3):
            values[3 * corner + axis :: 9] = tokens[8 + 4 * corner + axis :: TOKENS]
    return values, [3] * facets


def _loops(piece: bytes) -> tuple[list[bytes], list[int]]:
    """(coordinates of all vertices in a row, vertices of each closed loop) of a piece in lower case."""
    values: list[bytes] = []
    sizes: list[int] = []
    closed = 0
    for x, y, z, ended in _LOOP.findall(piece):
        if ended:
            sizes.append((len(values) - closed) // 3)
            closed = len(values)
        else:
            values += (x, y, z)
    return values, sizes


def _spans(text: bytes) -> Iterator[tuple[int, int]]:
    """Pieces of about PIECE bytes that end behind a facet; the first is up to the first facet."""
    first = re.compile(rb"(?i)(?<!\S)facet\s+normal\s").search(text)
    start = first.start() if first else 0
    if start:
        yield 0, start
    while start < len(text):
        found = re.compile(rb"(?i)endfacet\s").search(text, start + PIECE)
        end = len(text) if found is None else found.end()
        yield start, end
        start = end


def _positions(values: list[bytes], text: bytes, start: int) -> npt.NDArray[np.float64]:
    try:
        flat = np.fromiter(map(float, values), np.float64, len(values))
    except ValueError:
        flat = np.empty(len(values))
        for i, token in enumerate(values):
            try:
                flat[i] = lenient_float(token)
            except ValueError:
                line = text.count(b"\n", 0, text.lower().find(token, start)) + 1
                raise FormatError(
                    f"STL: {quoted(token)} near line {line} stands where a coordinate is expected.", line=line
                ) from None
    return flat.reshape(-1, 3)


def _soup(vertices: npt.NDArray[np.float64], sizes: npt.NDArray[np.int64], limits: Limits) -> Mesh:
    if len(vertices) > limits.vertices:
        # STL repeats a vertex for every triangle at it; the limit is meant for what merging leaves.
        limits.check_vertices(_distinct(vertices))
        limits = dataclasses.replace(limits, vertices=len(vertices))
    return build(vertices, np.arange(len(vertices)), sizes, limits)


def _distinct(points: npt.NDArray[np.float64]) -> int:
    """How many different positions there are, by a hash of 64 bits."""
    bits = (points + 0.0).view(np.uint64)  # minus zero is zero
    mixed = bits[:, 0] * np.uint64(0x9E3779B97F4A7C15)
    for axis in (1, 2):
        mixed = (mixed ^ (mixed >> np.uint64(29)) ^ bits[:, axis]) * np.uint64(0xBF58476D1CE4E5B9)
    return len(np.unique(mixed ^ (mixed >> np.uint64(32))))
