"""Pliers and spectacles: stiff parts on hinges."""

from __future__ import annotations

import numpy as np

from reebase.evaluation.synthetic.figures.posing import (
    Random,
    ball,
    between,
    chain,
    limb,
    mirror,
    turn,
    vector,
)
from reebase.evaluation.synthetic.implicit import Ellipsoid, Figure, Limb

__all__ = ["pliers", "spectacles"]


def pliers(random: Random) -> Figure:
    """Two levers that cross at a pivot: jaws in front, long curved handles behind, more or less open."""
    gape = between(random, 8, 26)  # half of the angle between the jaws
    jaw_length, handle = between(random, 0.38, 0.56), between(random, 0.95, 1.15)
    bow = between(random, 0.8, 1.25)
    parts: list[Limb | Ellipsoid] = [
        ball(vector(0, 0, 0), [0.2, 0.17, 0.1]),
        ball(vector(0, 0, 0), [0.075, 0.075, 0.135], blend=0.03),
    ]
    for side in (1, -1):
        frame = mirror(side, turn("z", gape))
        jaw = [0.16, 0.5 * jaw_length, 0.5 * jaw_length]
        turns = [mirror(side, turn("z", 14.0)), mirror(side, turn("z", -13.0)), mirror(side, turn("z", -5.0))]
        joints, _ = chain(vector(0, 0.02 * side, 0), frame, jaw, turns)
        parts.append(limb(joints, [0.11, 0.115, 0.09, 0.05], 0.04, (0.55, 1)))
        frame = mirror(side, turn("z", 180 - gape))
        bones = [0.16, 0.24 * handle, 0.24 * handle, 0.26 * handle, 0.26 * handle, 0.2 * handle]
        angles = [-14.0, -6 * bow, 14 * bow, 12 * bow, 7 * bow, -8 * bow]
        turns = [mirror(side, turn("z", angle)) for angle in angles]
        joints, _ = chain(vector(0, -0.02 * side, 0), frame, bones, turns)
        parts.append(limb(joints, [0.1, 0.085, 0.068, 0.078, 0.082, 0.078, 0.07], 0.04, (0.4, 1)))
    return Figure(tuple(parts))


def spectacles(random: Random) -> Figure:
    """Two rims, a bridge, and temples with ear hooks, each folded by its own angle."""
    wide, tall = between(random, 0.3, 0.36), between(random, 0.23, 0.3)
    squareness = between(random, 2.0, 3.0)
    wire = 0.034
    angles = np.linspace(0, 2 * np.pi, 29)
    cosine, sine = np.cos(angles), np.sin(angles)
    rim = np.stack([
        np.zeros_like(angles),
        wide * np.sign(cosine) * np.abs(cosine) ** (2 / squareness),
        tall * np.sign(sine) * np.abs(sine) ** (2 / squareness),
    ], axis=1)  # fmt: skip
    rim[-1] = rim[0]
    gap = between(random, 0.1, 0.13)
    bow = turn("z", between(random, 3, 9))
    parts: list[Limb | Ellipsoid] = []
    for side in (1, -1):
        tilt = mirror(side, bow)
        centre = vector(0, side * (gap + wide), 0)
        parts.append(limb(rim @ tilt.T + centre, np.full(len(rim), wire)))
        hinge = centre + tilt @ vector(-0.01, side * (wide + 0.01), 0.3 * tall)
        fold = between(random, -4, 12) if random.random() < 0.5 else between(random, 12, 70)
        frame = mirror(side, turn("z", 180 + fold)) @ turn("y", between(random, -3, 3))
        joints, _ = chain(
            hinge + vector(0, 0.02 * side, 0), frame, [0.1, 0.45, 0.3, 0.12, 0.1, 0.1],
            [np.eye(3), np.eye(3), turn("y", 4), turn("y", 22), turn("y", 22), turn("y", 10)],
        )  # fmt: skip
        parts.append(limb([hinge, *joints], [wire + 0.006, wire + 0.004, *[wire] * 6], 0.02, (0.25, 1)))
    arch = [vector(0.0, y, 0.1 * tall + 0.05 * (1 - (y / gap) ** 2)) for y in np.linspace(-gap, gap, 7)]
    parts.append(limb(arch, np.full(len(arch), wire), 0.02))
    return Figure(tuple(parts), genus=2)
