"""The kernel of thumbnails: triangles into a depth buffer, light interpolated between their corners."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["lit"]

Float = npt.NDArray[np.float64]
Single = npt.NDArray[np.float32]
Int32 = npt.NDArray[np.int32]

KEY_X, KEY_Y, KEY_Z = -0.45, 0.65, 0.61


@njit(cache=True, nogil=True)
def _lights(seen: Float, faces: Int32) -> Float:
    """Brightness at each vertex, (n,): a headlight, a weaker light from the upper left, and a bright sky.

    Both sides of the surface are lit: of a normal that points away only its part along the view is turned
    round, which leaves the light smooth over silhouettes.
    """
    normals = np.zeros((len(seen), 3))
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = seen[j, 0] - seen[i, 0], seen[j, 1] - seen[i, 1], seen[j, 2] - seen[i, 2]
        bx, by, bz = seen[k, 0] - seen[i, 0], seen[k, 1] - seen[i, 1], seen[k, 2] - seen[i, 2]
        x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        for v in (i, j, k):
            normals[v, 0] += x
            normals[v, 1] += y
            normals[v, 2] += z
    lights = np.empty(len(seen))
    for v in range(len(seen)):
        x, y, z = normals[v, 0], normals[v, 1], abs(normals[v, 2])
        length = math.sqrt(x * x + y * y + z * z)
        if length == 0.0:
            x, y, z, length = 0.0, 0.0, 1.0, 1.0
        key = max(0.0, (x * KEY_X + y * KEY_Y + z * KEY_Z) / length)
        lights[v] = 0.42 * z / length + 0.38 * key + 0.1 * (1.0 + y / length)
    return lights


@njit(cache=True, nogil=True)
def lit(seen: Float, faces: Int32, size: int) -> Single:
    """Brightness in [0, 1] of the nearest surface at each pixel, rows from the top, (size, size); NaN beside it.

    seen: pixels right, pixels up and nearness of each vertex, (n, 3).
    """
    lights = _lights(seen, faces)
    nearest = np.full((size, size), -np.inf)
    image = np.full((size, size), np.nan, np.float32)
    for f in range(len(faces)):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        xi, yi, xj, yj, xk, yk = seen[i, 0], seen[i, 1], seen[j, 0], seen[j, 1], seen[k, 0], seen[k, 1]
        area = (xj - xi) * (yk - yi) - (xk - xi) * (yj - yi)
        if area == 0.0:
            continue
        left = max(0, math.ceil(min(xi, xj, xk) - 0.5))
        right = min(size - 1, math.floor(max(xi, xj, xk) - 0.5))
        low = max(0, math.ceil(min(yi, yj, yk) - 0.5))
        high = min(size - 1, math.floor(max(yi, yj, yk) - 0.5))
        for row in range(low, high + 1):
            y = row + 0.5
            for column in range(left, right + 1):
                x = column + 0.5
                a = ((xj - x) * (yk - y) - (xk - x) * (yj - y)) / area
                b = ((xk - x) * (yi - y) - (xi - x) * (yk - y)) / area
                c = 1.0 - a - b
                if a < 0.0 or b < 0.0 or c < 0.0:
                    continue
                depth = a * seen[i, 2] + b * seen[j, 2] + c * seen[k, 2]
                if depth > nearest[row, column]:
                    nearest[row, column] = depth
                    image[size - 1 - row, column] = a * lights[i] + b * lights[j] + c * lights[k]
    return image
