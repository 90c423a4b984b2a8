"""Synthetic noise (2.31), (3.7): v_i = u_i + sigma (eta_i o n_i), eta_i ~ N(0, I), sigma = strength * mean
edge length.

As printed, each component of the normal is scaled by a draw of its own, which is not along the normal as
the text says; both readings are here by name.
"""

from __future__ import annotations

import math

import numpy as np

from reebase.errors import ParameterError, unknown_name
from reebase.mesh.geometry import mean_edge_length, vertex_normals
from reebase.mesh.mesh import Mesh

__all__ = ["NOISES", "add_noise"]

NOISES = {
    "normal": "v = u + sigma eta n, one draw a vertex: along the normal",
    "hadamard": "v = u + sigma (eta o n), three draws a vertex: the equation as printed",
    "isotropic": "v = u + sigma eta, three draws a vertex: in all directions alike",
}
"""The kinds of noise by name."""


def add_noise(mesh: Mesh, strength: float = 0.4, kind: str = "normal", seed: int = 0) -> Mesh:
    """The mesh with Gaussian noise on its vertices; the same seed gives the same mesh.

    strength: sigma in mean edge lengths (1.4), finite, not negative; 0.4 in the thesis. kind: a name from
    NOISES. n is the vertex normal (1.3), the unweighted mean of face normals. Isolated vertices stay
    untouched. Raises UnknownName, ParameterError.
    """
    if kind not in NOISES:
        raise unknown_name("kind", kind, NOISES)
    if not (math.isfinite(strength) and strength >= 0):
        raise ParameterError(
            f"strength must be a finite number, not negative; found {strength!r}.",
            parameter="strength", found=repr(strength),
        )  # fmt: skip
    random = np.random.default_rng(seed)
    draws = random.standard_normal((len(mesh.vertices), 1 if kind == "normal" else 3))
    direction = 1.0 if kind == "isotropic" else vertex_normals(mesh)
    used = np.zeros(len(mesh.vertices), dtype=bool)
    used[mesh.faces.ravel()] = True
    noisy = mesh.vertices.copy()
    noisy[used] += (strength * mean_edge_length(mesh) * draws * direction)[used]
    return Mesh(noisy, mesh.faces)
