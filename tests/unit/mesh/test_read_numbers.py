"""Decimals in text: each must be the float64 that Python reads, to the last bit."""

from __future__ import annotations

import random
import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reebase.errors import FormatError
from reebase.mesh.read.text import lenient_float, numbers


def bits(values: list[float]) -> list[int]:
    return np.array(values).view(np.int64).tolist()


def assert_read_as_python(tokens: list[str]) -> None:
    found = numbers(" ".join(tokens).encode(), "text")
    wrong = np.flatnonzero(found.view(np.int64) != np.array([float(token) for token in tokens]).view(np.int64))
    assert [(tokens[i], found[i]) for i in wrong] == []


@settings(max_examples=300, deadline=None)
@given(st.lists(st.floats(allow_nan=False), min_size=1, max_size=40))
def test_every_float_in_its_shortest_spelling(values: list[float]) -> None:
    assert_read_as_python([repr(value) for value in values])


def test_random_bits_random_digits_and_exponents_of_all_sizes() -> None:
    chance = random.Random(0)
    tokens = []
    for _ in range(20_000):
        (value,) = struct.unpack("d", struct.pack("Q", chance.getrandbits(64)))
        tokens.append(repr(value) if value == value else "0")  # noqa: PLR0124 - not NaN
        value = chance.gauss(0, 10)
        tokens += [f"{value:.9e}", f"{value:.6f}", f"{value:.18g}", f"{value:.25f}", f"{value:.16E}"]
        tokens.append(f"{chance.getrandbits(chance.randint(1, 63))}e{chance.randint(-340, 308)}")
    assert_read_as_python(tokens)


def test_halfway_between_two_floats_goes_to_the_even_one() -> None:
    chance = random.Random(1)
    odd = [2 * (chance.getrandbits(52) | 1 << 52) + 1 for _ in range(5_000)]
    assert_read_as_python([f"{n}{tail}" for n in odd for tail in ("", "e-3", "e5", "e22", ".0", "e23")])


@pytest.mark.parametrize(
    "token",
    ["0", "-0", "+0.0", "-0e5", ".5", "5.", "+.5e-3", "1e0", "1E+05", "00000000000000000000001.5", "1e-400", "1e400",
     "0." + 600 * "0" + "5e605", "1" + 600 * "0" + "e-598",
     "0.00000000000000000000000012345", "123456789012345678901234567890", "9007199254740993", "1.7976931348623157e308",
     "2.2250738585072011e-308", "5e-324", "18446744073709551615", "18446744073709551616", "9999999999999999999",
     "8.41e21", "9.109383632044565e-31", "7205759403792793200001e-5", "inf", "-Infinity", "nan", "1_000"],
)  # fmt: skip
def test_notable_decimals(token: str) -> None:
    assert bits(numbers(token.encode(), "text").tolist()) == bits([float(token)])


@pytest.mark.parametrize("token", ["1.#QNAN", "1.5D+02", "3.1+e2", "-1.#INF"])
def test_odd_spellings_are_read_as_before(token: str) -> None:
    assert bits(numbers(f"1 {token} 2".encode(), "text").tolist()) == bits([1.0, lenient_float(token.encode()), 2.0])


@pytest.mark.parametrize("token", ["1.2.3", "--1", "1e", "e5", ".", "-", "+", "0x10", "1,5", "12a", "1e+", "1-2", "é"])
def test_what_is_no_number_is_refused_with_its_line(token: str) -> None:
    with pytest.raises(FormatError, match=r"in line 3 ") as refused:
        numbers(f"1 2\n3\n4 {token}\n5".encode(), "text")
    assert refused.value.details["line"] == 3
