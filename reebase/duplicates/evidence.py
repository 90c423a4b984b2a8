"""What two surfaces have in common, in numbers: how one lies on the other, and how far from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from reebase.denoise.distance import distances_to_surface
from reebase.duplicates.alignment import Similarity, Surface, best_similarities, fitted
from reebase.mesh.geometry import face_areas, signed_volume

__all__ = ["Evidence", "compared"]

Array = npt.NDArray[np.float64]

NEAR = 0.7
"""Residual in mean edge lengths, of all but the farthest hundredth, up to which one surface lies on the other."""

NEAR_SIZE = 0.06
"""The same in sizes of the shape: an edge of a coarse mesh is long."""

CHECKED = 400
"""Points of each surface whose distance to the other is taken."""

WORSE = 2.0
"""How much worse a fit must be before the other handedness is told."""

FLAT = 1e-3
"""A residual in mean edge lengths below which there is none: float32 and rounding."""

MATCHED = 0.45
"""Mean edge lengths within which vertices may correspond."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """How the first surface lies on the second.

    similarity: what puts it there. mirrored: whether it takes a mirror image; None where the shape is so symmetric
    that it cannot be told. residual, farthest: mean distance between the surfaces and that of all but the farthest
    hundredth, in mean edge lengths of the coarser mesh. of_size: the latter over the shape's size, its root mean square
    distance to the centre: where edges are long it says more. same_faces: share of the faces that both have, once
    vertices are matched. vertices: those of the first over those of the second. area, volume: likewise, after
    scaling; volume is None where a mesh encloses none.
    """

    similarity: Similarity
    mirrored: bool | None
    residual: float
    farthest: float
    of_size: float
    same_faces: float
    vertices: float
    area: float
    volume: float | None


def compared(first: Surface, second: Surface) -> Evidence | None:
    """The evidence that both are one shape, None where there is none: the surfaces do not lie on one another.

    Of several ways in which they do, the least is told: in place before moved, turned before mirrored.
    """
    scale = second.size / (first.size or 1.0)
    plain = [Similarity(1.0, np.eye(3), np.zeros(3)), Similarity(scale, np.eye(3), np.zeros(3))]
    by_order: list[Similarity] = []
    if np.array_equal(np.sort(first.mesh.faces, axis=1), np.sort(second.mesh.faces, axis=1)):
        # Most copies keep the order of their vertices, and then there is nothing to search for. But a mirror image may
        # be the shape itself, turned.
        by_order = fitted(first.mesh.vertices, second.mesh.vertices)
    for one in (*plain, *by_order[:1]):
        found = _residuals(one, first, second)
        if _is_near(found, one, first, second) and found[0] <= FLAT:
            return _evidence(one, found, first, second, False)
    fits = best_similarities(first, second)
    if not fits:
        return None
    # By order comes first: with noise a symmetric shape lies as well on itself the other way round, on other triangles.
    turned = [*by_order[:1], *(_by_vertices(one, first, second) for one in fits), *by_order[1:]]
    ways = [*plain, *turned]
    residuals = [_residuals(one, first, second) for one in ways]
    best = min(range(len(ways)), key=lambda way: residuals[way][0])
    if not _is_near(residuals[best], ways[best], first, second):
        return None
    enough = WORSE * max(residuals[best][0], FLAT)
    chosen = next(
        way for way in range(len(ways))
        if residuals[way][0] <= enough and _is_near(residuals[way], ways[way], first, second)
    )  # fmt: skip
    fit = {one.mirrors for one, found in zip(turned, residuals[len(plain) :], strict=True) if found[0] <= enough}
    mirrored = None if len(fit) == 2 and chosen >= len(plain) else ways[chosen].mirrors
    return _evidence(ways[chosen], residuals[chosen], first, second, mirrored)


def _is_near(residuals: tuple[float, float], similarity: Similarity, first: Surface, second: Surface) -> bool:
    most = NEAR_SIZE * second.size / (_edge(similarity, first, second) or 1.0)
    return residuals[1] <= min(NEAR, most)


def _edge(similarity: Similarity, first: Surface, second: Surface) -> float:
    return max(similarity.scale * first.edge, second.edge)


def _residuals(similarity: Similarity, first: Surface, second: Surface) -> tuple[float, float]:
    """Mean and 99th percentile of the distances of points of each surface to the other, in mean edge lengths.

    Infinite where the points of the two surfaces, whose distances are quicker to find, are too far apart already.
    """
    edge = _edge(similarity, first, second)
    there = similarity(first.some(CHECKED))
    back = (second.some(CHECKED) - similarity.shift) @ similarity.rotation / similarity.scale
    for points, onto, unit in ((there, second, edge), (back, first, edge / similarity.scale)):
        reach = onto.nearest(points)[0]
        if float(np.quantile(reach, 0.99)) > NEAR * unit + 4 * onto.spacing:
            return np.inf, np.inf
    distances = np.concatenate([
        distances_to_surface(there, second.mesh), distances_to_surface(back, first.mesh) * similarity.scale,
    ]) / edge  # fmt: skip
    return float(distances.mean()), float(np.quantile(distances, 0.99))


def _matches(similarity: Similarity, first: Surface, second: Surface) -> npt.NDArray[np.int64]:
    """The vertex of the second that each of the first lies at, -1 where none is near or two would be at one."""
    from scipy.spatial import cKDTree

    found = cKDTree(second.mesh.vertices).query(similarity(first.mesh.vertices))
    distance, near = np.asarray(found[0]), np.asarray(found[1], dtype=np.int64)
    order = np.lexsort((distance, near))
    nearest = np.ones(len(near), dtype=bool)
    nearest[order[1:]] = near[order[1:]] != near[order[:-1]]
    return np.where(nearest & (distance <= MATCHED * _edge(similarity, first, second)), near, -1)


def _by_vertices(similarity: Similarity, first: Surface, second: Surface) -> Similarity:
    """The least-squares fit of matching vertices, where most match: exact where the surface alone is not."""
    match = _matches(similarity, first, second)
    matched = match >= 0
    if matched.sum() < 0.9 * max(len(first.mesh.vertices), len(second.mesh.vertices)):
        return similarity
    return fitted(first.mesh.vertices[matched], second.mesh.vertices[match[matched]])[int(similarity.mirrors)]


def _same_faces(similarity: Similarity, first: Surface, second: Surface) -> float:
    match = _matches(similarity, first, second)
    faces = match[first.mesh.faces]
    ours = {tuple(sorted(face)) for face in faces[(faces >= 0).all(axis=1)].tolist()}
    theirs = {tuple(sorted(face)) for face in second.mesh.faces.tolist()}
    return len(ours & theirs) / max(len(first.mesh.faces), len(second.mesh.faces))


def _evidence(
    similarity: Similarity, residuals: tuple[float, float], first: Surface, second: Surface, mirrored: bool | None
) -> Evidence:
    one, other = abs(signed_volume(first.mesh)), abs(signed_volume(second.mesh))
    least = 1e-3 * second.size**3
    return Evidence(
        similarity=similarity,
        mirrored=mirrored,
        residual=residuals[0],
        farthest=residuals[1],
        of_size=residuals[1] * _edge(similarity, first, second) / (second.size or 1.0),
        same_faces=_same_faces(similarity, first, second),
        vertices=len(first.mesh.vertices) / len(second.mesh.vertices),
        area=float(face_areas(first.mesh).sum() * similarity.scale**2 / face_areas(second.mesh).sum()),
        volume=one * similarity.scale**3 / other if min(one * similarity.scale**3, other) > least else None,
    )
