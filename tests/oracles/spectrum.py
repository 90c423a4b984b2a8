"""Stiffness and mass in straight loops over angles and sides (METHOD §3)."""

from __future__ import annotations

import math

import numpy as np


def angles_and_sides(mesh):
    """For each face: its corners, the angle at each and the side opposite to each (law of cosines)."""
    for face in mesh.faces.tolist():
        p = [mesh.vertices[v] for v in face]
        side = [math.dist(p[(i + 1) % 3], p[(i + 2) % 3]) for i in range(3)]
        angle = []
        for i in range(3):
            a, b, c = side[i], side[(i + 1) % 3], side[(i + 2) % 3]
            angle.append(math.acos((b * b + c * c - a * a) / (2 * b * c)))
        yield face, angle, side


def stiffness(mesh):
    """(4.11)-(4.12): half a cotangent of the opposite angle for each face at an edge, dense."""
    C = np.zeros((len(mesh.vertices),) * 2)
    for face, angle, _ in angles_and_sides(mesh):
        for i in range(3):
            j, k = face[(i + 1) % 3], face[(i + 2) % 3]
            weight = 0.5 / math.tan(angle[i])
            C[j, k] -= weight
            C[k, j] -= weight
            C[j, j] += weight
            C[k, k] += weight
    return C


def mixed_voronoi(mesh):
    """Meyer et al. 2003, figure 4, with Heron's area (1.1)."""
    cells = np.zeros(len(mesh.vertices))
    for face, angle, side in angles_and_sides(mesh):
        s = sum(side) / 2
        area = math.sqrt(s * (s - side[0]) * (s - side[1]) * (s - side[2]))
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            if max(angle) > math.pi / 2:
                cells[face[i]] += area / 2 if angle[i] > math.pi / 2 else area / 4
            else:
                cells[face[i]] += (side[j] ** 2 / math.tan(angle[j]) + side[k] ** 2 / math.tan(angle[k])) / 8
    return cells
