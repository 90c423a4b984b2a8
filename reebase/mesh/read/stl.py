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
from reebase.mesh.read.text import PIECE, as_bytes, plain_text, quoted, repaired, without_comments
from reebase.words import counted

__all__ = ["is_text", "looks_like_text_stl", "read_stl"]

HEADER = 84
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX, _ENDLOOP = np.frombuffer(b"vertex", np.uint8), np.frombuffer(b"endloop", np.uint8)
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
            f"The header of this binary STL announces {counted(announced, 'triangle')}, {needed:,} bytes, "
            f"but the file has {len(data):,}. It was cut short, or is no STL: fetch or export it again.",
            announced=announced, needed=needed, found=len(data),
        )  # fmt: skip
    there = (len(data) - HEADER) // RECORD.itemsize
    if there > announced and HEADER + RECORD.itemsize * there == len(data) and _are_triangles(data, announced):
        announced = there
    if not announced:
        raise NoFaces("The STL file announces 0 triangles.")
    limits.check_faces(announced)
    corners = np.frombuffer(data, RECORD, announced, HEADER)["corners"]
    return _soup(corners.reshape(-1, 3).astype(np.float64), np.full(announced, 3), limits)


def _are_triangles(data: bytes, start: int) -> bool:
    """Whether what stands behind ``start`` triangles is more of them: some writers never go back to fill in the count.

    Coordinates are then finite, and normals zero or of unit length, as those of anything else would hardly be.
    """
    rest = np.frombuffer(data, RECORD, -1, HEADER + RECORD.itemsize * start)
    length = np.sqrt((rest["normal"].astype(np.float64) ** 2).sum(axis=1))
    unit = (length < 1e-6) | (np.abs(length - 1.0) < 1e-2)
    return bool(np.isfinite(rest["corners"]).all() and unit.all())


def _text(data: bytes, limits: Limits) -> Mesh:
    text = without_comments(plain_text(data))
    vertices: list[npt.NDArray[np.float64]] = []
    sizes: list[npt.NDArray[np.int64]] = []
    facets = found = 0
    for start, end in _spans(text):
        piece = text[start:end]
        some, some_sizes = _loops(piece, text, start)
        found += len(some)
        facets += len(some_sizes)
        limits.check_faces(max(facets, found // 3))
        if len(some) != some_sizes.sum() or (end == len(text) and _is_cut(piece.lower(), bool(len(some_sizes)))):
            raise TruncatedFile("The text STL ends in the middle of a facet.", facets=facets)
        vertices.append(some)
        sizes.append(some_sizes)
    if not facets:
        raise NoFaces("The text STL has no facets.")
    return _soup(np.concatenate(vertices), np.concatenate(sizes), limits)


def _is_cut(piece: bytes, facets: bool) -> bool:
    """Whether the file's last piece has the beginning of a facet, or something unknown, at its end."""
    tail = piece[piece.rfind(b"endfacet") + len(b"endfacet") :] if facets else piece
    tail = tail.strip()
    if not tail.startswith((b"endsolid", b"solid")) and not b"endsolid".startswith(tail):
        return True
    _, ended, rest = tail.rpartition(b"endsolid")
    # Behind endsolid stands a name, which may be any word.
    return _OPENED.search(rest) is not None or (not ended and _OPENING.search(rest) is not None)


def _loops(piece: bytes, text: bytes, start: int) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """(all vertices, (n, 3); vertices of each closed loop) of the piece, which stands at ``start`` in the text."""
    from reebase.mesh.read.text_kernels import scan_loops

    values, sizes = np.empty(len(piece) // 3 + 3), np.empty(len(piece) // 8 + 1, np.int64)
    odd = np.empty((len(piece) // 3 + 3, 2), np.int64)
    vertices, loops, strange = scan_loops(as_bytes(piece), _VERTEX, _ENDLOOP, values, sizes, odd)
    repaired(values, odd[:strange], piece, "STL", text, start)
    return values[: 3 * vertices].reshape(-1, 3), sizes[:loops]


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
