"""The minor eigenvectors of symmetric 3 x 3 matrices, many at once, so that the compiler makes vectors of the loops."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from reebase.denoise.exponential_kernels import FAST

__all__ = ["minor_eigenvectors"]

FloatArray = npt.NDArray[np.float64]
Vector = tuple[float, float, float]

SEPARATED = 1e-6
"""The two smaller eigenvalues count as one when closer than this times the deviator's norm over sqrt 6."""
CLOSE = 0.01
"""In the same unit: how far apart they must be for the minor eigenvector to come from its eigenvalue alone. The
eigenvalue's error is rounding over the gap, and the eigenvector's that over the gap once more."""
TINY = 1e-300
"""What keeps a quotient finite whose value does not count."""

C0, C1, C2, C3, C4, C5, C6, C7, C8 = (
    1.732050811199128, 0.3333327422891863, -0.09620888290923515, 0.049208593609895296, -0.030214550418876537,
    0.01876666134524154, -0.009859382585859748, 0.0035297138954317577, -0.0006057084405458874,
)  # fmt: skip
"""Chebyshev interpolation of 2 cos(acos(x) / 3) on [0, 1]."""


@FAST
def null_vector(a: float, b: float, c: float, d: float, e: float, f: float) -> Vector:
    """Unit vector that the singular matrix ((a, b, c), (b, d, e), (c, e, f)) takes to zero.

    It is the longest of the cross products of two rows, which does not vanish when the rank is 2.
    """
    px, py, pz = b * e - c * d, c * b - a * e, a * d - b * b
    qx, qy, qz = b * f - c * e, c * c - a * f, a * e - b * c
    rx, ry, rz = d * f - e * e, e * c - b * f, b * e - d * c
    p, q, r = px * px + py * py + pz * pz, qx * qx + qy * qy + qz * qz, rx * rx + ry * ry + rz * rz
    if p < q:
        px, py, pz, p = qx, qy, qz, q
    if p < r:
        px, py, pz, p = rx, ry, rz, r
    scale = 1.0 / math.sqrt(p)
    return scale * px, scale * py, scale * pz


@FAST
def lower_in_plane(
    a: float, b: float, c: float, d: float, e: float, f: float, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """The lower eigenvector of ((a, b, c), (b, d, e), (c, e, f)) across its unit eigenvector (x, y, z).

    Also returned, last: the difference of the two eigenvalues across it; where it is 0 the vector is any across it.
    The basis across it is that of Duff et al., Building an Orthonormal Basis, Revisited, JCGT 6 (2017).
    """
    side = math.copysign(1.0, z)
    p = -1.0 / (side + z)
    q = x * y * p
    ux, uy, uz = 1.0 + side * x * x * p, side * q, -side * x
    vx, vy, vz = q, side + y * y * p, -y
    sx, sy, sz = a * ux + b * uy + c * uz, b * ux + d * uy + e * uz, c * ux + e * uy + f * uz
    tx, ty, tz = a * vx + b * vy + c * vz, b * vx + d * vy + e * vz, c * vx + e * vy + f * vz
    tilt = 0.5 * (ux * sx + uy * sy + uz * sz - vx * tx - vy * ty - vz * tz)
    mixed = ux * tx + uy * ty + uz * tz
    radius = math.sqrt(tilt * tilt + mixed * mixed)
    upper = tilt >= 0.0
    along = -mixed if upper else radius - tilt
    across = tilt + radius if upper else -mixed
    scale = 1.0 / math.sqrt(max(along * along + across * across, TINY))
    along, across = scale * along, scale * across
    return along * ux + across * vx, along * uy + across * vy, along * uz + across * vz, 2.0 * radius


@FAST
def largest_root(half: float) -> float:
    """The largest x with x^3 - 3x = 2 ``half``, which is in [0, 1]: 2 cos(acos(half) / 3).

    One step of Newton's method from a polynomial that is right to 4e-9.
    """
    x = C8 * half + C7
    x = x * half + C6
    x = x * half + C5
    x = x * half + C4
    x = x * half + C3
    x = x * half + C2
    x = x * half + C1
    x = x * half + C0
    square = x * x
    return float(x - ((square - 3.0) * x - 2.0 * half) / (3.0 * square - 3.0))


@FAST
def minor_eigenvectors(deviators: FloatArray, roots: FloatArray, normals: FloatArray) -> None:
    """Replaces each column's normal, (3, columns), by the eigenvector of the smallest eigenvalue of a deviator.

    deviators: xx, xy, xz, yy, yz, zz of each, (6, columns), scaled in place. roots: their Frobenius norms over sqrt 6,
    whose squares make x^3 - 3 root^2 x = determinant of the eigenvalues. Its sign is that of the normal, which stays
    where the smallest eigenvalue is not simple. Where it is within CLOSE of the next, the eigenvector whose eigenvalue
    stands apart is found first and the minor one across it: so the error is rounding over the gap, as a library's.
    """
    columns = len(roots)
    shifts, gaps, found = np.empty(columns), np.empty(columns), np.empty((3, columns))
    close = 0
    for v in range(columns):
        scale = 1.0 / roots[v] if roots[v] > 0.0 else 0.0
        for entry in range(6):
            deviators[entry, v] *= scale
        a, b, c = deviators[0, v], deviators[1, v], deviators[2, v]
        d, e, f = deviators[3, v], deviators[4, v], deviators[5, v]
        half = 0.5 * (a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d))
        apart = largest_root(min(1.0, abs(half)))
        # Of the two eigenvalues that do not stand apart.
        gap = math.sqrt(max(0.0, 12.0 - 3.0 * apart * apart))
        shifts[v] = apart if half <= 0.0 else 0.5 * (apart + gap)
        gaps[v] = 1.0 if half <= 0.0 else gap
        close += 1 if gaps[v] <= CLOSE else 0
    for v in range(columns):
        a, b, c = deviators[0, v] + shifts[v], deviators[1, v], deviators[2, v]
        d, e, f = deviators[3, v] + shifts[v], deviators[4, v], deviators[5, v] + shifts[v]
        found[0, v], found[1, v], found[2, v] = null_vector(a, b, c, d, e, f)
    if close > 0:
        for v in range(columns):
            if gaps[v] <= CLOSE:
                a, b, c = deviators[0, v], deviators[1, v], deviators[2, v]
                d, e, f = deviators[3, v], deviators[4, v], deviators[5, v]
                apart = 2.0 * shifts[v] - gaps[v]
                x, y, z = null_vector(a - apart, b, c, d - apart, e, f - apart)
                found[0, v], found[1, v], found[2, v], gaps[v] = lower_in_plane(a, b, c, d, e, f, x, y, z)
    for v in range(columns):
        x, y, z = found[0, v], found[1, v], found[2, v]
        simple = (roots[v] > 0.0) & (gaps[v] > SEPARATED)
        sign = math.copysign(1.0, x * normals[0, v] + y * normals[1, v] + z * normals[2, v])
        normals[0, v] = sign * x if simple else normals[0, v]
        normals[1, v] = sign * y if simple else normals[1, v]
        normals[2, v] = sign * z if simple else normals[2, v]
