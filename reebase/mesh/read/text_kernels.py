"""Numbers out of bytes of text: the loops under the readers of text formats.

A decimal is read to the nearest float64, ties to even, as Python's ``float`` reads it: small ones by one exact
multiplication (Clinger, "How to Read Floating Point Numbers Accurately", PLDI 1990), the others by a product of
128 bits with a power of five (Lemire, "Number Parsing at a Gigabyte per Second", Software: Practice and
Experience 51(8), 2021, algorithm 1). What is spelt otherwise, or needs more digits, is odd: the kernels note where it
stands and leave it to Python. Every text ends with PADDING line breaks, at which the loops stop by themselves.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import numpy.typing as npt
from llvmlite import ir
from numba import extending, njit, types

__all__ = ["BAD_CORNER", "NO_VERTEX", "PADDING", "SHORT_VERTEX", "scan_loops", "scan_numbers", "scan_obj"]

Bytes = npt.NDArray[np.uint8]
Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Words = npt.NDArray[np.uint64]

intrinsic: Any = extending.intrinsic  # its calls take one argument less than its definitions

SHORT_VERTEX, BAD_CORNER, NO_VERTEX = 1, 2, 3
"""What ``scan_obj`` stops at: fewer than two coordinates, no whole number, a vertex that is not there."""

PADDING = 8
"""Line breaks behind every text: as many bytes as are looked at together."""

_LOWEST, _HIGHEST = -342, 308
_EXACT_POWERS = 10.0 ** np.arange(23)
_POWERS_OF_TEN = 10 ** np.arange(9, dtype=np.uint64)
_MOST_DIGITS = 19
"""Decimal digits that 64 bits always hold."""


def _powers_of_five() -> Words:
    """The 128 leading bits of 5^q in two words, q from _LOWEST to _HIGHEST; cut off, but above the truth for q < 0."""
    table = []
    for q in range(_LOWEST, _HIGHEST + 1):
        if q >= 0:
            power = 5**q
            excess = power.bit_length() - 128
            bits = power >> excess if excess > 0 else power << -excess
        else:
            power = 5**-q
            bits = (1 << (power.bit_length() + 127 if q >= -27 else 2 * power.bit_length() + 128)) // power + 1
            bits >>= max(bits.bit_length() - 128, 0)
        table.append((bits >> 64, bits & (2**64 - 1)))
    return np.array(table, dtype=np.uint64)


_FIVES = _powers_of_five()

# numba makes a float of an int64 beside a uint64, so that every constant beside one has its type.
_U = np.uint64
_ZERO, _ONE, _THREE = _U(0), _U(1), _U(3)
_HALF_WORD, _LOW_HALF, _WORD = _U(32), _U(0xFFFFFFFF), _U(0xFFFFFFFFFFFFFFFF)
_GUARD = _U(0x1FF)
"""The bits of the product below the 55 that rounding looks at: all ones, and the next word may carry into them."""

_TAB, _NEWLINE, _RETURN, _SPACE = 9, 10, 13, 32
_PLUS, _MINUS, _POINT, _SLASH, _NUMERAL_0, _NINE, _F, _V = 43, 45, 46, 47, 48, 57, 102, 118


@njit(cache=True, nogil=True, inline="always")
def _is_space(byte: int) -> bool:
    return byte == _SPACE or _TAB <= byte <= _RETURN


@njit(cache=True, nogil=True, inline="always")
def _is_break(byte: int) -> bool:
    return byte in (_NEWLINE, _RETURN)


@njit(cache=True, nogil=True)
def _product(a: np.uint64, b: np.uint64) -> tuple[np.uint64, np.uint64]:
    """(high, low) word of the product."""
    a_high, a_low, b_high, b_low = a >> _HALF_WORD, a & _LOW_HALF, b >> _HALF_WORD, b & _LOW_HALF
    low = a_low * b_low
    middle = a_high * b_low + (low >> _HALF_WORD)
    cross = a_low * b_high + (middle & _LOW_HALF)
    high = a_high * b_high + (middle >> _HALF_WORD) + (cross >> _HALF_WORD)
    return high, (cross << _HALF_WORD) | (low & _LOW_HALF)


@intrinsic
def _as_float(_: Any, word: Any) -> Any:
    """The float64 of these bits."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.uint64), generate


@njit(cache=True, nogil=True)
def _nearest(digits: np.uint64, power: int) -> tuple[float, bool]:
    """(the float64 nearest to digits * 10^power, whether that is sure), digits > 0; a normal one, or not sure."""
    if power < _LOWEST or power > _HIGHEST:
        return np.nan, False
    zeros = _leading_zeros(digits)
    digits <<= zeros
    high, low = _product(digits, _FIVES[power - _LOWEST, 0])
    if high & _GUARD == _GUARD:
        carry, _ = _product(digits, _FIVES[power - _LOWEST, 1])
        low += carry
        if low < carry:
            high += _ONE
    upper = high >> _U(63)
    mantissa = high >> (upper + _U(9))
    exponent = ((217706 * power) >> 16) + 63 + np.int64(upper) - np.int64(zeros) + 1023
    if (low == _WORD and not -27 <= power <= 55) or exponent <= 0 or exponent >= 2046:
        return np.nan, False
    tie = low <= _ONE and -4 <= power <= 23 and mantissa & _THREE == _ONE
    if tie and mantissa << (upper + _U(9)) == high:
        mantissa &= ~_ONE
    mantissa += mantissa & _ONE
    mantissa >>= _ONE
    if mantissa >> _U(53):
        mantissa >>= _ONE
        exponent += 1
    return _as_float((mantissa & ~(_ONE << _U(52))) | (np.uint64(exponent) << _U(52))), True


@njit(cache=True, nogil=True)
def _decimal(digits: np.uint64, power: int) -> tuple[float, bool]:
    """(the float64 nearest to digits * 10^power, whether that is sure)."""
    if digits >> _U(53) == _ZERO and -22 <= power <= 22:
        exact = np.float64(np.int64(digits))  # signed integers are converted faster
        if power < 0:
            exact /= _EXACT_POWERS[-power]
        elif power > 0:
            exact *= _EXACT_POWERS[power]
        return exact, True
    if digits == _ZERO:
        return 0.0, True
    return _nearest(digits, power)


@intrinsic
def _eight(_: Any, text: Any, at: Any) -> Any:
    """The eight bytes from ``at`` on as one word, the first in its lowest bits, from an address of any kind."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        address = builder.gep(array.data, [arguments[1]])
        word = builder.load(builder.bitcast(address, ir.IntType(64).as_pointer()))
        word.align = 1
        return word if sys.byteorder == "little" else builder.bswap(word)

    return types.uint64(text, types.intp), generate


@intrinsic
def _leading_zeros(_: Any, word: Any) -> Any:
    """The zero bits above the highest one bit; 64 when there is none."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ctlz(arguments[0], ir.Constant(ir.IntType(1), 0))

    return types.uint64(types.uint64), generate


@intrinsic
def _trailing_zeros(_: Any, word: Any) -> Any:
    """The zero bits below the lowest one bit; 64 when there is none."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 0))

    return types.uint64(types.uint64), generate


@njit(cache=True, nogil=True, inline="always")
def _figures(text: Bytes, at: int) -> tuple[np.uint64, int]:
    """(their number, how many) of the figures from ``at`` on, up to eight, without a branch for each."""
    word = _eight(text, at)
    # The first byte that is no figure has its top bit set; behind it borrows and carries make a mess, unseen.
    other = ((word + _U(0x4646464646464646)) | (word - _U(0x3030303030303030))) & _U(0x8080808080808080)
    free = _U(64) - (_trailing_zeros(other) & ~_U(7))
    if free == _U(64):
        return _ZERO, 0
    # Figures to the top, zeros in front of them; then pairs, fours and eights of neighbours are added up.
    word = (word << free) & _U(0x0F0F0F0F0F0F0F0F)
    word = ((word * _U(2561)) >> _U(8)) & _U(0x00FF00FF00FF00FF)
    word = ((word * _U(6553601)) >> _U(16)) & _U(0x0000FFFF0000FFFF)
    return (word * _U(42949672960001)) >> _HALF_WORD, 8 - int(np.int64(free >> _THREE))


@njit(cache=True, nogil=True, inline="always")
def _run(text: Bytes, at: int, digits: np.uint64) -> tuple[np.uint64, int]:
    """(the digits with the figures from ``at`` on behind them, the place behind)."""
    figures, count = _figures(text, at)
    while count == 8:
        digits = digits * _U(10**8) + figures
        at += 8
        figures, count = _figures(text, at)
    return digits * _POWERS_OF_TEN[count] + figures, at + count


@njit(cache=True, nogil=True, inline="always")
def _digits(text: Bytes, at: int) -> tuple[np.uint64, int, int, bool]:
    """(digits without their point, the power of ten they are times, the place behind, whether they fit) at ``at``."""
    first = at
    digits, at = _run(text, at, _ZERO)
    seen, power = at - first, 0
    if text[at] == _POINT:
        behind_point = at + 1
        digits, at = _run(text, behind_point, digits)
        power = behind_point - at
        seen -= power
    if seen > _MOST_DIGITS:
        while text[first] in (_POINT, _NUMERAL_0):  # zeros in front do not count
            seen -= text[first] == _NUMERAL_0
            first += 1
    return digits, power, at, 0 < seen <= _MOST_DIGITS


@njit(cache=True, nogil=True)
def _exponent(text: Bytes, at: int) -> tuple[int, int, bool]:
    """(exponent, the place behind it, whether it has digits) of what follows the letter e."""
    negative = text[at] == _MINUS
    at += negative or text[at] == _PLUS
    exponent, first = 0, at
    while _NUMERAL_0 <= text[at] <= _NINE and exponent < 10_000:
        exponent = 10 * exponent + int(text[at]) - _NUMERAL_0
        at += 1
    return -exponent if negative else exponent, at, at > first


@njit(cache=True, nogil=True, inline="always")
def _number(text: Bytes, at: int) -> tuple[int, float, bool]:
    """(the place behind the token at ``at``, its value, whether it was read, else NaN)."""
    negative = text[at] == _MINUS
    digits, power, at, good = _digits(text, at + (negative or text[at] == _PLUS))
    if good and text[at] | 32 == 101:  # e or E
        exponent, at, good = _exponent(text, at + 1)
        power += exponent
    value, sure = _decimal(digits, power)
    good &= sure and _is_space(text[at])
    while not _is_space(text[at]):
        at += 1
    value = -value if negative else value
    return at, value if good else np.nan, good


@njit(cache=True, nogil=True)
def scan_numbers(text: Bytes, values: Floats, rows: Ints, odd: Ints) -> tuple[int, int, int]:
    """All tokens of the text as numbers: how many tokens, lines that have any, and odd tokens there are.

    values: NaN for an odd one; rows: the first token of each such line; odd: (token, offset) of each, (k, 2).
    All three are long enough for half the bytes.
    """
    end = len(text) - PADDING
    at = count = lines = strange = 0
    fresh = True
    while at < end:
        byte = text[at]
        if _is_space(byte):
            fresh |= _is_break(byte)
            at += 1
            continue
        if fresh:
            rows[lines] = count
            lines += 1
            fresh = False
        begun = at
        at, values[count], good = _number(text, at)
        if not good:
            odd[strange, 0], odd[strange, 1] = count, begun
            strange += 1
        count += 1
    return count, lines, strange


@njit(cache=True, nogil=True)
def _word(text: Bytes, at: int, word: Bytes) -> bool:
    """Whether the token at ``at`` is the word, which is in lower case."""
    same = 0
    while same < len(word) and text[at + same] | 32 == word[same]:
        same += 1
    return same == len(word) and _is_space(text[at + same])


@njit(cache=True, nogil=True)
def scan_loops(
    text: Bytes, vertex: Bytes, endloop: Bytes, values: Floats, sizes: Ints, odd: Ints
) -> tuple[int, int, int]:
    """The three tokens behind every word ``vertex``: how many vertices, closed loops and odd coordinates there are.

    values: three coordinates a vertex, NaN for an odd one; sizes: vertices of each loop that ``endloop`` closes; odd:
    (coordinate, offset), (k, 2). values and odd are long enough for a third of the bytes, sizes for an eighth.
    """
    end = len(text) - PADDING
    at = vertices = closed = loops = strange = 0
    while at < end:
        if _is_space(text[at]):
            at += 1
            continue
        letter = text[at] | 32
        if letter == vertex[0] and _word(text, at, vertex):
            at += len(vertex)
            for axis in range(3):
                while at < end and _is_space(text[at]):
                    at += 1
                if at == end:
                    return vertices, loops, strange
                begun = at
                at, values[3 * vertices + axis], good = _number(text, at)
                if not good:
                    odd[strange, 0], odd[strange, 1] = 3 * vertices + axis, begun
                    strange += 1
            vertices += 1
            continue
        if letter == endloop[0] and _word(text, at, endloop):
            sizes[loops] = vertices - closed
            loops += 1
            closed = vertices
        while not _is_space(text[at]):
            at += 1
    return vertices, loops, strange


@njit(cache=True, nogil=True, inline="always")
def _corner(text: Bytes, at: int) -> tuple[int, int, bool]:
    """(vertex number, place behind the token, whether there is one) of a corner such as 7, -1 or 7/2/3."""
    negative = text[at] == _MINUS
    at += negative or text[at] == _PLUS
    first = at
    number, at = _run(text, at, _ZERO)
    good = 0 < at - first < _MOST_DIGITS and (text[at] == _SLASH or _is_space(text[at]))
    while not _is_space(text[at]):
        at += 1
    value = int(np.int64(number))
    return -value if negative else value, at, bool(good)


@njit(cache=True, nogil=True, inline="always")
def _keyword(text: Bytes, at: int) -> tuple[int, int]:
    """(v, f or 0; the place behind the keyword) of the line that begins at ``at``; fo is f in old files."""
    letter, behind = text[at], at + 1
    if letter == _F and text[behind] == 111:  # o
        behind += 1
    known = letter in (_V, _F) and text[behind] in (_SPACE, _TAB)
    return letter if known else 0, behind


@njit(cache=True, nogil=True)
def _vertex_line(
    text: Bytes, at: int, values: Floats, slot: int, odd: Ints, strange: int
) -> tuple[int, int]:
    """Read up to three coordinates into values[slot:]: (how many, odd ones until now)."""
    found = 0
    values[slot + 2] = 0.0
    while found < 3 and not _is_break(text[at]):
        if _is_space(text[at]):
            at += 1
            continue
        begun = at
        at, values[slot + found], good = _number(text, at)
        if not good:
            odd[strange, 0], odd[strange, 1] = slot + found, begun
            strange += 1
        found += 1
    return found, strange


@njit(cache=True, nogil=True)
def _face_line(
    text: Bytes, at: int, known: int, corners: Ints, count: int
) -> tuple[int, int, int]:
    """Read the corners into corners[count:]: (how many, the fault or 0, the offset of the fault)."""
    found = 0
    while not _is_break(text[at]):
        if _is_space(text[at]):
            at += 1
            continue
        begun = at
        number, at, good = _corner(text, at)
        if text[begun] == _SLASH:
            continue
        if not good:
            return found, BAD_CORNER, begun
        number += known + 1 if number < 0 else 0
        if number <= 0:
            return found, NO_VERTEX, begun
        corners[count + found] = number - 1
        found += 1
    return found, 0, 0


@njit(cache=True, nogil=True)
def scan_obj(
    text: Bytes, before: int, values: Floats, corners: Ints, sizes: Ints, odd: Ints
) -> tuple[int, int, int, int, int, int, int]:
    """The v and f lines of an OBJ file: vertices, faces, corners, odd coordinates; then what it stopped at, if not 0,
    its offset, and how many vertices, or coordinates of the short one, there were.

    before: vertices in front of this text. values: three coordinates a vertex, 0 where a line has but two; corners:
    vertex numbers from 0, negative ones resolved; sizes: corners of each face; odd: (coordinate, offset), (k, 2).
    All are long enough for half the bytes, values for one and a half times that.
    """
    end = len(text) - PADDING
    at = vertices = faces = count = strange = 0
    while at < end:
        if _is_space(text[at]):
            at += 1
            continue
        line = at
        keyword, at = _keyword(text, at)
        if keyword == _V:
            found, strange = _vertex_line(text, at, values, 3 * vertices, odd, strange)
            if found < 2:
                return vertices, faces, count, strange, SHORT_VERTEX, line, found
            vertices += 1
        elif keyword == _F:
            found, fault, offset = _face_line(text, at, before + vertices, corners, count)
            if fault:
                return vertices, faces, count, strange, fault, offset, before + vertices
            sizes[faces] = found
            faces += 1
            count += found
        while not _is_break(text[at]):
            at += 1
    return vertices, faces, count, strange, 0, 0, 0
