"""Copies of a mesh that are the same shape to a person: what exports, modellers and scanners do to a file.

``DISTURBANCES`` by name, each (mesh, random) -> mesh. What is measured on them: whether a descriptor still finds the
original first, and whether the search for duplicates sees the copy and says what was done to it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from reebase.denoise.noise import add_noise
from reebase.evaluation.collapse import decimated, remeshed
from reebase.evaluation.synthetic.disturb import random_rotation, rotated, scaled, shuffled
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read
from reebase.mesh.write import to_bytes

__all__ = ["DISTURBANCES", "Disturbance"]

Disturbance = Callable[[Mesh, np.random.Generator], Mesh]

INCH = 25.4
NOISE = 0.2
"""In mean edge lengths."""

COPIES = 3


def _exported(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """As an STL: float32, and no two triangles share a vertex."""
    return read(to_bytes(mesh, "stl"), "stl")


def _moved(mesh: Mesh, random: np.random.Generator) -> Mesh:
    turned = rotated(mesh, random)
    size = float(np.ptp(mesh.vertices, axis=0).max())
    return Mesh(turned.vertices + size * random.standard_normal(3), turned.faces)


def _in_inches(mesh: Mesh, random: np.random.Generator) -> Mesh:
    return Mesh(mesh.vertices / INCH, mesh.faces)


def _mirrored(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Reflected, its faces still turned outwards, and moved so that the plane is not told."""
    return _moved(Mesh(mesh.vertices * [-1.0, 1.0, 1.0], mesh.faces[:, ::-1]), random)


def _decimated(mesh: Mesh, random: np.random.Generator) -> Mesh:
    return _moved(decimated(mesh, len(mesh.vertices) // 2), random)


def _remeshed(mesh: Mesh, random: np.random.Generator) -> Mesh:
    return _moved(remeshed(mesh, random), random)


def _noisy(mesh: Mesh, random: np.random.Generator) -> Mesh:
    return _moved(add_noise(mesh, NOISE, seed=int(random.integers(2**31))), random)


def _several(mesh: Mesh, random: np.random.Generator) -> Mesh:
    """Copies side by side in one file, each turned as it likes."""
    step = 2.0 * float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    centre = mesh.vertices.mean(axis=0)
    placed = [
        (mesh.vertices - centre) @ random_rotation(random).T + [step * number, 0.0, 0.0] for number in range(COPIES)
    ]
    faces = [mesh.faces + number * len(mesh.vertices) for number in range(COPIES)]
    return Mesh(np.concatenate(placed), np.concatenate(faces))


DISTURBANCES: Mapping[str, Disturbance] = MappingProxyType({
    "exported": _exported,
    "shuffled": shuffled,
    "moved": _moved,
    "in_inches": _in_inches,
    "rescaled": scaled,
    "mirrored": _mirrored,
    "remeshed": _remeshed,
    "decimated": _decimated,
    "noisy": _noisy,
    "copies": _several,
})  # fmt: skip
"""name -> what is done. Decimation is to half the vertices, noise 0.2 mean edge lengths; these, remeshing and mirroring
come with a rigid motion."""
