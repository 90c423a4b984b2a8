"""Slow twins of the denoising filters: straight loops from METHOD.md's equations, one vertex at a time."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from reebase.mesh.mesh import Mesh

FloatArray = npt.NDArray[np.float64]


def one_ring(mesh: Mesh, i: int) -> tuple[list[int], list[tuple[int, int, int]]]:
    """The neighbours of vertex i and the triangles round it."""
    triangles = [tuple(int(v) for v in face) for face in mesh.faces if i in face]
    return sorted({v for face in triangles for v in face} - {i}), triangles


def area(vertices: FloatArray, triangle: tuple[int, int, int]) -> float:
    """Heron's formula in its stable form (1.1)."""
    p, q, r = (vertices[v] for v in triangle)
    a, b, c = sorted((np.linalg.norm(p - q), np.linalg.norm(q - r), np.linalg.norm(r - p)), reverse=True)
    return math.sqrt(max(0.0, (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c)))) / 4


def mean_edge(mesh: Mesh) -> float:
    """The mean edge length (1.4)."""
    pairs = {tuple(sorted((int(f[k]), int(f[k - 1])))) for f in mesh.faces for k in range(3)}
    return float(np.mean([np.linalg.norm(mesh.vertices[a] - mesh.vertices[b]) for a, b in pairs]))


def finite_volume(
    mesh: Mesh, *, floor: float, normal: str = "minor_eigenvector", scale: str = "median",
    anisotropy: bool = True,
) -> FloatArray:  # fmt: skip
    """Positions after one step of (3.1)-(3.5), every vertex free, (m, 3); METHOD §2 (d).

    floor: the least sigma, 1e-6 mean edge lengths of the mesh that the iteration began with.
    """
    v = mesh.vertices
    result = v.copy()
    around = [one_ring(mesh, i) for i in range(len(v))]
    ring_area = [sum(area(v, t) for t in triangles) for _, triangles in around]
    for i, (neighbours, triangles) in enumerate(around):
        if not triangles:
            continue
        mu = sum(ring_area[j] * v[j] for j in neighbours) / sum(ring_area[j] for j in neighbours)
        covariance = sum(np.outer(v[j] - mu, v[j] - mu) for j in neighbours)
        weighted = sum(np.cross(v[b] - v[a], v[c] - v[a]) for a, b, c in triangles)
        weighted = weighted / (np.linalg.norm(weighted) or 1.0)
        eigenvalues, eigenvectors = np.linalg.eigh(covariance)
        deviator = covariance - np.trace(covariance) / 3 * np.eye(3)
        n = eigenvectors[:, 0]
        spread = np.linalg.norm(deviator) / math.sqrt(6)
        if normal == "area_weighted" or eigenvalues[1] - eigenvalues[0] <= 1e-6 * spread:
            n = weighted
        elif n @ weighted < 0:
            n = -n
        centroids = [sum(v[k] for k in t) / 3 for t in triangles]
        r = np.array([(v[i] - c) @ n for c in centroids])
        if scale == "median":
            sigma = 1.4826 * np.median(np.abs(r - np.median(r)))
        else:
            sigma = math.sqrt(np.mean([(v[i] - c) @ (v[i] - c) for c in centroids]))
        sigma = max(sigma, floor)
        exponents = np.array([(v[i] - c) @ (v[i] - c) / (2 * sigma**2) for c in centroids])
        w = np.exp(-(exponents - exponents.min()))
        fraction = math.sqrt(1.5) * np.linalg.norm(deviator) / np.linalg.norm(covariance)
        if not anisotropy:
            fraction = 1.0
        result[i] = v[i] - fraction * (w @ r) / w.sum() * n
    return result


def laplacian(mesh: Mesh, step: float = 1.0) -> FloatArray:
    """Positions after one step of (1.8), every vertex free, (m, 3)."""
    result = mesh.vertices.copy()
    for i in range(len(result)):
        neighbours, _ = one_ring(mesh, i)
        if neighbours:
            differences = [(mesh.vertices[j] - mesh.vertices[i]) / len(neighbours) for j in neighbours]
            result[i] += step * sum(differences)
    return result


def visual_error(first: Mesh, second: Mesh) -> float:
    """E_2 (2.33) with the geometric Laplacian (2.34)."""
    total = 0.0
    for i in range(len(first.vertices)):
        neighbours, _ = one_ring(first, i)
        delta = first.vertices[i] - second.vertices[i]
        total += delta @ delta
        if neighbours:
            delta = delta - sum(first.vertices[j] - second.vertices[j] for j in neighbours) / len(neighbours)
        total += delta @ delta
    return total / (2 * len(first.vertices))
