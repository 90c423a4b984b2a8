"""Filters, strength and iterations chosen from the mesh itself, by the error of normals that each would leave.

Idea: which filter serves best depends on the noise and on the surface, and both can be asked of the noisy mesh. Each
candidate is tried, and Stein's unbiased estimate says how far its result is from the truth without the truth. Those
that come near the best are averaged: their errors are not all the same, so that the mean has less. Use it when nothing
is known of a mesh. Source of the estimate: C. M. Stein, Estimation of the Mean of a Multivariate Normal
Distribution, Annals of Statistics 9 (1981); its divergence by S. Ramani, T. Blu and M. Unser, Monte-Carlo SURE, IEEE
TIP 17 (2008).

Let noise of standard deviation sigma move vertices along the normals n of a first smoothing, let h_i = n_i . d_i of a
filter's displacement d, and let L take differences along edges, which turn normals. Then, up to a constant that all
candidates share, the expected square of L(result - truth) is that of

    S = |L h|^2 + 2 sigma^2 (L z) . L (h(v + eps z n) - h(v)) / eps

with z of zero mean and unit variance: the sine of each vertex's sum of edge lengths, at a frequency so high that it is
as good as random while neither order nor rotation matters, and then the cosine; S is the mean of the two. Edges weigh
by 1 / length, those that touch a boundary do not count. The rule:

1. sigma below ``CLEAN``: the mesh comes out exactly as it was. sigma is the robust level of ``noise_levels``.
2. sigma from ``STRONG``: the guided filter, ``LONGEST`` times; the estimate is of first order and fails there.
3. Otherwise the ``MOST`` filters with the least S weigh exp((S_best - S) / (``NARROW`` |S_best|)), with sigma the other
   level, which is larger where the noise comes in impulses; those below ``SMALL`` are left out. If no S is below 0,
   which is that of doing nothing, nothing is done. Where the levels differ by more than ``IMPULSES`` times, filters
   that could take an impulse for a feature are left out.

The mean of the displacements, by these weights, then keeps 1 - ``SLIDE`` of its part within the surface: noise is
mostly along the normals, and what slides is mostly error.

On a clean mesh sigma measures what of its relief is as fine as its edges. Below ``CLEAN`` the error is 0; beyond, where
such relief cannot be told from noise, vertices move by less than sigma on average.

Large meshes are judged by ``PATCHES`` patches with ``SAMPLE`` vertices in all.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.denoise.bilateral_normal import BILATERAL_NORMAL
from reebase.denoise.filter import Filter, FloatArray, Step, Surface
from reebase.denoise.fitting import noise_levels
from reebase.denoise.guided_normal import GUIDED_NORMAL
from reebase.denoise.taubin import TAUBIN
from reebase.mesh.geometry import lengths, normalised
from reebase.mesh.topology import rings

__all__ = ["AUTO", "Choice", "Part", "applied", "chosen"]

CLEAN = 0.04
STRONG = 0.4
LONGEST = 16
SAMPLE = 6000
PATCHES = 6
IMPULSES = 1.2
NARROW = 0.015
MOST = 3
SMALL = 0.1
SLIDE = 0.25
PROBE = 0.1
"""eps over sigma."""
FREQUENCY = 1000.0
"""Of the waves that make z, per mean edge length."""
SHORTEST = 0.1
"""Edges shorter than this, in mean edge lengths, weigh no more than it."""


@dataclass(frozen=True)
class Candidate:
    """A filter with parameters, the numbers of iterations to judge it at, and the surface that it suits.

    stubborn: whether it keeps single vertices that stand out.
    """

    filter: Filter
    parameters: Mapping[str, Any]
    iterations: tuple[int, ...]
    surface: str
    stubborn: bool = False


GUIDED = Candidate(GUIDED_NORMAL, {"sigma_s": 0.5, "reach": 2.0, "normal_iterations": 1}, (4, 8), "sharp")
CANDIDATES = (
    GUIDED,
    Candidate(
        BILATERAL_NORMAL, {"sigma_s": 0.3, "normal_iterations": 12, "vertex_iterations": 15}, (1,), "sharp", True
    ),
    Candidate(
        BILATERAL_NORMAL, {"sigma_s": 0.5, "normal_iterations": 3, "vertex_iterations": 15}, (1,), "smooth"
    ),
    Candidate(
        BILATERAL_NORMAL, {"sigma_s": 0.5, "normal_iterations": 8, "vertex_iterations": 15}, (1,), "sharp"
    ),
    Candidate(
        BILATERAL_NORMAL, {"sigma_s": 0.8, "normal_iterations": 4, "vertex_iterations": 15}, (1,), "smooth"
    ),
    Candidate(TAUBIN, {"along": "normals"}, (4, 10, 20), "scan"),
)  # fmt: skip

KINDS = {
    "sharp": "a surface with sharp edges between even parts",
    "smooth": "a smooth surface",
    "scan": "a scan, finely rough or even all over",
}


@dataclass(frozen=True)
class Part:
    """A filter by its arguments of ``denoise``, and its share of the mean."""

    share: float
    method: str
    iterations: int
    parameters: Mapping[str, Any]


@dataclass(frozen=True)
class Choice:
    """What ``auto`` picked for a mesh, and why.

    parts: the largest share first; none where the mesh is better left alone. noise: the standard deviation of the noise
    along normals, in mean edge lengths. surface: that which the first part suits, "sharp", "smooth" or "scan", or
    "clean" when nothing is to be done.
    """

    parts: tuple[Part, ...]
    noise: float
    surface: str
    reason: str


def chosen(surface: Surface) -> Choice:
    """The choice for a surface."""
    robust, square = noise_levels(surface)
    if not robust >= CLEAN:
        said = f"The noise is {robust:.3f} of a mean edge, below {CLEAN}: the mesh counts as clean and stays."
        return Choice((), robust, "clean", said)
    if robust >= STRONG:
        parts = (Part(1.0, GUIDED.filter.name, LONGEST, dict(GUIDED.parameters)),)
        said = f"The noise is {robust:.3f} of a mean edge, which is strong, from {STRONG}."
        return Choice(parts, robust, GUIDED.surface, said)
    part = _sample(surface)
    tried = [entry for entry in CANDIDATES if not (entry.stubborn and square > IMPULSES * robust)]
    risks = _risks(part, square, tried, surface.report.within)
    least = min(risks.values())
    if not least < 0:
        said = f"The noise is {robust:.3f} of a mean edge, and every filter would take more of the surface than of it."
        return Choice((), robust, "clean", said)
    weights = {one: math.exp((least - risk) / (NARROW * -least)) for one, risk in risks.items()}
    ranked = sorted(weights.items(), key=lambda entry: -entry[1])[:MOST]
    kept = {one: weight for one, weight in ranked if weight >= SMALL}
    mixed = tuple(
        Part(weight / sum(kept.values()), tried[place].filter.name, count, dict(tried[place].parameters))
        for (place, count), weight in kept.items()
    )
    best = tried[ranked[0][0][0]].surface
    gains: dict[str, float] = {}
    for (place, _), risk in risks.items():
        kind = tried[place].surface
        gains[kind] = max(gains.get(kind, 0.0), risk / least)
    beside = ", ".join(f"{kind} {gain:.0%}" for kind, gain in gains.items())
    said = (
        f"The noise is {robust:.3f} of a mean edge, and by Stein's estimate on {len(part.positions)} vertices "
        f"{'this comes' if len(mixed) == 1 else f'these {len(mixed)} come'} nearest to the true normals of "
        f"{len(risks)} candidates, as on {KINDS[best]} (gain by kind: {beside})."
    )
    return Choice(mixed, robust, best, said)


def _risks(
    part: Surface, sigma: float, tried: Sequence[Candidate], tell: Callable[[float], None]
) -> dict[tuple[int, int], float]:
    """S, in squared mean edge lengths, of each candidate's place and number of iterations. tell: the share done."""
    from reebase.denoise.ring_kernels import vertex_normals

    starts, ends, inner = _edges(part)
    first = BILATERAL_NORMAL.checked({"sigma_s": 0.7, "normal_iterations": 2})
    smooth = part.positions + BILATERAL_NORMAL.prepare(part, first)(part.positions)
    normals = normalised(vertex_normals(smooth, part.faces, True))
    weights = inner / np.maximum(lengths(smooth[starts] - smooth[ends]), SHORTEST)
    weights /= weights.sum()
    small = PROBE * sigma
    probes = _probes(part)
    moved = [replace(part, positions=part.positions + small * probe[:, None] * normals) for probe in probes]

    found = {}
    for place, candidate in enumerate(tried):
        plain = _heights(part, candidate, normals)
        answers = [_heights(other, candidate, normals) for other in moved]
        for which, count in enumerate(candidate.iterations):
            heights = plain[which]
            divergence = 0.0
            for probe, answer in zip(probes, answers, strict=True):
                response = (answer[which] - heights) / (small * len(probes))
                divergence += float((weights * (probe[starts] - probe[ends])) @ (response[starts] - response[ends]))
            squared = float(weights @ (heights[starts] - heights[ends]) ** 2)
            found[place, count] = squared + 2 * sigma**2 * divergence
        tell((place + 1) / len(tried))
    return found


def _heights(part: Surface, candidate: Candidate, normals: FloatArray) -> list[FloatArray]:
    """The displacement along the normals, (m,), after each number of iterations."""
    step = candidate.filter.prepare(part, candidate.filter.checked(candidate.parameters))
    positions = part.positions
    found = []
    for count in range(1, candidate.iterations[-1] + 1):
        positions = positions + step(positions)
        if count in candidate.iterations:
            found.append(((positions - part.positions) * normals).sum(axis=1))
    return found


def _edges(part: Surface) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32], FloatArray]:
    """Each edge's ends, and 1 where neither lies on the boundary, else 0; all 1 where none is inside."""
    around = part.rings
    first, second = np.repeat(np.arange(len(around.degrees)), around.degrees), around.neighbours
    once = first < second
    first, second = first[once], second[once]
    inside = np.ones(len(around.degrees), dtype=bool)
    inside[around.boundary_curve[0]] = False
    inner = (inside[first] & inside[second]).astype(np.float64)
    return first, second, inner if inner.any() else np.ones_like(inner)


def _probes(part: Surface) -> tuple[FloatArray, FloatArray]:
    """Two z of each vertex, (m,)."""
    around = part.rings
    first = np.repeat(np.arange(len(around.degrees)), around.degrees)
    spans = lengths(part.positions[first] - part.positions[around.neighbours])
    phases = FREQUENCY * np.bincount(first, spans, len(around.degrees))
    return np.sqrt(2) * np.sin(phases), np.sqrt(2) * np.cos(phases)


def _sample(surface: Surface) -> Surface:
    """The surface, or patches of it when it is large: the vertices nearest to some that the probe picks."""
    count = len(surface.positions)
    if count <= SAMPLE:
        return replace(surface, hold=_anything)
    probe = np.where(surface.rings.degrees > 0, _probes(surface)[0], np.inf)
    kept = np.zeros(count, dtype=bool)
    for seed in np.argsort(np.abs(probe), kind="stable")[:PATCHES]:
        squares = ((surface.positions - surface.positions[seed]) ** 2).sum(axis=1)
        kept[np.argpartition(squares, SAMPLE // PATCHES)[: SAMPLE // PATCHES]] = True
    faces = surface.faces[kept[surface.faces].all(axis=1)]
    used = np.zeros(count, dtype=bool)
    used[faces] = True
    places = (np.cumsum(used) - 1).astype(np.int32)
    return Surface(surface.positions[used], places[faces], rings(places[faces], int(used.sum())), surface.unit)


def _anything(_: FloatArray, displacements: FloatArray) -> FloatArray:
    return displacements


def applied(surface: Surface, choice: Choice) -> FloatArray:
    """The displacement of each vertex, (m, 3), that a choice makes of the surface's positions."""
    from reebase.denoise.ring_kernels import vertex_normals

    filters = {candidate.filter.name: candidate.filter for candidate in CANDIDATES}
    total = np.zeros_like(surface.positions)
    families: dict[tuple[Any, ...], list[Part]] = {}
    done = 0
    for part in choice.parts:
        families.setdefault((part.method, *sorted(part.parameters.items())), []).append(part)
    rounds = sum(max(part.iterations for part in parts) for parts in families.values())
    for parts in families.values():
        entry = filters[parts[0].method]
        step = entry.prepare(surface, entry.checked(parts[0].parameters))
        positions = surface.positions
        for count in range(1, max(part.iterations for part in parts) + 1):
            positions = positions + surface.hold(positions, step(positions))
            for part in parts:
                if part.iterations == count:
                    total += part.share * (positions - surface.positions)
            done += 1
            surface.report.within(done / rounds)
    normals = normalised(vertex_normals(surface.positions + total, surface.faces, True))
    across = (total * normals).sum(axis=1)[:, None] * normals
    return np.asarray(total + SLIDE * (across - total))


def prepare(surface: Surface, _: Mapping[str, Any]) -> Step:
    """A choice, and all of its iterations."""

    def step(positions: FloatArray) -> FloatArray:
        here, report = replace(surface, positions=positions), surface.report
        choice = chosen(replace(here, report=report.part(0.0, 0.5)))
        return applied(replace(here, report=report.part(0.5, 1.0)), choice)

    return step


AUTO = Filter(
    name="auto",
    summary="chooses filters, strength and iterations by the error that each would leave; a clean mesh stays",
    prepare=prepare,
)
