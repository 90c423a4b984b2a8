"""Octopuses and snakes: bodies that bend everywhere."""

from __future__ import annotations

import numpy as np

from reebase.evaluation.synthetic.figures.posing import (
    Random,
    ball,
    between,
    chain,
    limb,
    turn,
    vector,
)
from reebase.evaluation.synthetic.implicit import Ellipsoid, Figure, Limb

__all__ = ["octopus", "snake"]


def octopus(random: Random) -> Figure:
    """A bulging mantle that leans back, eyes, eight tapering arms that curl."""
    fat = between(random, 0.9, 1.12)
    lean = turn("y", between(random, -55, -8)) @ turn("x", between(random, -18, 18))
    mantle = vector(0, 0, 0.12) + lean @ vector(0, 0, 0.46)
    parts: list[Limb | Ellipsoid] = [
        ball(vector(0, 0, 0.1), [0.25, 0.25, 0.22]),
        limb([vector(0, 0, 0.1), mantle], [0.22, 0.24], 0.1),
        ball(mantle, [0.32 * fat, 0.32 * fat, 0.4], lean, 0.12),
    ]
    for side in (1, -1):
        eye = vector(0, 0, 0.12) + lean @ vector(0.17, 0.15 * side, 0.16)
        parts.append(ball(eye, [0.085, 0.085, 0.085], blend=0.03))
    bones = 11
    radii = np.linspace(0.095, 0.042, bones + 1)
    long = between(random, 0.92, 1.1)
    for number in range(8):
        azimuth = 22.5 + 45 * number + between(random, -7, 7)
        start = turn("z", azimuth) @ turn("y", between(random, 5, 38))
        root = turn("z", azimuth) @ vector(0.16, 0, 0.0)
        lift, curl, phase = between(random, -12, 3), between(random, -16, 16), between(random, 0, 2 * np.pi)
        turns = [
            turn("z", curl * np.sin(phase + 0.45 * bone) * (0.5 + bone / bones))
            @ turn("y", lift * np.cos(0.3 * bone))
            for bone in range(bones)
        ]
        joints, _ = chain(root, start, [0.115 * long] * bones, turns)
        parts.append(limb(joints, radii, 0.06, (0.28, 1)))
    return Figure(tuple(parts))


def snake(random: Random) -> Figure:
    """A long body in waves, a flat head on a thinner neck, a pointed tail; sometimes the head is raised."""
    bones = 46
    long = between(random, 0.92, 1.1)
    at = np.linspace(0, 1, bones)
    waves, amplitude = between(random, 0.7, 2.7), between(random, 13, 21)
    phase, drift = between(random, 0, 2 * np.pi), between(random, -6, 6)
    swing = amplitude * np.sin(phase + 2 * np.pi * waves * at) + drift
    swing[:11] *= 0.15
    rear = between(random, 0, 1)
    raise_by = 62 * rear if rear > 0.45 else 0.0
    turns = [turn("z", degrees) for degrees in swing]
    for bone in range(7, 11):
        turns[bone] = turn("y", -raise_by / 4) @ turns[bone]
    # The chain runs from the head backwards: a raised neck goes down from it, then lies flat.
    joints, _ = chain(vector(0, 0, 0), turn("y", raise_by), [0.1 * long] * bones, turns)
    head = turn("z", 180 + between(random, -20, 20)) @ turn("y", between(random, -8, 14))
    along = np.linspace(0, 1, bones + 1)
    girth = np.interp(along, [0, 0.07, 0.3, 0.62, 1], [0.088, 0.09, 0.135, 0.125, 0.04])
    nose = head[:, 0]
    parts: list[Limb | Ellipsoid] = [
        limb(joints, girth * between(random, 0.93, 1.07), 0.0, (0.08, 1)),
        ball(0.1 * nose, [0.2, 0.135, 0.1], head, 0.08),
        ball(0.24 * nose - 0.01 * head[:, 2], [0.12, 0.085, 0.065], head, 0.06),
    ]
    eyes = [
        ball(0.14 * nose + head @ vector(0, 0.075 * side, 0.07), [0.045, 0.04, 0.04], head, 0.02)
        for side in (1, -1)
    ]  # fmt: skip
    return Figure((*parts, *eyes))
