"""How far a denoised mesh is from the truth. Both have the same faces; only positions differ."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from reebase.errors import MeshError, NoFaces, ParameterError
from reebase.mesh.geometry import face_areas, face_normals, lengths, mean_edge_length, signed_volume
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import edges

__all__ = [
    "Errors", "displacement", "edge_angle", "face_normal_error", "mean_angle", "measure_errors", "vertex_error",
    "visual_error", "volume_change",
]  # fmt: skip

FloatArray = npt.NDArray[np.float64]

SHARP = 60.0
"""The angle between the normals beside an edge, in degrees, above which the edge is a feature."""


@dataclass(frozen=True)
class Errors:
    """Every measure of this module at once, without units of length.

    mean_angle, edge_angle: degrees; the latter None without sharp edges. face_normal_error: in [0, 2]. visual_error: in
    squared mean edge lengths of the truth. displacement: in its mean edge lengths. vertex_error: over its diagonal.
    volume_change: percent, None where the faces enclose no volume.
    """

    mean_angle: float
    edge_angle: float | None
    face_normal_error: float
    visual_error: float
    displacement: float
    vertex_error: float
    volume_change: float | None


def measure_errors(truth: Mesh, result: Mesh) -> Errors:
    """How far a result is from the truth, by every measure.

    Raises ParameterError, NoFaces, MeshError for a truth that is a single point.
    """
    length = mean_edge_length(truth) or 1.0
    try:
        volume: float | None = volume_change(truth, result)
    except MeshError:
        volume = None
    return Errors(
        mean_angle(truth, result), edge_angle(truth, result), face_normal_error(truth, result),
        visual_error(truth, result) / length**2, displacement(truth, result), vertex_error(truth, result), volume,
    )  # fmt: skip


def mean_angle(truth: Mesh, result: Mesh) -> float:
    """The mean angle between corresponding face normals, in degrees (the field's MSAE).

    Faces without area in either mesh have no normal and do not count. Raises ParameterError, NoFaces.
    """
    angles = angles_between(truth, result)
    angles = angles[np.isfinite(angles)]
    return float(angles.mean()) if len(angles) else 0.0


def edge_angle(truth: Mesh, result: Mesh, sharp: float = SHARP) -> float | None:
    """The mean angle of the faces within one ring of the truth's sharp edges, in degrees; None without such.

    These are the faces with a vertex on an edge between two faces whose true normals are more than ``sharp`` degrees
    apart. Raises ParameterError, NoFaces.
    """
    angles = angles_between(truth, result)
    found = edges(truth.faces)
    first, second = found.pairs
    normals = face_normals(truth)
    bent = (normals[first // 3] * normals[second // 3]).sum(axis=1) < np.cos(np.radians(sharp))
    beside = np.zeros(len(truth.vertices), dtype=bool)
    beside[found.vertices[found.of_side[first[bent]]]] = True
    near = beside[truth.faces].any(axis=1) & np.isfinite(angles)
    return float(angles[near].mean()) if near.any() else None


def angles_between(truth: Mesh, result: Mesh) -> FloatArray:
    """The angle between the normals of each face, degrees, (n,); NaN where one has no area."""
    same_faces(truth, result)
    first, second = face_normals(truth), face_normals(result)
    proper = (lengths(first) > 0) & (lengths(second) > 0)
    # The arc cosine of a product near 1 would lose half the digits of a small angle.
    angles = np.degrees(np.arctan2(lengths(np.cross(first, second)), (first * second).sum(axis=1)))
    return np.where(proper, angles, np.nan)


def displacement(truth: Mesh, result: Mesh) -> float:
    """The mean distance of corresponding vertices, in mean edge lengths of the truth.

    Vertices that no face refers to do not count. Raises ParameterError, NoFaces.
    """
    same_faces(truth, result)
    used = np.unique(truth.faces)
    length = mean_edge_length(truth)
    moved = float(lengths(result.vertices[used] - truth.vertices[used]).mean())
    return moved / length if length > 0 else 0.0


def face_normal_error(truth: Mesh, result: Mesh) -> float:
    """The L2 face-normal error (3.8): sum_i A(t^_i) |n(t_i) - n(t^_i)| / A(M^), with M^ the result; in [0,
    2].

    Raises ParameterError, NoFaces.
    """
    same_faces(truth, result)
    areas = face_areas(result)
    total = float(areas.sum())
    differences = lengths(face_normals(truth) - face_normals(result))
    return float((areas * differences).sum()) / total if total > 0 else 0.0


def visual_error(truth: Mesh, result: Mesh) -> float:
    """E_2 (2.33): (sum |v_i - v^_i|^2 + sum |I(v_i) - I(v^_i)|^2) / 2m, in squared units of length.

    I(v_i) = v_i - sum_{j~i} v_j / d_i (2.34); vertices that no face refers to do not count.
    Raises ParameterError, NoFaces.
    """
    same_faces(truth, result)
    pairs = edges(truth.faces).vertices
    first, second = np.concatenate([pairs, pairs[:, ::-1]]).T
    count = len(truth.vertices)
    degrees = np.bincount(first, minlength=count)
    used = degrees > 0
    change = np.where(used[:, None], truth.vertices - result.vertices, 0.0)
    sums = [np.bincount(first, change[second, axis], count) for axis in range(3)]
    smoothed = change - np.stack(sums, axis=1) / np.maximum(degrees, 1)[:, None]
    return float((change**2).sum() + (smoothed**2).sum()) / (2 * int(used.sum()))


def vertex_error(truth: Mesh, result: Mesh) -> float:
    """The mean distance from the result's vertices to the truth's surface, over the truth's bounding-box
    diagonal.

    Faces may differ. Vertices that no face refers to do not count. Raises NoFaces, MeshError for a truth
    that is a single point.
    """
    if len(truth.faces) == 0 or len(result.faces) == 0:
        raise NoFaces
    corners = truth.vertices[np.unique(truth.faces)]
    diagonal = float(np.linalg.norm(corners.max(axis=0) - corners.min(axis=0)))
    if diagonal == 0:
        raise MeshError("The true mesh is a single point, so distances have no scale.")
    from reebase.denoise.distance import distances_to_surface

    return float(distances_to_surface(result.vertices[np.unique(result.faces)], truth).mean()) / diagonal


def volume_change(truth: Mesh, result: Mesh) -> float:
    """100 (V(result) - V(truth)) / V(truth), in percent: negative when the result is smaller.

    Raises ParameterError, NoFaces, MeshError when the faces do not enclose a volume.
    """
    same_faces(truth, result)
    if not edges(truth.faces).balanced.all():
        raise MeshError("The mesh is not closed or not consistently oriented, so it has no volume.")
    volume = signed_volume(truth)
    if volume == 0:
        raise MeshError("The true mesh encloses no volume.")
    return 100 * (signed_volume(result) - volume) / volume


def same_faces(truth: Mesh, result: Mesh) -> None:
    """Raises ParameterError when the meshes have different faces or numbers of vertices, NoFaces without
    any."""
    if len(truth.faces) == 0:
        raise NoFaces
    if truth.vertices.shape != result.vertices.shape or not np.array_equal(truth.faces, result.faces):
        raise ParameterError(
            f"A mesh and its truth must have the same faces; the truth is {truth!r}, the mesh {result!r}.",
            parameter="truth",
        )
