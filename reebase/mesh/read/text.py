"""Numbers out of text, in pieces; the loops are in text_kernels.py, what is spelt oddly is read here."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from reebase.errors import FormatError

__all__ = [
    "PIECE", "as_bytes", "json_fault", "lenient_float", "line_of", "numbers", "pieces", "plain_text", "quoted",
    "repaired", "tokens", "without_comments",
]  # fmt: skip

PIECE = 1 << 20
"""Bytes of text that are read at a time, so that what is noted of the tokens stays small."""

LONGEST_PIECE = 16 << 20
"""A longer piece is one endless line; split, its notes would take gigabytes."""

_TOKEN = re.compile(rb"\S+")
_SIGN_BEFORE_EXPONENT = re.compile(r"^([+-]?[\d.]+)([+-])[eEdD](\d+)$")
_BOMS = ((b"\xef\xbb\xbf", "utf-8-sig"), (b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16"))


def plain_text(data: bytes) -> bytes:
    """The text without a byte order mark, as ASCII-compatible bytes. Raises FormatError for broken UTF-16."""
    for mark, encoding in _BOMS:
        if data.startswith(mark):
            if encoding == "utf-8-sig":
                return data[len(mark) :]
            try:
                return data.decode(encoding).encode("utf-8", "replace")
            except UnicodeDecodeError:
                raise FormatError("The file starts as UTF-16 text, but is not.") from None
    return data


def json_fault(error: ValueError) -> str:
    """What is wrong with a JSON text that ``json.loads`` refused, and where, in words."""
    if isinstance(error, json.JSONDecodeError):
        return f"{error.msg} at line {error.lineno}, column {error.colno}"
    if isinstance(error, UnicodeDecodeError):
        return f"byte {error.start} is not UTF-8"
    return "a number in it has too many digits"


def without_comments(data: bytes) -> bytes:
    """The text with everything from ``#`` to the end of its line removed, but not from 1.#QNAN."""
    return re.sub(rb"(?<!\d\.)#[^\r\n]*", b"", data) if b"#" in data else data


def quoted(token: bytes, longest: int = 40) -> str:
    """A token as it may stand in a message: short, printable, in quotation marks."""
    text = token[:longest].decode("utf-8", "replace")
    shown = "".join(c if c.isprintable() else "?" for c in text)
    return f'"{shown}{"…" if len(token) > longest else ""}"'


def pieces(data: bytes, separators: bytes = b"\n") -> Iterator[tuple[int, bytes]]:
    """(offset, piece) of about PIECE bytes each, cut only behind one of the separator bytes.

    Raises FormatError for a line without end.
    """
    start = 0
    pattern = re.compile(b"[" + re.escape(separators) + b"]")
    while start < len(data):
        found = pattern.search(data, start + PIECE)
        end = len(data) if found is None else found.end()
        if end - start > LONGEST_PIECE:
            raise FormatError(f"The file has a line of more than {LONGEST_PIECE - PIECE:,} bytes.")
        yield start, data[start:end]
        start = end


def lenient_float(token: bytes) -> float:
    """One number, also as some writers of C and Fortran spell it: 1.#QNAN, 1.5D+02, 3.1+e2.

    Raises ValueError.
    """
    text = token.decode("ascii", "replace")
    lowered = text.lower()
    if ".#" in lowered:
        return math.inf if "inf" in lowered else math.nan
    repaired = _SIGN_BEFORE_EXPONENT.sub(r"\1e\2\3", text)
    return float(re.sub(r"(?<=[\d.])[dD](?=[+-]?\d)", "e", repaired))


def numbers(
    data: bytes, what: str, *, offset: int = 0, whole: bytes | None = None
) -> npt.NDArray[np.float64]:
    """All tokens of the text as float64, shape (k,), also as ``lenient_float`` takes them.

    ``what`` names the format in the message; ``offset`` and ``whole`` say where the text stands in the
    file, for the line number there. Raises FormatError at the first token that is not a number.
    """
    parts = [np.zeros(0)]
    for start, piece in pieces(data, b" \t\r\n\v\f"):
        values, _, odd = tokens(piece)
        parts.append(repaired(values, odd, piece, what, whole if whole is not None else data, offset + start))
    return np.concatenate(parts)


def tokens(text: bytes) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """All tokens of the text as numbers, which tokens begin a line, and the odd tokens.

    values: float64, (k,), NaN where the token is odd; rows: int64, the first token of every line that has any; odd:
    int64, (j, 2), token and offset of each that ``repaired`` must see.
    """
    from reebase.mesh.read.text_kernels import scan_numbers

    most = len(text) // 2 + 1
    values, rows, odd = np.empty(most), np.empty(most, np.int64), np.empty((most, 2), np.int64)
    count, lines, strange = scan_numbers(as_bytes(text), values, rows, odd)
    return values[:count], rows[:lines], odd[:strange]


def repaired(
    values: npt.NDArray[np.float64], odd: npt.NDArray[np.int64], text: bytes, what: str, whole: bytes, start: int
) -> npt.NDArray[np.float64]:
    """The values with each odd one as ``lenient_float`` reads it; ``text`` stands at ``start`` in the whole file.

    Raises FormatError at the first that is not a number.
    """
    for at, offset in odd.tolist():
        token = _TOKEN.match(text, offset)[0]  # type: ignore[index]  # the kernel stopped at a token
        try:
            values[at] = lenient_float(token)
        except ValueError:
            line = line_of(whole, start + offset)
            raise FormatError(
                f"{what}: {quoted(token)} in line {line} stands where a number is expected.", line=line
            ) from None
    return values


def line_of(text: bytes, offset: int) -> int:
    """The line, from 1, in which the byte at the offset stands; lines end with LF, CR LF or CR."""
    return len(text[: offset + 1].splitlines())


def as_bytes(text: bytes) -> npt.NDArray[np.uint8]:
    """The text as the kernels take it, with line breaks at its end."""
    from reebase.mesh.read.text_kernels import PADDING

    return np.frombuffer(text + PADDING * b"\n", np.uint8)
