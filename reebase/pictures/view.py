"""From where a mesh is looked at, where that puts it in a panel, and how light falls on it. Pure numpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from reebase.errors import NoFaces, ParameterError, unknown_name
from reebase.mesh.mesh import Mesh

__all__ = ["MARGIN", "View", "crossed", "face_shades", "placed", "view_of"]

Array = npt.NDArray[np.float64]

MARGIN = 0.08
"""Share of a panel's side that stays free around the surface."""


@dataclass(frozen=True, eq=False)
class View:
    """An orthographic view. frame: the rotation whose columns point right, up and to the viewer, (3, 3)."""

    frame: Array

    def __post_init__(self) -> None:
        frame = np.asarray(self.frame, dtype=np.float64)
        if frame.shape != (3, 3) or not np.allclose(frame.T @ frame, np.eye(3), atol=1e-6):
            raise ParameterError(f"A view's frame must be a rotation (3, 3); found {frame.tolist()}.")
        object.__setattr__(self, "frame", frame)

    @classmethod
    def upright(cls, turn: float = 35.0, tilt: float = 20.0) -> View:
        """A view with +z up, from ``turn`` degrees left of +x and ``tilt`` degrees above the ground."""
        a, b = np.radians(turn), np.radians(tilt)
        towards = np.array([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), np.sin(b)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return cls(np.stack([right, np.cross(towards, right), towards], axis=1))

    @classmethod
    def principal(cls, mesh: Mesh) -> View:
        """The surface's longest axis to the right, its shortest to the viewer, then tilted a little.

        Signs: the heavier tail of the distribution along an axis points right and up.
        """
        corners = mesh.vertices[mesh.faces]
        corners = corners - corners[:1, :1]
        corners /= float(np.abs(corners).max(initial=0.0)) or 1.0  # squares of any unit are numbers
        weights = np.linalg.norm(crossed(corners), axis=1)
        if not weights.sum() > 0:
            return cls(np.eye(3))
        weights /= weights.sum()
        centred = corners.mean(axis=1)
        centred = centred - weights @ centred
        _, axes = np.linalg.eigh((centred * weights[:, None]).T @ centred)
        right, up = axes[:, 2], axes[:, 1]
        right, up = (axis * _sign(centred @ axis, weights, axis) for axis in (right, up))
        frame = np.stack([right, up, np.cross(right, up)], axis=1)
        return cls(frame @ _turned(-18.0, 22.0))


def _sign(along: Array, weights: Array, axis: Array) -> float:
    skew = float(weights @ (along * along * along))
    spread = float(weights @ (along * along)) ** 1.5
    if abs(skew) > 1e-6 * spread:
        return float(np.sign(skew))
    return float(np.sign(axis[np.argmax(np.abs(axis))]))


def _turned(about_up: float, about_right: float) -> Array:
    a, b = np.radians(about_up), np.radians(about_right)
    sideways = np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]])
    over = np.array([[1, 0, 0], [0, np.cos(b), -np.sin(b)], [0, np.sin(b), np.cos(b)]])
    turned: Array = (over @ sideways).T
    return turned


def view_of(mesh: Mesh, view: View | str | None) -> View:
    """The view asked for: a View, "principal" (also None) or "upright"."""
    if isinstance(view, View):
        return view
    if view is None or view == "principal":
        return View.principal(mesh)
    if view == "upright":
        return View.upright()
    raise unknown_name("view", view, ("principal", "upright"))


def placed(mesh: Mesh, points: Array, size: int, view: View | str | None = None) -> Array:
    """Where points (p, 3) lie in the square panel of ``mesh``: pixels right, pixels up and nearness, (p, 3).

    The surface's box fills the panel up to a margin, its aspect kept. Raises NoFaces, UnknownName.
    """
    if not len(mesh.faces):
        raise NoFaces("A mesh without faces cannot be drawn.")
    frame = view_of(mesh, view).frame
    used = mesh.vertices[np.unique(mesh.faces)] @ frame
    low, high = used.min(axis=0), used.max(axis=0)
    extent = float((high - low)[:2].max())
    scale = (1 - 2 * MARGIN) * size / extent if extent > 0 else 1.0
    seen: Array = (np.asarray(points, dtype=np.float64) @ frame - (low + high) / 2) * scale
    seen[:, :2] += size / 2
    return seen


def face_shades(seen: Array, faces: npt.NDArray[np.int32]) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Brightness of each face, (n,), in [0, 1], and whether it can be seen.

    seen: vertices in the panel. A headlight, a weaker light from the upper left, and a bright sky; normals are
    smoothed over vertices, so that coarse meshes do not look faceted. Of a closed surface only the front faces
    are seen, of any other both sides.
    """
    normals = crossed(seen[faces])
    sums = [np.bincount(faces.ravel(), np.repeat(axis, 3), len(seen)) for axis in normals.T]
    smooth = _unit(_unit(np.stack(sums, axis=1))[faces].mean(axis=1))
    if _is_solid(seen, faces):
        visible = normals[:, 2] > 0
    else:
        visible = normals[:, 2] != 0
        smooth = _unit(np.where((smooth * normals).sum(axis=1)[:, None] > 0, smooth, normals))
        smooth *= np.where(smooth[:, 2] < 0, -1.0, 1.0)[:, None]
    key = np.array([-0.45, 0.65, 0.61])
    light = 0.42 * np.clip(smooth[:, 2], 0, 1) + 0.38 * np.clip(smooth @ key, 0, 1) + 0.1 * (1 + smooth[:, 1])
    return np.clip(light, 0, 1), visible


def _is_solid(vertices: Array, faces: npt.NDArray[np.int32]) -> bool:
    """Whether the surface is closed and its faces turn outwards."""
    halves = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    forward = np.sort(halves[:, 0] * len(vertices) + halves[:, 1])
    backward = np.sort(halves[:, 1] * len(vertices) + halves[:, 0])
    first, second, third = vertices[faces].transpose(1, 0, 2)
    volume = float((np.cross(first, second) * third).sum())
    return volume > 0 and bool((forward == backward).all())


def _unit(rows: Array) -> Array:
    unit: Array = rows / np.maximum(np.linalg.norm(rows, axis=1), 1e-300)[:, None]
    return unit


def crossed(corners: Array) -> Array:
    # Written out: numpy's own product takes five times as long.
    (ax, ay, az), (bx, by, bz) = ((corners[:, k] - corners[:, 0]).T for k in (1, 2))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)
