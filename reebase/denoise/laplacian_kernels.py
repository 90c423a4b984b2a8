"""Steps of the Laplacian filter over one-rings. They assume valid input."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.denoise.exponential_kernels import FAST

__all__ = ["laplacian_step", "laplacian_steps"]

IntArray = npt.NDArray[np.int32]
FloatArray = npt.NDArray[np.float64]


@FAST
def laplacian_step(
    positions: npt.NDArray[np.float64], starts: npt.NDArray[np.int32], neighbours: npt.NDArray[np.int32],
    step: float,
) -> npt.NDArray[np.float64]:  # fmt: skip
    """``step`` times the mean of v_j - v_i over the neighbours j of each i, (m, 3), zero without
    neighbours."""
    displacements = np.zeros_like(positions)
    for i in range(len(positions)):
        degree = starts[i + 1] - starts[i]
        if degree == 0:
            continue
        x, y, z = 0.0, 0.0, 0.0
        # A signed index costs a test whether it counts from the end.
        for k in range(np.uint32(starts[i]), np.uint32(starts[i + 1])):
            j = np.uint32(neighbours[k])
            x += positions[j, 0] - positions[i, 0]
            y += positions[j, 1] - positions[i, 1]
            z += positions[j, 2] - positions[i, 2]
        scale = step / degree
        displacements[i, 0], displacements[i, 1], displacements[i, 2] = scale * x, scale * y, scale * z
    return displacements


@FAST
def laplacian_steps(
    positions: FloatArray, starts: IntArray, neighbours: IntArray, shares: FloatArray
) -> FloatArray:
    """The positions after one step with each of the shares, (m, 3)."""
    here, there = positions.copy(), np.empty_like(positions)
    for share in shares:
        for i in range(len(here)):
            begin, end = np.uint32(starts[i]), np.uint32(starts[i + 1])
            x, y, z = 0.0, 0.0, 0.0
            for k in range(begin, end):
                j = np.uint32(neighbours[k])
                x += here[j, 0]
                y += here[j, 1]
                z += here[j, 2]
            own = 1.0 - share if end > begin else 1.0
            other = share / (end - begin) if end > begin else 0.0
            there[i, 0] = own * here[i, 0] + other * x
            there[i, 1] = own * here[i, 1] + other * y
            there[i, 2] = own * here[i, 2] + other * z
        here, there = there, here
    return here
