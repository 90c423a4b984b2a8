"""What may differ between two scans of one shape without making it another shape."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from reebase.mesh.mesh import Mesh

__all__ = ["random_rotation", "rotated", "scaled", "shuffled"]

SCALES = (0.1, 10.0)
"""Range of the random scale, drawn uniformly in its logarithm."""


def random_rotation(random: np.random.Generator) -> npt.NDArray[np.float64]:
    """A rotation drawn uniformly from SO(3), (3, 3): the unit quaternion of four normal draws."""
    draws = random.standard_normal(4)
    w, x, y, z = draws / np.sqrt((draws**2).sum())
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def rotated(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """The mesh under a random rotation about the origin."""
    return Mesh(mesh.vertices @ random_rotation(random).T, mesh.faces)


def scaled(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """The mesh times a random factor of ``SCALES``."""
    low, high = np.log(SCALES)
    return Mesh(mesh.vertices * np.exp(random.uniform(low, high)), mesh.faces)


def shuffled(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """The same surface with its vertices and faces in random order, each face from a random corner on."""
    old_of_new = random.permutation(len(mesh.vertices))
    new_of_old = np.argsort(old_of_new)
    faces = new_of_old[mesh.faces][random.permutation(len(mesh.faces))]
    corner = (np.arange(3) + random.integers(0, 3, size=len(faces))[:, None]) % 3
    turned = faces[np.arange(len(faces))[:, None], corner]
    return Mesh(mesh.vertices[old_of_new], turned.astype(np.int32))
