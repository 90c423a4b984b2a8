"""Joints and frames: how the figures are put together.

A figure looks along +x, its left is +y and up is +z. A limb's own frame has the limb along x and its upper
side along z, so a turn about z swings it sideways and a positive turn about y lets it droop.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from reebase.evaluation.synthetic.implicit import Ellipsoid, Limb

__all__ = ["Array", "Random", "ball", "between", "chain", "limb", "mirror", "turn", "vector"]

Array = npt.NDArray[np.float64]
Random = np.random.Generator


def vector(x: float, y: float, z: float) -> Array:
    """A point or direction, (3,)."""
    return np.array([x, y, z], dtype=np.float64)


def turn(axis: str, degrees: float) -> Array:
    """Rotation about a coordinate axis, (3, 3)."""
    first = "xyz".index(axis)
    i, j = (first + 1) % 3, (first + 2) % 3
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    rotation = np.eye(3)
    rotation[i, i] = rotation[j, j] = cosine
    rotation[i, j], rotation[j, i] = -sine, sine
    return rotation


def chain(
    start: Array, frame: Array, lengths: Sequence[float], turns: Sequence[Array]
) -> tuple[Array, Array]:
    """Joints (n + 1, 3) of bones, each turned against the one before, and the last bone's frame."""
    joints = [start]
    for length, rotation in zip(lengths, turns, strict=True):
        frame = frame @ rotation
        joints.append(joints[-1] + length * frame[:, 0])
    return np.array(joints), frame


def limb(
    joints: Array | Sequence[Array], radii: Sequence[float] | Array, blend: float = 0.0,
    free: tuple[float, float] | None = None,
) -> Limb:  # fmt: skip
    """A limb through these joints."""
    return Limb(np.asarray(joints, dtype=np.float64), np.asarray(radii, dtype=np.float64), blend, free)


def ball(centre: Array, radii: Sequence[float], frame: Array | None = None, blend: float = 0.0) -> Ellipsoid:
    """An ellipsoid; without a frame its axes are those of the coordinates."""
    return Ellipsoid(centre, np.asarray(radii), np.eye(3) if frame is None else frame, blend)


def mirror(side: int, rotation: Array) -> Array:
    """The rotation as seen on that side: +1 the left as it is, -1 the right, mirrored in y."""
    flip = np.array([1.0, side, 1.0])
    mirrored: Array = flip[:, None] * rotation * flip
    return mirrored


def between(random: Random, low: float, high: float) -> float:
    """A uniform draw."""
    return float(random.uniform(low, high))
