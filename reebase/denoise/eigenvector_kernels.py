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
    length = math.sqrt(p)
    return px / length, py / length, pz / length


@FAST
def lower_in_plane(
    a: float, b: float, c: float, d: float, e: float, f: float, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """The lower eigenvector of ((a, b, c), (b, d, e), (c, e, f)) across its unit eigenvector (x, y, z).

    Also returned, last: the difference of the two eigenvalues across it.
    """
    if abs(x) > abs(z):
        length = math.sqrt(x * x + y * y)
        ux, uy, uz = -y / length, x / length, 0.0
    else:
        length = math.sqrt(y * y + z * z)
        ux, uy, uz = 0.0, -z / length, y / length
    vx, vy, vz = y * uz - z * uy, z * ux - x * uz, x * uy - y * ux
    sx, sy, sz = a * ux + b * uy + c * uz, b * ux + d * uy + e * uz, c * ux + e * uy + f * uz
    tx, ty, tz = a * vx + b * vy + c * vz, b * vx + d * vy + e * vz, c * vx + e * vy + f * vz
    tilt = 0.5 * (ux * sx + uy * sy + uz * sz - vx * tx - vy * ty - vz * tz)
    mixed = ux * tx + uy * ty + uz * tz
    radius = math.sqrt(tilt * tilt + mixed * mixed)
    if tilt >= 0.0:
        along, across = -mixed, tilt + radius
    else:
        along, across = radius - tilt, -mixed
    length = math.sqrt(along * along + across * across)
    if length == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    along, across = along / length, across / length
    return along * ux + across * vx, along * uy + across * vy, along * uz + across * vz, 2.0 * radius


@FAST
def largest_root(half: float) -> float:
    """The largest x with x^3 - 3x = 2 ``half``, which is in [0, 1]: 2 cos(acos(half) / 3).

    Three steps of Newton's method from a cubic that is right to 1e-3.
    """
    x = 1.7320508 + half * (0.3333333 + half * (0.0196 * half - 0.085))
    for _ in range(3):
        square = x * x
        x -= ((square - 3.0) * x - 2.0 * half) / (3.0 * square - 3.0)
    return float(x)


@FAST
def minor_eigenvectors(deviators: FloatArray, roots: FloatArray, normals: FloatArray) -> None:
    """Replaces each column's normal, (3, columns), by the eigenvector of the smallest eigenvalue of a deviator.

    deviators: xx, xy, xz, yy, yz, zz of each, (6, columns), scaled in place. roots: their Frobenius norms over sqrt 6,
    whose squares make x^3 - 3 root^2 x = determinant of the eigenvalues. The eigenvector whose eigenvalue stands apart
    is found first, and the minor one across it where it is another: so its error is rounding over the gap, as a
    library's. Its sign is that of the normal, which stays where the smallest eigenvalue is not simple.
    """
    columns = len(roots)
    shifts, apart = np.empty(columns), np.empty((3, columns))
    for v in range(columns):
        scale = 1.0 / roots[v] if roots[v] > 0.0 else 0.0
        for entry in range(6):
            deviators[entry, v] *= scale
        a, b, c = deviators[0, v], deviators[1, v], deviators[2, v]
        d, e, f = deviators[3, v], deviators[4, v], deviators[5, v]
        half = 0.5 * (a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d))
        largest = largest_root(min(1.0, abs(half)))
        shifts[v] = largest if half <= 0.0 else -largest
    for v in range(columns):
        a, b, c = deviators[0, v] + shifts[v], deviators[1, v], deviators[2, v]
        d, e, f = deviators[3, v] + shifts[v], deviators[4, v], deviators[5, v] + shifts[v]
        apart[0, v], apart[1, v], apart[2, v] = null_vector(a, b, c, d, e, f)
    for v in range(columns):
        x, y, z = apart[0, v], apart[1, v], apart[2, v]
        simple = roots[v] > 0.0
        if shifts[v] < 0.0:
            a, b, c = deviators[0, v], deviators[1, v], deviators[2, v]
            d, e, f = deviators[3, v], deviators[4, v], deviators[5, v]
            x, y, z, gap = lower_in_plane(a, b, c, d, e, f, x, y, z)
            simple = simple and gap > SEPARATED
        if simple:
            sign = -1.0 if x * normals[0, v] + y * normals[1, v] + z * normals[2, v] < 0.0 else 1.0
            normals[0, v], normals[1, v], normals[2, v] = sign * x, sign * y, sign * z
