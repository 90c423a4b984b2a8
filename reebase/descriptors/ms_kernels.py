"""Compiled loops of ``ms``: voxels of a surface, average outward flux, thinning that keeps the topology, and parts.

Arrays of voxels have a margin of two empty cells, so that no loop looks beyond them.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

__all__ = ["mark_surface", "outward_flux", "part_of", "salient", "thin"]

Bool = npt.NDArray[np.bool_]
Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.int64]


@njit(cache=True, nogil=True)
def mark_surface(corners: Float, pieces: Int, solid: Bool) -> None:
    """Mark the voxels that hold a point of the faces, (n, 3, 3), each cut into pieces[f]^2 triangles."""
    for f in range(len(corners)):
        k = pieces[f]
        for i in range(k + 1):
            for j in range(k + 1 - i):
                u, v = i / k, j / k
                w = 1.0 - u - v
                x = int(w * corners[f, 0, 0] + u * corners[f, 1, 0] + v * corners[f, 2, 0])
                y = int(w * corners[f, 0, 1] + u * corners[f, 1, 1] + v * corners[f, 2, 1])
                z = int(w * corners[f, 0, 2] + u * corners[f, 1, 2] + v * corners[f, 2, 2])
                solid[x, y, z] = True


@njit(cache=True, nogil=True)
def outward_flux(cells: Int, nearest: npt.NDArray[np.int32], solid: Bool) -> Float:
    """Mean over the 26 neighbours of the distance's gradient along the way to them, (c,): clearly negative on the
    medial surface, where gradients meet, and about 0 elsewhere. nearest: empty voxel of each voxel, (3, ...)."""
    out = np.zeros(len(cells))
    for c in range(len(cells)):
        for n in range(27):
            a, b, d = n // 9 - 1, n // 3 % 3 - 1, n % 3 - 1
            i, j, k = cells[c, 0] + a, cells[c, 1] + b, cells[c, 2] + d
            if n == 13 or not solid[i, j, k]:
                continue
            x, y, z = i - nearest[0, i, j, k], j - nearest[1, i, j, k], k - nearest[2, i, j, k]
            out[c] += (x * a + y * b + z * d) / np.sqrt(float((x * x + y * y + z * z) * (a * a + b * b + d * d)))
    return out / 26.0


@njit(cache=True, nogil=True)
def salient(cells: Int, radii: Float, scale: float) -> Bool:
    """Whether each voxel's ball stays visible when all balls grow by a factor (the scale axis transform: Miklos,
    Giesen, Pauly, "Discrete Scale Axis Representations for 3D Geometry", SIGGRAPH 2010). The widest come first."""
    out = np.ones(len(cells), np.bool_)
    for c in range(len(cells)):
        for o in range(c):
            reach = scale * (radii[o] - radii[c])
            x, y, z = cells[c, 0] - cells[o, 0], cells[c, 1] - cells[o, 1], cells[c, 2] - cells[o, 2]
            if out[o] and float(x * x + y * y + z * z) <= reach * reach:
                out[c] = False
                break
    return out


@njit(cache=True, nogil=True)
def _pieces(around: Bool, value: bool, stack: Int, seen: Bool) -> int:
    """Components of the 26 neighbours: of the object by corners, or of the empty ones by faces, within the 18 that
    share an edge, counting those that touch the centre by a face."""
    count = 0
    seen[:] = False
    for start in range(27):
        a, b, d = start // 9 - 1, start // 3 % 3 - 1, start % 3 - 1
        far = abs(a) + abs(b) + abs(d)
        if start == 13 or seen[start] or around[start] != value or (not value and far != 1):
            continue
        count += 1
        seen[start] = True
        size = 1
        stack[0] = start
        while size:
            size -= 1
            at = stack[size]
            x, y, z = at // 9, at // 3 % 3, at % 3
            for other in range(27):
                i, j, k = other // 9, other // 3 % 3, other % 3
                steps = abs(i - x) + abs(j - y) + abs(k - z)
                apart = max(abs(i - x), abs(j - y), abs(k - z))
                if other == 13 or seen[other] or around[other] != value:
                    continue
                near = abs(i - 1) + abs(j - 1) + abs(k - 1) <= 2
                if (value and apart == 1) or (not value and steps == 1 and near):
                    seen[other] = True
                    stack[size] = other
                    size += 1
    return count


@njit(cache=True, nogil=True)
def thin(cells: Int, kept: Bool, solid: Bool) -> None:
    """Empty the voxels that are not kept and whose loss changes no topology, in the order of ``cells``, until none is.

    A voxel may go when its neighbours in the object are one piece and so are its empty ones (simple points, Bertrand
    and Malandain, "A New Characterization of Three-Dimensional Simple Points", 1994).
    """
    around, seen = np.empty(27, np.bool_), np.empty(27, np.bool_)
    stack = np.empty(27, np.int64)
    changed = True
    while changed:
        changed = False
        for c in range(len(cells)):
            x, y, z = cells[c, 0], cells[c, 1], cells[c, 2]
            if kept[c] or not solid[x, y, z]:
                continue
            for n in range(27):
                around[n] = solid[x + n // 9 - 1, y + n // 3 % 3 - 1, z + n % 3 - 1]
            if _pieces(around, False, stack, seen) == 1 and _pieces(around, True, stack, seen) == 1:
                solid[x, y, z] = False
                changed = True


@njit(cache=True, nogil=True)
def part_of(cells: Int, radii: Float, grid: npt.NDArray[np.int32], narrowing: float, neck: float) -> Int:
    """The part of each medial voxel, (c,): the first voxel of it. cells come by decreasing radius; grid: the place of
    each voxel among them, or -1.

    From its widest voxel a part grows along what narrows, down to ``narrowing`` of its radius; below that another
    begins. Two that meet are one unless the way between them is narrower than ``neck`` of the smaller one's radius.
    """
    owner = np.arange(len(cells))
    for c in range(len(cells)):
        for n in range(27):
            other = np.int64(grid[cells[c, 0] + n // 9 - 1, cells[c, 1] + n // 3 % 3 - 1, cells[c, 2] + n % 3 - 1])
            if other < 0 or other >= c:
                continue
            while owner[other] != other:
                other = owner[other]
            own = np.int64(c)
            while owner[own] != own:
                own = owner[own]
            older, younger = (own, other) if own < other else (other, own)
            if older != younger and radii[c] >= narrowing * radii[older] and radii[c] >= neck * radii[younger]:
                owner[younger] = older
    for c in range(len(cells)):
        while owner[owner[c]] != owner[c]:
            owner[c] = owner[owner[c]]
    return owner
