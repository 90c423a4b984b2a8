"""``views``: what the shape looks like from eighteen sides (after the light field descriptor of Chen, Tian, Shen,
Ouhyoung, "On Visual Similarity Based 3D Model Retrieval", Computer Graphics Forum 22(3), 2003, and the depth buffers
of Vranic, "3D Model Retrieval", 2004; METHOD §6).

The idea: two shapes are alike if they look alike from all around. A frame turns the shape into a position of its own,
depth images are taken along the three axes and the six diagonals between them, from both ends; each becomes an image of
how squarely the surface faces the eye, which says more than depth does, and keeps the magnitudes of its Fourier
coefficients round concentric rings, which do not change when the image turns or flips.
Which axis is which, and which way it points, is left open: all 48 turns and flips of a cube are tried, in two frames.
Use it for rigid shapes of any quality: it needs neither connectivity nor a clean surface. A bent limb changes it.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.descriptors.surface import Surface
from reebase.errors import ParameterError
from reebase.matching import Comparison, Stack
from reebase.mesh.geometry import doubled_normals, lengths
from reebase.mesh.mesh import Mesh

__all__ = ["VIEWS", "canonical_frames", "describe"]

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.floating[Any]]

SIZE = 64
"""Pixels along a side of an image."""

REACH = 2.0
"""Half the width of the window, and half the range of depths, in root mean square distances from the centroid. What
lies farther is cut off: one long limb must not make the rest small."""

RINGS = 10
"""Concentric rings on which an image is sampled, each at 64 points."""

WAVES = 10
"""Fourier coefficients kept of each ring: 0 to 9 waves around it."""

POINTS = 64

WEIGHT = 0.25
"""Power of a ring's radius by which it counts: less than its length, as limbs far out are what bends."""

_AXES = np.array(
    [
        [1, 0, 0], [0, 1, 0], [0, 0, 1],
        [0, 1, 1], [0, 1, -1], [1, 0, 1], [1, 0, -1], [1, 1, 0], [1, -1, 0],
    ]
)  # fmt: skip

SIDES = 2 * len(_AXES)
"""Images of one frame: along each axis from the front, then from the back."""


def describe(surface: Surface) -> Array:
    """A row for each view, 18 in each of two frames: magnitudes ring by ring, float64, (36, 100)."""
    from reebase.descriptors.views_kernels import depth_images

    mesh = surface.body
    centroid, radius, frames = canonical_frames(mesh)
    images = np.empty((len(frames), 2, len(_AXES), SIZE, SIZE))
    for frame, turned in zip(frames, images, strict=True):
        placed = (mesh.vertices - centroid) @ frame / (REACH * radius)
        for axis, front, back in zip(_BASES, turned[0], turned[1], strict=True):
            depth_images(placed @ axis, mesh.faces, front, back)
    images[:, 1] *= -1.0  # as seen from behind, the near side up
    facing = np.where(np.isfinite(images), _facing(images), 0.0)
    rings = np.zeros((*images.shape[:3], RINGS, POINTS))
    for pixels, weights in _SAMPLES:
        rings += weights * facing.reshape(*images.shape[:3], -1)[..., pixels]
    waves = np.abs(np.fft.rfft(rings)[..., :WAVES]) / POINTS
    return np.asarray(waves * _RADII[:, None] ** WEIGHT).reshape(len(frames) * SIDES, -1)


def _facing(images: Array) -> Array:
    """The squared cosine of the angle between the eye and the normal of the depth image, in [0, 1].

    Outlines, and edges behind which the surface goes on farther away, are steep; all that is empty is at the far side.
    """
    depth = np.clip(np.where(np.isfinite(images), images, -1.0), -1.0, 1.0) * (SIZE / 2)
    return np.asarray(1.0 / (1.0 + np.gradient(depth, axis=-2) ** 2 + np.gradient(depth, axis=-1) ** 2))


def canonical_frames(mesh: Mesh) -> tuple[Array, float, tuple[Array, Array]]:
    """The centroid of the surface, (3,), the root mean square distance from it, and two frames, columns = axes.

    The principal axes of the points of the surface, by its exact second moments, and of the faces' normals, weighted
    by area; the greatest first. A shape without one main direction often has one of its normals.
    """
    corners = mesh.vertices[mesh.faces]
    normals = doubled_normals(mesh)
    areas = lengths(normals)
    shares = areas / areas.sum()
    middles = corners.mean(axis=1)
    centroid = shares @ middles
    ends, middles = corners - centroid, middles - centroid
    # Over a triangle the mean of x x^T is (sum over corners of x x^T + 9 m m^T) / 12 with m its centroid.
    weighted = (shares[:, None, None] * ends).reshape(-1, 3)
    spread = weighted.T @ ends.reshape(-1, 3) + 9 * (shares[:, None] * middles).T @ middles
    facing = ((shares / np.maximum(areas, np.finfo(np.float64).tiny) ** 2)[:, None] * normals).T @ normals
    first, second = (np.linalg.eigh(moments)[1][:, ::-1] for moments in (spread, facing))
    return centroid, float(np.sqrt(np.trace(spread) / 12)), (first, second)


def _bases() -> Array:
    """Of each axis a base that looks along it, columns = right, up, towards the eye.

    Right is an axis of the frame, so that the turns of the cube move pixels onto pixels and change nothing else.
    """
    out = []
    for axis in _AXES:
        right = np.eye(3)[int(np.argmin(np.abs(axis)))]
        eye = axis / np.linalg.norm(axis)
        out.append(np.stack([right, np.cross(eye, right), eye], axis=1))
    return np.array(out)


def _samples() -> list[tuple[npt.NDArray[np.int64], Array]]:
    """The four pixels round each point of each ring, (rings, points), and their bilinear weights."""
    angles = 2 * np.pi * np.arange(POINTS) / POINTS
    place = (np.multiply.outer(_RADII, np.stack([np.cos(angles), np.sin(angles)], axis=1)) + 1) * SIZE / 2 - 0.5
    low = np.floor(place).astype(np.int64)
    part = place - low
    out = []
    for x, y in itertools.product((0, 1), (0, 1)):
        weights = np.where(x, part[..., 0], 1 - part[..., 0]) * np.where(y, part[..., 1], 1 - part[..., 1])
        out.append(((low[..., 0] + x) * SIZE + low[..., 1] + y, weights))
    return out


def _turns() -> npt.NDArray[np.int64]:
    """Where the 48 turns and flips of the cube take each view, (48, 18)."""
    directions = np.concatenate([_AXES, -_AXES])
    signed = [np.diag(signs)[list(order)] for order in itertools.permutations(range(3))
              for signs in itertools.product((1, -1), repeat=3)]  # fmt: skip
    return np.array([
        [int(np.flatnonzero((directions == turn @ view).all(axis=1))[0]) for view in directions] for turn in signed
    ])  # fmt: skip


_RADII = (np.arange(RINGS) + 0.5) / RINGS
_BASES = _bases()
_SAMPLES = _samples()
_TURNS = _turns()


def _as_views(kept: npt.ArrayLike, name: str) -> npt.NDArray[np.float32]:
    rows = np.ascontiguousarray(kept, dtype=np.float32)
    if rows.size != 2 * SIDES * RINGS * WAVES or not np.isfinite(rows).all():
        raise ParameterError(
            f"{name} must be {2 * SIDES} x {RINGS * WAVES} finite numbers; found shape {rows.shape}.", parameter=name
        )
    return rows.reshape(2 * SIDES, RINGS * WAVES)


def _one_to_many(query: Floats, stack: Stack, measure: str) -> Array:
    from reebase.descriptors.views_kernels import least_over_turns

    out = np.empty(stack.shapes)
    least_over_turns(query, stack.values, _TURNS, out)
    return out


VIEWS = Comparison(_as_views, _one_to_many, precision=np.float32)
"""Mean over the views of the sums of absolute differences, the least over both frames and the 48 turns and flips."""
