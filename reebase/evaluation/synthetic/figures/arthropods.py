"""Ants, crabs and spiders: hard bodies on jointed legs."""

from __future__ import annotations

import numpy as np

from reebase.evaluation.synthetic.figures.posing import (
    Array,
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

__all__ = ["ant", "crab", "spider"]

# Where each leg of a side leaves the body, the azimuth that it leaves at, and its length against the others.
_ANT_LEGS = ((0.14, 52, 0.95), (0.0, 92, 0.95), (-0.16, 130, 1.15))
_CRAB_LEGS = ((0.08, 80, 1.0), (-0.04, 101, 1.05), (-0.155, 122, 1.0), (-0.26, 146, 0.85))
_SPIDER_LEGS = ((0.16, 34, 1.1), (0.06, 68, 0.95), (-0.05, 104, 0.92), (-0.15, 140, 1.12))


def _leg(
    random: Random, root: Array, azimuth: float, side: int, lengths: list[float], droops: list[float],
    radii: list[float], blend: float,
) -> Limb:  # fmt: skip
    """A leg that leaves the body at an azimuth (0 forward, 90 sideways), its joints bent in its own plane."""
    frame = mirror(side, turn("z", azimuth + between(random, -9, 9)))
    turns = [turn("y", droop + between(random, -9, 9)) for droop in droops]
    joints, _ = chain(root, frame, lengths, turns)
    return limb(joints, radii, blend, (0.36, 1))


def ant(random: Random) -> Figure:
    """Head, thorax and gaster, elbowed antennae, mandibles, six legs on the thorax."""
    fat, leggy = between(random, 0.9, 1.12), between(random, 0.92, 1.1)
    parts: list[Limb | Ellipsoid] = [
        ball(vector(0.08, 0, 0), [0.22, 0.16, 0.16]),
        ball(vector(-0.18, 0, 0.02), [0.2, 0.12, 0.12], blend=0.1),
    ]
    look = turn("z", between(random, -28, 28)) @ turn("y", between(random, -5, 35))
    neck = vector(0.27, 0, 0.04)
    head = neck + 0.19 * look[:, 0]
    parts += [
        limb([vector(0.2, 0, 0.02), head], [0.07, 0.07], 0.05),
        ball(head, [0.2, 0.19 * fat, 0.14], look, 0.04),
    ]
    wag = turn("z", between(random, -30, 30)) @ turn("y", between(random, -35, 25))
    waist = vector(-0.36, 0, 0.02)
    node = waist - 0.1 * wag[:, 0]
    gaster = node - 0.42 * wag[:, 0]
    parts += [
        limb([vector(-0.3, 0, 0.02), waist, node, gaster], [0.06, 0.055, 0.075, 0.08], 0.04),
        ball(gaster, [0.38, 0.26 * fat, 0.25 * fat], wag, 0.05),
    ]
    for side in (1, -1):
        root = head + look @ vector(0.1, 0.09 * side, 0.05)
        scape = mirror(side, turn("z", between(random, 30, 62)) @ turn("y", between(random, -45, -15)))
        elbow = mirror(side, turn("z", between(random, -75, -25)) @ turn("y", between(random, 25, 70)))
        joints, _ = chain(root, look @ scape, [0.26, 0.2, 0.16], [np.eye(3), elbow, turn("y", 8)])
        parts.append(limb(joints, [0.04, 0.038, 0.039, 0.042], 0.03, (0.5, 1)))
        jaw = mirror(side, turn("z", 24))
        joints, _ = chain(
            head + look @ vector(0.14, 0.075 * side, -0.03), look @ jaw, [0.11, 0.1],
            [np.eye(3), mirror(side, turn("z", -38))],
        )  # fmt: skip
        parts.append(limb(joints, [0.05, 0.043, 0.04], 0.02))
        swing = between(random, -12, 12)
        for station, azimuth, reach in _ANT_LEGS:
            scale = leggy * reach
            parts.append(_leg(
                random, vector(station, 0.09 * side, -0.05),
                azimuth + swing * between(random, 0.3, 1.0), side,
                [0.12, 0.4 * scale, 0.44 * scale, 0.2 * scale], [5, -40, 92, -35],
                [0.062, 0.055, 0.048, 0.042, 0.04], 0.04,
            ))  # fmt: skip
            swing = -swing
    return Figure(tuple(parts))


def spider(random: Random) -> Figure:
    """Cephalothorax, a large abdomen, palps, eight arched legs that spread around."""
    fat, leggy = between(random, 0.9, 1.15), between(random, 0.9, 1.1)
    wag = turn("z", between(random, -18, 18)) @ turn("y", between(random, -25, 15))
    stalk = vector(-0.24, 0, 0.02)
    abdomen = stalk - 0.4 * wag[:, 0]
    parts: list[Limb | Ellipsoid] = [
        ball(vector(0, 0, 0), [0.29, 0.23, 0.15]),
        ball(vector(0.22, 0, 0.03), [0.14, 0.13, 0.12], blend=0.1),
        limb([vector(-0.15, 0, 0.01), stalk, abdomen], [0.08, 0.07, 0.1], 0.05),
        ball(abdomen, [0.4, 0.3 * fat, 0.28 * fat], wag, 0.06),
        limb([abdomen - 0.36 * wag[:, 0], abdomen - 0.46 * wag[:, 0]], [0.06, 0.045], 0.05),
    ]
    for side in (1, -1):
        palp = mirror(side, turn("z", between(random, 14, 26)) @ turn("y", between(random, -20, 5)))
        joints, _ = chain(
            vector(0.26, 0.09 * side, -0.02), palp, [0.14, 0.12],
            [np.eye(3), turn("y", between(random, 35, 75))],
        )  # fmt: skip
        parts.append(limb(joints, [0.05, 0.045, 0.042], 0.03, (0.75, 1)))
        swing = between(random, -8, 8)
        for station, azimuth, reach in _SPIDER_LEGS:
            scale = leggy * reach
            lift = between(random, -8, 8)
            parts.append(_leg(
                random, vector(station, 0.16 * side, 0), azimuth + swing, side,
                [0.16, 0.46 * scale, 0.34 * scale, 0.36 * scale], [-12 + lift, -38, 78, 28],
                [0.066, 0.06, 0.053, 0.046, 0.041], 0.04,
            ))  # fmt: skip
            swing = -swing
    return Figure(tuple(parts))


def _claw(random: Random, side: int, wide: float) -> list[Limb | Ellipsoid]:
    """An arm that reaches out and folds forward, and its pincer, more or less open."""
    shoulder = mirror(side, turn("z", between(random, 30, 55)) @ turn("y", between(random, -25, 3)))
    fold = mirror(side, turn("z", between(random, -80, -25)) @ turn("y", between(random, -25, 25)))
    wrist = mirror(side, turn("z", between(random, -45, 15)))
    joints, frame = chain(
        vector(0.22, 0.32 * side * wide, -0.01), shoulder, [0.3, 0.2, 0.1], [np.eye(3), fold, wrist]
    )  # fmt: skip
    palm = joints[-1] + 0.12 * frame[:, 0]
    size = between(random, 0.9, 1.2)
    gape = between(random, 14, 32)
    parts: list[Limb | Ellipsoid] = [
        limb(joints, [0.085, 0.08, 0.075, 0.07], 0.05, (0.45, 0.55)),
        ball(palm, [0.18 * size, 0.12 * size, 0.1 * size], frame, 0.05),
    ]
    for which in (1, -1):
        root = palm + frame @ vector(0.1 * size, 0.055 * size * which, 0)
        open_by, bent = turn("z", gape * which), turn("z", -1.15 * gape * which)
        bones, _ = chain(root, frame, [0.17 * size, 0.13 * size], [open_by, bent])
        parts.append(limb(bones, [0.065 * size, 0.052 * size, 0.042], 0.02, (0.6, 1)))
    return parts


def crab(random: Random) -> Figure:
    """A flat shell wider than long, stalked eyes, two arms with pincers, eight walking legs."""
    wide = between(random, 0.95, 1.1)
    parts: list[Limb | Ellipsoid] = [
        ball(vector(0.02, 0, 0), [0.34, 0.52 * wide, 0.17]),
        ball(vector(-0.14, 0, -0.03), [0.28, 0.36 * wide, 0.15], blend=0.1),
    ]
    for side in (1, -1):
        stalk = mirror(side, turn("z", between(random, 0, 40)) @ turn("y", between(random, -75, -40)))
        joints, _ = chain(vector(0.28, 0.13 * side, 0.07), stalk, [0.14], [np.eye(3)])
        parts.append(limb(joints, [0.04, 0.048], 0.03))
        parts += _claw(random, side, wide)
        swing = between(random, -7, 7)
        for station, azimuth, reach in _CRAB_LEGS:
            root = vector(station, side * (0.4 * wide + 0.3 * min(station, 0.0)), -0.06)
            lift = between(random, -10, 10)
            parts.append(_leg(
                random, root, azimuth + swing, side,
                [0.14, 0.36 * reach, 0.26 * reach, 0.26 * reach], [-8 + lift, -22, 62, 28],
                [0.06, 0.058, 0.053, 0.049, 0.043], 0.04,
            ))  # fmt: skip
            swing = -swing
    return Figure(tuple(parts))
