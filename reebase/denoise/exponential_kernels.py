"""Exponentials of many numbers at once, in a loop that the compiler turns into vectors; a library's takes five times as
long."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["FAST", "exponentials"]

FloatArray = npt.NDArray[np.float64]

FAST = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
"""Divides without looking for zeros, and may round a product and a sum once."""

ROUNDING = 1.5 * 2.0**52
"""Added to a number below 2^51, it leaves its nearest integer in the low bits."""
BY_LOG_2 = 1.0 / math.log(2.0)
LOG_2, REST_OF_LOG_2 = 0.6931471803691238, 1.9082149292705877e-10
"""The logarithm of 2 in a head with zeros at its end, so that multiples of it are exact, and the rest."""
LEAST = -600.0
"""exp of less is 0 for all who add it to others; as it is, products with it are not subnormal, which takes long."""
C2, C3, C4, C5, C6, C7, C8, C9, C10, C11, C12, C13 = (1.0 / math.factorial(k) for k in range(2, 14))


@FAST
def exponentials(values: FloatArray, scratch: FloatArray, bits: npt.NDArray[np.int64], count: int) -> None:
    """Replaces the first ``count`` values, not above 700, by their exponentials, to two units in the last place.

    Those below LEAST count as LEAST. scratch: as long as values; bits: the same memory as integers. With n the integer
    nearest to x / log 2 and r = x - n log 2, exp x = 2^n exp r by Taylor's polynomial of degree 13.
    """
    for k in range(count):
        x = max(values[k], LEAST)
        shifted = x * BY_LOG_2 + ROUNDING
        n = shifted - ROUNDING
        r = (x - n * LOG_2) - n * REST_OF_LOG_2
        p = C13 * r + C12
        p = p * r + C11
        p = p * r + C10
        p = p * r + C9
        p = p * r + C8
        p = p * r + C7
        p = p * r + C6
        p = p * r + C5
        p = p * r + C4
        p = p * r + C3
        p = p * r + C2
        p = p * r + 1.0
        scratch[k] = shifted
        values[k] = p * r + 1.0
    for k in range(count):
        bits[k] = (bits[k] + 1023) << 52
    for k in range(count):
        values[k] *= scratch[k]
