"""Records with lists of varying length, as PLY and OFF hold them: one walk for text and binary alike.

A body is a row of cells: bytes in a binary file, tokens in a text file. An element is ``count`` records of
the same properties, each a scalar or a list with its own length. Most files have lists of one length only;
these are read without walking.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from reebase.errors import FormatError, TruncatedFile

__all__ = ["BinaryCells", "Cells", "Element", "Property", "Table", "TextCells", "read_element"]

Ints = npt.NDArray[np.int64]

MOST_PROPERTIES = 4096
"""Nobody writes more; it bounds the work that a hostile header causes."""


@dataclass(frozen=True)
class Property:
    """One property: ``type`` and ``length_type`` are numpy codes ("f4"); a scalar has no length type."""

    name: str
    type: str
    length_type: str | None = None


@dataclass(frozen=True)
class Element:
    """A kind of record and how often it stands in the file."""

    name: str
    count: int
    properties: tuple[Property, ...]


class Cells(Protocol):
    """The body of a file, addressed by cell."""

    end: int
    unit: str

    def width(self, kind: str) -> int:
        """Cells that one value of this type takes."""

    def length(self, at: int, kind: str) -> int:
        """The length of a list that stands in one cell. Raises IndexError behind the end."""

    def take(self, offsets: Ints, kind: str) -> npt.NDArray[Any]:
        """The values at these offsets."""


class BinaryCells:
    """Bytes; ``order`` is "<" or ">"."""

    unit = "bytes"

    def __init__(self, data: bytes, order: str) -> None:
        self.end = len(data)
        self._data, self._order = data, order
        self._readers: dict[str, struct.Struct] = {}

    def width(self, kind: str) -> int:
        return int(kind[1:])

    def length(self, at: int, kind: str) -> int:
        if kind == "u1":
            return self._data[at]
        reader = self._readers.get(kind)
        if reader is None:
            reader = self._readers[kind] = struct.Struct(self._order + np.dtype(kind).char.replace("l", "q"))
        if at + reader.size > self.end:
            raise IndexError
        return int(reader.unpack_from(self._data, at)[0])

    def take(self, offsets: Ints, kind: str) -> npt.NDArray[Any]:
        dtype = np.dtype(self._order + kind)
        if not offsets.size:
            return np.zeros(offsets.shape, dtype)
        # A view of every byte as the start of a value; numpy copes with values that are not aligned.
        return np.ndarray((self.end - dtype.itemsize + 1,), dtype, self._data, 0, (1,))[offsets]


class TextCells:
    """Tokens of a text, already read as numbers."""

    unit = "numbers"

    def __init__(self, values: npt.NDArray[np.float64]) -> None:
        self.end = len(values)
        self._values = values
        self._view = values.data

    def width(self, kind: str) -> int:
        return 1

    def length(self, at: int, kind: str) -> int:
        value = float(self._view[at])
        if not value.is_integer():
            raise FormatError(f"A list has the length {value}, which is not a whole number.")
        return int(value)

    def take(self, offsets: Ints, kind: str) -> npt.NDArray[Any]:
        found = self._values[offsets]
        if kind[0] == "f":
            return found
        if not (np.abs(found) < 2**53).all() or (found != np.floor(found)).any():
            raise FormatError(
                "A number with a fraction, or beyond all bounds, stands where an integer is expected."
            )
        return found.astype(np.int64)


class Table:
    """Where the properties of one element stand; values are read when they are asked for."""

    def __init__(
        self, cells: Cells, element: Element, offsets: dict[str, Ints], lengths: dict[str, Ints]
    ) -> None:
        self._cells = cells
        self._types = {p.name: p.type for p in element.properties}
        self._offsets, self._lengths = offsets, lengths
        self.count = element.count

    def scalar(self, name: str) -> npt.NDArray[Any] | None:
        """The values of a scalar property, shape (count,), or None when there is none of that name."""
        if name not in self._offsets or name in self._lengths:
            return None
        return self._cells.take(self._offsets[name], self._types[name])

    def list(self, name: str) -> tuple[npt.NDArray[Any], Ints] | None:
        """(values of all lists in a row, lengths (count,)), or None when there is no list of that name."""
        if name not in self._lengths:
            return None
        lengths, starts = self._lengths[name], self._offsets[name]
        width = self._cells.width(self._types[name])
        if len(lengths) and (lengths == lengths[0]).all():
            offsets = (starts[:, None] + width * np.arange(lengths[0])).ravel()
        else:
            within = np.arange(int(lengths.sum())) - np.repeat(np.cumsum(lengths) - lengths, lengths)
            offsets = np.repeat(starts, lengths) + width * within
        return self._cells.take(offsets, self._types[name]), lengths


def read_element(cells: Cells, start: int, element: Element) -> tuple[Table, int]:
    """The records of an element from cell ``start`` on, and the first cell behind them.

    The announced count is held against what is left of the file before anything is allocated.
    Raises TruncatedFile, FormatError.
    """
    if len(element.properties) > MOST_PROPERTIES:
        raise FormatError(f"Element {element.name!r} has more than {MOST_PROPERTIES} properties.")
    least = sum(cells.width(p.length_type or p.type) for p in element.properties)
    if element.count * least > cells.end - start:
        raise TruncatedFile(
            f"The header announces {element.count:,} {element.name} records, which take at least "
            f"{element.count * least:,} {cells.unit}, but {max(cells.end - start, 0):,} are left.",
            element=element.name, announced=element.count,
        )  # fmt: skip
    if least == 0:
        return Table(cells, element, {}, {}), start
    if element.count == 0:
        nothing = np.zeros(0, dtype=np.int64)
        empty = {p.name: nothing for p in element.properties}
        return Table(
            cells, element, empty, {p.name: nothing for p in element.properties if p.length_type}
        ), start
    try:
        return _uniform(cells, start, element) or _walk(cells, start, element)
    except IndexError:
        raise TruncatedFile(
            f"The file ends within the {element.count:,} {element.name} records that its header announces. It was cut "
            "short, or line ends were changed in binary data: fetch or export it again.",
            element=element.name, announced=element.count,
        ) from None


def _uniform(cells: Cells, start: int, element: Element) -> tuple[Table, int] | None:
    """The records if every list is as long as in the first record, else None."""
    at, first, expected = start, {}, {}
    heads = {}
    for p in element.properties:
        if p.length_type:
            expected[p.name] = _checked_length(cells, at, p)
            heads[p.name] = at - start
            at += cells.width(p.length_type)
        first[p.name] = at - start
        at += cells.width(p.type) * expected.get(p.name, 1)
    stride = at - start
    if stride * element.count > cells.end - start:
        return None
    rows = start + stride * np.arange(element.count)
    for p in element.properties:
        if p.length_type and (cells.take(rows + heads[p.name], p.length_type) != expected[p.name]).any():
            return None
    lengths = {name: np.full(element.count, length) for name, length in expected.items()}
    offsets = {name: rows + offset for name, offset in first.items()}
    return Table(cells, element, offsets, lengths), start + stride * element.count


def _walk(cells: Cells, start: int, element: Element) -> tuple[Table, int]:
    """The records one by one, for lists of different lengths."""
    offsets = {p.name: np.empty(element.count, dtype=np.int64) for p in element.properties}
    lengths = {p.name: np.empty(element.count, dtype=np.int64) for p in element.properties if p.length_type}
    plan = [
        (offsets[p.name], lengths.get(p.name), p, cells.width(p.length_type or "u1"), cells.width(p.type))
        for p in element.properties
    ]
    at = start
    for row in range(element.count):
        for place, length_of, p, head, width in plan:
            if length_of is None:
                place[row] = at
                at += width
            else:
                length = _checked_length(cells, at, p)
                at += head
                place[row], length_of[row] = at, length
                at += width * length
        if at > cells.end:
            raise IndexError
    return Table(cells, element, offsets, lengths), at


def _checked_length(cells: Cells, at: int, p: Property) -> int:
    """The length of a list; IndexError when it cannot fit in what is left."""
    length = cells.length(at, p.length_type or "u1")
    if length < 0:
        raise FormatError(f"A list of property {p.name!r} has the length {length}.")
    if length > cells.end - at:
        raise IndexError
    return length
