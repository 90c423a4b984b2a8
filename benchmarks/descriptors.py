"""Every descriptor and the rankings made of them on labelled sets: how well each retrieves, its cost, and chance.

    ./run python benchmarks/descriptors.py [SET ...] [--descriptors NAME ...] [--denoise none] [--jobs 1] [--folds 5]
                                           [--relatives 2 3]

SET is a folder with labels.csv, or `synthetic`, or two folders as one set, A+B; by default articulated-a, rigid-a and
hires-a, looked for under $REEBASE_DATA or ../shared/data, where present, and the synthetic set. Prints NN, first and
second tier, E, MAP and DCG (leave-one-out, mean over queries) with the default measure; the 95 % bootstrap interval of
MAP over queries; the lowest and highest MAP over folds of the classes, each fold evaluated without the others, so an
easier task; the median wall time a mesh of the pipeline, of the eigenpairs that most share, and of each descriptor
beyond these; the median bytes a shape as float32. `fused` is all in: pipeline, eigenpairs and parts, and the line below
the table sets it beside `srg`, which is the pipeline alone.
--relatives: also fused and re-ranked on collections of so few shapes of each class, ten drawn at random.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import chain
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np
from retrieval import DATA, load

from reebase.descriptors import DESCRIPTORS, Surface, descriptor_named, surface_of
from reebase.errors import ReebaseError
from reebase.evaluation.measures import evaluate
from reebase.evaluation.synthetic import synthetic_set
from reebase.mesh import Mesh
from reebase.pipeline import Profile, describe
from reebase.ranking import FUSED, PARTS, fused_matrix, reranked_matrix

SHOWN = {"nn": "NN", "first_tier": "FT", "second_tier": "ST", "e_measure": "E", "map": "MAP", "dcg": "DCG"}
RERANKED = f"{FUSED}, re-ranked"
DRAWN = 10
UNIT = 1000.0


class Kept(NamedTuple):
    """What is kept of a shape by each descriptor, and the seconds of the pipeline, of the spectrum and of each."""

    arrays: dict[str, np.ndarray]
    seconds: dict[str, float]


def kept(source: Path | Mesh, names: list[str], profile: Profile) -> Kept | str:
    seconds: dict[str, float] = {}

    def timed(what: str, compute):
        start = time.perf_counter()
        result = compute()
        seconds[what] = time.perf_counter() - start
        return result

    try:
        description = timed("pipeline", lambda: describe(source, profile))
        surface: Surface = timed("operator", lambda: surface_of(description))
        if names != ["srg"]:
            timed("eigenpairs", surface.spectrum)
        arrays = {name: timed(name, partial(descriptor_named(name).describe, surface)) for name in names}
    except ReebaseError as refusal:
        return f"{source}: {refusal.message}"
    if set(PARTS) <= set(names):
        seconds[FUSED] = sum(seconds[part] for part in ("pipeline", "operator", "eigenpairs", *PARTS))
    return Kept(arrays, seconds)


def folds(labels: list[str], count: int, seed: int = 0) -> list[np.ndarray]:
    """Indices of the shapes of each fold: whole classes, dealt out at random."""
    classes = np.random.default_rng(seed).permutation(sorted(set(labels)))
    return [np.flatnonzero(np.isin(labels, part)) for part in np.array_split(classes, count) if len(part) > 1]


def main() -> None:
    default = [name for name in ("articulated-a", "rigid-a", "hires-a") if (DATA / name).is_dir()] + ["synthetic"]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", default=default)
    parser.add_argument("--descriptors", nargs="+", default=list(DESCRIPTORS), choices=list(DESCRIPTORS))
    parser.add_argument("--denoise", default=Profile().denoise)
    parser.add_argument("--folds", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--relatives", nargs="*", type=int, default=[])
    options = parser.parse_args()
    work = partial(kept, names=options.descriptors, profile=Profile(denoise=options.denoise))
    with ProcessPoolExecutor(options.jobs, mp_context=get_context("spawn")) as pool:
        list(pool.map(work, [next(iter(synthetic_set(per_class=1))).mesh] * options.jobs))  # compiles
        for name in options.sets:
            labels, sources = (list(chain(*parts)) for parts in zip(*map(load, name.split("+")), strict=True))
            found = list(pool.map(work, sources))
            for refusal in (one for one in found if isinstance(one, str)):
                print("  left out:", refusal)
            pairs = [(one, label) for one, label in zip(found, labels, strict=True) if not isinstance(one, str)]
            report(name, [one for one, _ in pairs], [label for _, label in pairs], options)


def report(name: str, shapes: list[Kept], labels: list[str], options: argparse.Namespace) -> None:
    def milliseconds(what: str) -> float:
        return UNIT * float(np.median([shape.seconds.get(what, 0.0) for shape in shapes]))

    print(
        f"\n{name}: {len(shapes)} shapes, denoise {options.denoise}; a mesh takes {milliseconds('pipeline'):.0f} ms "
        f"in the pipeline, its eigenpairs {milliseconds('operator') + milliseconds('eigenpairs'):.0f} ms"
    )
    titles = " ".join(f"{title:>6s}" for title in SHOWN.values())
    print(f"{'':17s} {titles}         MAP 95 %    over folds     ms  bytes")
    matrices = {}
    for which in options.descriptors:
        matrices[which] = descriptor_named(which).distances([shape.arrays[which] for shape in shapes])
        size = 4 * float(np.median([shape.arrays[which].size for shape in shapes]))
        line(which, matrices[which], labels, options.folds, f"{milliseconds(which):6.1f} {size:6.0f}")
    if not set(PARTS) <= set(matrices):
        return
    fused = fused_matrix(matrices)
    size = 4 * float(np.median([sum(shape.arrays[part].size for part in PARTS) for shape in shapes]))
    for which, matrix in ((FUSED, fused), (RERANKED, reranked_matrix(fused))):
        line(which, matrix, labels, options.folds, f"{milliseconds(FUSED):6.1f} {size:6.0f}")
    print(f"fused takes {milliseconds(FUSED) / milliseconds('pipeline'):.1f} times as long as srg")
    for count in options.relatives:
        few({part: matrices[part] for part in PARTS}, labels, count)


def line(which: str, D: np.ndarray, labels: list[str], count: int, cost: str) -> None:
    full = evaluate(D, labels).to_json()
    low, high = full["intervals"]["map"]
    over = [
        evaluate(D[np.ix_(part, part)], [labels[i] for i in part], bootstrap=0).to_json()["overall"]["map"]
        for part in folds(labels, count)
    ]
    print(
        f"{which:17s}", *(f"{full['overall'][key]:6.3f}" for key in SHOWN),
        f"  [{low:.3f}, {high:.3f}] {min(over):6.3f}-{max(over):.3f} {cost}",
        flush=True,
    )  # fmt: skip


def few(matrices: dict[str, np.ndarray], labels: list[str], count: int) -> None:
    """Collections of ``count`` + 1 shapes of each class: every query has so many relatives."""

    def mean(rank: Callable[[np.ndarray], np.ndarray]) -> str:
        found = []
        for seed in range(DRAWN):
            random = np.random.default_rng(seed)
            chosen = np.concatenate([
                random.permutation(np.flatnonzero(np.array(labels) == label))[: count + 1]
                for label in sorted(set(labels))
            ])  # fmt: skip
            F = fused_matrix({part: D[np.ix_(chosen, chosen)] for part, D in matrices.items()})
            overall = evaluate(rank(F), [labels[i] for i in chosen], bootstrap=0).to_json()["overall"]
            found.append([overall[key] for key in SHOWN])
        return " ".join(f"{value:6.3f}" for value in np.mean(found, axis=0))

    print(f"{count} relatives: {FUSED}", " " * 2, mean(lambda F: F), "\n             re-ranked", mean(reranked_matrix))


if __name__ == "__main__":
    main()
