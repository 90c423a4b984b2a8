"""One step of the Laplacian filter over one-rings. Assumes valid input."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.denoise.exponential_kernels import FAST

__all__ = ["laplacian_step"]


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
