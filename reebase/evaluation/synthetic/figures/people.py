"""Hands, humans and teddy-bears."""

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

__all__ = ["hand", "human", "teddy_bear"]


def hand(random: Random) -> Figure:
    """A left hand, fingers along +x and palm down: wrist, metacarpals, a thumb, fingers that bend."""
    slim, long = between(random, 0.93, 1.06), between(random, 0.93, 1.08)
    wrist = turn("y", between(random, -25, 25)) @ turn("z", between(random, -15, 15))
    forearm = -wrist[:, 0]
    parts: list[Limb | Ellipsoid] = [
        limb([0.5 * forearm, 0.05 * forearm, vector(0.1, 0, 0)], [0.165, 0.15, 0.16], 0.05),
        limb([vector(-0.02, 0.1, 0), vector(0.2, 0.12, -0.01)], [0.12, 0.12], 0.08),
    ]
    fingers = (
        # knuckle x, y; splay; lengths of the phalanges; radius
        (0.62, 0.255, 8, (0.31, 0.2, 0.15), 0.077),
        (0.66, 0.085, 2, (0.34, 0.23, 0.16), 0.079),
        (0.63, -0.085, -4, (0.31, 0.21, 0.16), 0.076),
        (0.55, -0.245, -12, (0.25, 0.16, 0.14), 0.068),
    )
    for x, y, *_, radius in fingers:
        base = vector(0.06, 0.55 * y, 0)
        parts.append(limb([base, vector(x, y, 0)], [0.13, radius * 1.14], 0.05))
    fist = between(random, 0, 1)
    spread = between(random, 0.75, 1.7)
    for x, y, splay, lengths, radius in fingers:
        bend = between(random, 0.0, 0.45) + 0.8 * fist * between(random, 0, 1)
        turns = [
            turn("z", splay * spread + between(random, -2, 2)) @ turn("y", 62 * bend - 6),
            turn("y", 78 * bend + 4),
            turn("y", 48 * bend + 3),
        ]
        joints, _ = chain(vector(x, y, 0), np.eye(3), [long * length for length in lengths], turns)
        widths = slim * radius * np.array([1.05, 0.97, 0.87, 0.74])
        parts.append(limb(joints, widths, 0.03, (0.45, 1)))
    spread_thumb, under = between(random, 34, 62), between(random, -5, 35)
    frame = turn("z", spread_thumb) @ turn("y", under)
    turns = [
        np.eye(3),
        turn("z", -between(random, 5, 32)) @ turn("y", between(random, -4, 8)),
        turn("z", -between(random, 0, 40)),
    ]
    joints, _ = chain(vector(0.06, 0.1, -0.03), frame, [0.34 * long, 0.24 * long, 0.19 * long], turns)
    parts.append(limb(joints, slim * np.array([0.14, 0.105, 0.09, 0.075]), 0.09, (0.6, 1)))
    return Figure(tuple(parts))


def _arm(random: Random, chest: Array, shoulder: Array, side: int, size: float) -> list[Limb | Ellipsoid]:
    """Upper arm, forearm and a mitten with a thumb, from hanging to raised."""
    raised = between(random, -72, 55)  # degrees above the horizontal
    forward = between(random, -20, 75)
    elbow = between(random, 5, 95) * (1 if random.random() < 0.75 else 0.2)
    frame = chest @ mirror(
        side, turn("z", 90 - forward) @ turn("y", -raised) @ turn("x", between(random, -60, 60))
    )  # fmt: skip
    turns = [np.eye(3), mirror(side, turn("z", -elbow)), turn("y", between(random, -15, 15))]
    joints, tip = chain(shoulder, frame, [0.3 * size, 0.26 * size, 0.1 * size], turns)
    thumb = joints[-2] + tip @ vector(0.04, 0, 0.0)
    return [
        limb(joints[:3], [0.072, 0.058, 0.04], 0.05, (0.32, 0.8)),
        ball(joints[2] + 0.075 * tip[:, 0], [0.1, 0.04, 0.058], tip, 0.02),
        limb([thumb, thumb + tip @ vector(0.05, -0.02 * side, 0.075)], [0.033, 0.031], 0.02),
    ]


def _legs(random: Random, hips: Array, size: float) -> list[Limb | Ellipsoid]:
    """Thighs, shins and feet, from standing to striding and kicking."""
    parts: list[Limb | Ellipsoid] = []
    stride = between(random, -45, 45)
    sit = between(random, 40, 85) if random.random() < 0.2 else 0.0
    for side in (1, -1):
        swing = stride * side * between(random, 0.5, 1.0) + sit + between(random, 0, 12)
        apart = between(random, 4, 24)
        knee = max(between(random, 4, 30) + sit, 0.5 * swing, -0.9 * swing)
        frame = hips @ mirror(side, turn("x", apart)) @ turn("y", 90 - swing)
        turns = [np.eye(3), turn("y", min(knee, 110)), turn("y", -82 + between(random, -12, 25))]
        joints, _ = chain(hips @ vector(0, 0.1 * side, -0.03), frame, [0.42 * size, 0.42 * size, 0.17], turns)
        heel = joints[2] - 0.05 * (joints[3] - joints[2]) / 0.17
        parts += [
            limb(joints[:3], [0.1, 0.07, 0.046], 0.05, (0.35, 0.8)),
            limb([heel, joints[3]], [0.052, 0.042], 0.02),
        ]
    return parts


def human(random: Random) -> Figure:
    """A person: a trunk that leans and twists, head, arms and legs in an everyday or athletic pose."""
    size, build = between(random, 0.93, 1.08), between(random, 0.9, 1.15)
    hips = turn("y", between(random, -5, 12))
    twist, sway = turn("z", between(random, -28, 28)), turn("x", between(random, -14, 14))
    chest = hips @ twist @ sway @ turn("y", between(random, -12, 30))
    waist = vector(0, 0, 0.14)
    ribs = waist + chest @ vector(0.01, 0, 0.2)
    collar = ribs + chest @ vector(0, 0, 0.19)
    look = chest @ turn("z", between(random, -40, 40)) @ turn("y", between(random, -15, 25))
    skull = collar + 0.1 * chest[:, 2] + look @ vector(0.03, 0, 0.13)
    parts: list[Limb | Ellipsoid] = [
        ball(vector(0, 0, 0.02), [0.12 * build, 0.165 * build, 0.13], hips),
        limb([vector(0, 0, 0.05), waist, ribs], [0.11 * build, 0.105 * build, 0.12], 0.1),
        ball(ribs, [0.125 * build, 0.175 * build, 0.2], chest, 0.1),
        limb([ribs + chest @ vector(0, y, 0.12) for y in (0.12, -0.12)], [0.075, 0.075], 0.06),
        limb([collar - 0.05 * chest[:, 2], skull], [0.065, 0.06], 0.04),
        ball(skull, [0.115, 0.092, 0.135], look, 0.03),
        ball(skull + look @ vector(0.108, 0, -0.02), [0.045, 0.03, 0.03], look, 0.02),
    ]
    for side in (1, -1):
        parts += _arm(random, chest, ribs + chest @ vector(0, 0.2 * side * build, 0.12), side, size)
    return Figure((*parts, *_legs(random, hips, size)))


def teddy_bear(random: Random) -> Figure:
    """A round belly and head, a muzzle, ears, a tail, short thick arms and legs; sitting or standing."""
    plump = between(random, 0.92, 1.1)
    gaze, tip = turn("z", between(random, -35, 35)), turn("x", between(random, -14, 14))
    look = gaze @ tip @ turn("y", between(random, -10, 16))
    neck = vector(0, 0, 0.4)
    skull = neck + look @ vector(0.02, 0, 0.24)
    parts: list[Limb | Ellipsoid] = [
        ball(vector(0, 0, 0), [0.36 * plump, 0.39 * plump, 0.44]),
        ball(skull, [0.3, 0.33, 0.29], look, 0.1),
        ball(skull + look @ vector(0.26, 0, -0.07), [0.15, 0.15, 0.12], look, 0.06),
        ball(skull + look @ vector(0.4, 0, -0.02), [0.05, 0.06, 0.045], look, 0.02),
        ball(vector(-0.36 * plump, 0, -0.2), [0.09, 0.09, 0.09], blend=0.06),
    ]
    sitting = random.random() < 0.55
    for side in (1, -1):
        ear = skull + look @ vector(-0.02, 0.25 * side, 0.25)
        parts.append(ball(ear, [0.065, 0.125, 0.125], look, 0.04))
        raised, forward = between(random, -50, 50), between(random, -10, 60)
        frame = mirror(side, turn("z", 90 - forward) @ turn("y", -raised))
        bend = mirror(side, turn("z", -between(random, 0, 50)))
        joints, _ = chain(vector(0, 0.3 * side * plump, 0.2), frame, [0.3, 0.26], [np.eye(3), bend])
        parts.append(limb(joints, [0.14, 0.135, 0.125], 0.08, (0.75, 1)))
        if sitting:
            frame = mirror(side, turn("z", between(random, 12, 40)) @ turn("y", between(random, -8, 22)))
        else:
            frame = mirror(side, turn("x", between(random, 5, 18))) @ turn("y", 90 + between(random, -32, 32))
        joints, last = chain(vector(0.04, 0.2 * side, -0.27), frame, [0.28, 0.2], [np.eye(3), turn("y", 6)])
        toe = joints[-1] + 0.13 * (last @ turn("y", -80))[:, 0]
        parts.append(limb([*joints, toe], [0.17, 0.155, 0.14, 0.115], 0.07, (0.75, 1)))
    return Figure(tuple(parts))
