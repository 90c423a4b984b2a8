"""Figures as implicit surfaces: bodies and limbs, blended into one signed distance.

A limb is a chain of rounded cones (the hull of two balls), a body an ellipsoid. The parts of a figure are
joined in order by the quadratic smooth minimum, so that limbs grow out of the body without a crease. The
field is negative inside, and close to the Euclidean distance near the surface. Formulas after I. Quilez,
"Distance functions" and "Smooth minimum" (iquilezles.org).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["Ellipsoid", "Field", "Figure", "Limb", "is_clear"]

Array = npt.NDArray[np.float64]

_CHUNK = 1024
"""Points evaluated at a time: few enough that the tables of points by bones stay in the cache."""

_SAMPLES = 48
"""Points along a limb at which its clearance is checked."""


@dataclass(frozen=True, eq=False)
class Limb:
    """A chain of rounded cones.

    joints: (n + 1, 3). radii: (n + 1,), positive, the thickness at each joint.
    blend: width of the smooth union with the parts before it, in units of length; 0 is a sharp union.
    free: the stretch that may touch nothing else, as shares of the length from the first joint, if any.
    """

    joints: Array
    radii: Array
    blend: float = 0.0
    free: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """A body. centre: (3,). radii: (3,) along the columns of frame, a rotation, (3, 3). blend: as in Limb."""

    centre: Array
    radii: Array
    frame: Array
    blend: float = 0.0


@dataclass(frozen=True, eq=False)
class Figure:
    """Parts in the order in which they are blended, and the genus that their surface must have."""

    parts: tuple[Limb | Ellipsoid, ...]
    genus: int = 0

    @property
    def area(self) -> float:
        """Sum of the parts' areas: more than the area of their union, which is what is wanted of it."""
        total = 0.0
        for part in self.parts:
            if isinstance(part, Limb):
                lengths = np.linalg.norm(np.diff(part.joints, axis=0), axis=1)
                total += float(np.pi * (lengths * (part.radii[1:] + part.radii[:-1])).sum())
            else:
                a, b, c = part.radii**1.6075
                total += float(4 * np.pi * ((a * b + b * c + a * c) / 3) ** (1 / 1.6075))
        return total

    @property
    def thinnest(self) -> float:
        """The smallest radius of a part."""
        return min(float(part.radii.min()) for part in self.parts)

    @property
    def box(self) -> tuple[Array, Array]:
        """Corners of an axis-parallel box around the surface, (3,) each."""
        low, high = [], []
        for part in self.parts:
            if isinstance(part, Limb):
                centres, reach = part.joints, part.radii[:, None]
            else:
                centres, reach = part.centre[None], np.linalg.norm(part.frame * part.radii, axis=1)[None]
            low.append((centres - reach).min(axis=0))
            high.append((centres + reach).max(axis=0))
        swell = max(part.blend for part in self.parts) / 4
        return np.min(low, axis=0) - swell, np.max(high, axis=0) + swell


class Field:
    """The signed distance of a figure, for many points at once."""

    def __init__(self, figure: Figure) -> None:
        limbs = [part for part in figure.parts if isinstance(part, Limb)]
        bodies = [part for part in figure.parts if isinstance(part, Ellipsoid)]
        self._blends = [part.blend for part in figure.parts]
        self._is_limb = [isinstance(part, Limb) for part in figure.parts]
        self._first_bone = np.cumsum([0, *(len(part.radii) - 1 for part in limbs)])[:-1]
        self._starts = np.concatenate([part.joints[:-1] for part in limbs])
        spans = np.concatenate([np.diff(part.joints, axis=0) for part in limbs])
        self._lengths = np.linalg.norm(spans, axis=1)
        self._directions = spans / self._lengths[:, None]
        self._radii = np.concatenate([part.radii[:-1] for part in limbs])
        growth = np.concatenate([np.diff(part.radii) for part in limbs]) / self._lengths
        self._growth = np.clip(growth, -0.95, 0.95)  # past 1 one ball swallows the other
        self._slant = self._growth / np.sqrt(1 - self._growth**2)
        self._bodies = [(part.centre, part.frame / part.radii, part.radii) for part in bodies]

    def parts(self, points: Array) -> Array:
        """Distance of each point (p, 3) to each part, (p, parts), without blending."""
        # The nearest ball of a rounded cone has its centre at s = u + q tan(slant) along the axis, where u, q
        # are the point's coordinates along and off the axis; clamped to the axis it is exact.
        offset = np.einsum("ij,ij->i", self._starts, self._directions)
        along = points @ self._directions.T - offset
        squared = (points**2).sum(axis=1)[:, None] + (self._starts**2).sum(axis=1)
        off_axis_squared = np.maximum(squared - 2 * (points @ self._starts.T) - along**2, 0)
        nearest = np.clip(along + np.sqrt(off_axis_squared) * self._slant, 0, self._lengths)
        bones = np.sqrt((along - nearest) ** 2 + off_axis_squared) - (self._radii + self._growth * nearest)
        limbs = np.minimum.reduceat(bones, self._first_bone, axis=1)
        distances = np.empty((len(points), len(self._is_limb)))
        limb = body = 0
        for column, is_limb in enumerate(self._is_limb):
            if is_limb:
                distances[:, column] = limbs[:, limb]
                limb += 1
                continue
            centre, scaling, radii = self._bodies[body]
            body += 1
            scaled = (points - centre) @ scaling
            level = np.linalg.norm(scaled, axis=1)
            slope = np.maximum(np.linalg.norm(scaled / radii, axis=1), 1e-9)
            # Exact to first order at the surface; deep inside it would pass the inscribed ball's radius.
            distances[:, column] = np.maximum(level * (level - 1) / slope, -radii.min())
        return distances

    def __call__(self, points: Array) -> Array:
        """Signed distance at points (p, 3), (p,), negative inside."""
        return np.concatenate(
            [self._blended(self.parts(points[at : at + _CHUNK])) for at in range(0, len(points), _CHUNK)]
            or [np.empty(0)]
        )  # fmt: skip

    def _blended(self, distances: Array) -> Array:
        """The parts' distances (p, parts) joined in order, (p,)."""
        field = distances[:, 0]
        for column, blend in enumerate(self._blends[1:], start=1):
            other = distances[:, column]
            joined = np.minimum(field, other)
            if blend > 0:
                joined -= np.maximum(blend - np.abs(field - other), 0) ** 2 / (4 * blend)
            field = joined
        return field


def is_clear(figure: Figure, gap: float) -> bool:
    """Whether no free stretch of a limb comes nearer than ``gap`` to another part or to itself."""
    field = Field(figure)
    for index, part in enumerate(figure.parts):
        if not isinstance(part, Limb) or part.free is None:
            continue
        lengths = np.linalg.norm(np.diff(part.joints, axis=0), axis=1)
        stations = np.concatenate([[0.0], np.cumsum(lengths)])
        at = np.linspace(0, stations[-1], _SAMPLES)
        points = np.stack([np.interp(at, stations, part.joints[:, axis]) for axis in range(3)], axis=1)
        radii = np.interp(at, stations, part.radii)
        tail = (at >= part.free[0] * stations[-1]) & (at <= part.free[1] * stations[-1])
        others = np.delete(field.parts(points[tail]), index, axis=1)
        if others.size and (others.min(axis=1) < radii[tail] + gap).any():
            return False
        need = radii[:, None] + radii[None] + gap
        between = np.linalg.norm(points[:, None] - points[None], axis=2)
        # A smooth bend brings points of a limb near each other only over an arc of half a turn or more.
        far_along = np.abs(at[:, None] - at[None]) > np.pi / 2 * need
        if (far_along & (between < need)).any():
            return False
    return True
