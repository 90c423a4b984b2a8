"""The meshes that the benchmarks of the spectrum and of the Reeb graph share: closed, genus 0, five lobes, any size.

Directions on a Fibonacci spiral, triangulated by their convex hull and pushed out along five axes: irregular valences
and triangles stretched up to three times, as scans have them, and eigenvalues well apart.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from reebase.mesh.mesh import Mesh

AXES = ((0.3, 0.9, 0.3), (0.9, -0.2, 0.3), (-0.9, -0.1, 0.4), (0.4, -0.9, -0.3), (-0.4, -0.7, -0.6))
LENGTHS = (1.2, 1.8, 2.1, 1.5, 2.4)
WIDTH = 0.45


def five_lobes(vertices: int, seed: int | None = None) -> Mesh:
    """The shape with so many vertices, numbered along the spiral, or at random from a seed."""
    i = np.arange(vertices) + 0.5
    z, turn = 1 - 2 * i / vertices, np.pi * (1 + 5**0.5) * i
    ring = np.sqrt(1 - z * z)
    points = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)
    faces = ConvexHull(points).simplices
    a, b, c = points[faces].transpose(1, 0, 2)
    inside = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inside] = faces[inside][:, ::-1]
    faces = faces[np.argsort(faces.min(axis=1), kind="stable")]
    radius = np.ones(vertices)
    for axis, length in zip(AXES, LENGTHS, strict=True):
        angle = np.arccos(np.clip(points @ axis / np.linalg.norm(axis), -1, 1))
        radius += length * np.exp(-((angle / WIDTH) ** 2))
    points *= radius[:, None]
    if seed is not None:
        order = np.random.default_rng(seed).permutation(vertices)
        points, faces = points[order], np.argsort(order)[faces]
    return Mesh(points, faces)
