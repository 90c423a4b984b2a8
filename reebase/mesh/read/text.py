"""Numbers out of text, in pieces, so that a large file never stands in memory as Python objects."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator

import numpy as np
import numpy.typing as npt

from reebase.errors import FormatError

__all__ = [
    "PIECE",
    "floats",
    "integers",
    "json_fault",
    "lenient_float",
    "numbers",
    "pieces",
    "plain_text",
    "quoted",
    "rectangle",
    "without_comments",
]

PIECE = 1 << 20
"""Bytes of text that are split into tokens at a time: 1 MiB is about 15 MiB of tokens."""

LONGEST_PIECE = 16 << 20
"""A longer piece is one endless line; split, it would take gigabytes."""

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


def floats(tokens: list[bytes]) -> npt.NDArray[np.float64]:
    """Tokens as float64, also as ``lenient_float`` takes them. Raises ValueError."""
    try:
        return np.fromiter(map(float, tokens), np.float64, len(tokens))
    except ValueError:
        return np.fromiter(map(lenient_float, tokens), np.float64, len(tokens))


def numbers(
    data: bytes, what: str, *, offset: int = 0, whole: bytes | None = None
) -> npt.NDArray[np.float64]:
    """All tokens of the text as float64, shape (k,).

    ``what`` names the format in the message; ``offset`` and ``whole`` say where the text stands in the
    file, for the line number there. Raises FormatError at the first token that is not a number.
    """
    parts = []
    for start, piece in pieces(data, b" \t\r\n\v\f"):
        try:
            parts.append(floats(piece.split()))
        except ValueError:
            raise _not_a_number(piece, what, whole if whole is not None else data, offset + start) from None
    return np.concatenate(parts) if parts else np.zeros(0)


def _not_a_number(piece: bytes, what: str, whole: bytes, start: int) -> FormatError:
    for match in re.finditer(rb"\S+", piece):
        try:
            lenient_float(match.group())
        except ValueError:
            line = whole.count(b"\n", 0, start + match.start()) + 1
            return FormatError(
                f"{what}: {quoted(match.group())} in line {line} stands where a number is expected.",
                line=line,
            )
    return FormatError(f"{what}: a token is not a number.")


def rectangle(lines: list[bytes]) -> tuple[list[bytes], int] | None:
    """(all tokens in a row, tokens a line) if every line has the same number of tokens, else None."""
    if not lines:
        return None
    # One split of the joined text is far faster than a split of every line; the marks show the ragged ones.
    tokens = b" ; ".join(lines).split()
    stride, rest = divmod(len(tokens) + 1, len(lines))
    if rest or tokens[stride - 1 :: stride].count(b";") != len(lines) - 1:
        return None
    del tokens[stride - 1 :: stride]
    return tokens, stride - 1


def integers(tokens: Iterable[bytes]) -> npt.NDArray[np.int64]:
    """Tokens as int64. Raises ValueError, also for numbers that int64 does not hold."""
    try:
        return np.fromiter(map(int, tokens), np.int64)
    except OverflowError:
        raise ValueError("an integer of more than 64 bits") from None
