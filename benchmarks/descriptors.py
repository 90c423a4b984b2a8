"""Every descriptor on labelled sets: how well it retrieves, what it costs, and how much of that is chance.

    ./run python benchmarks/descriptors.py [SET ...] [--descriptors NAME ...] [--denoise none] [--jobs 1] [--folds 5]

SET is a folder with labels.csv, or `synthetic`; by default articulated-a and rigid-a, looked for under
$REEBASE_DATA or ../shared/data, where present, and the synthetic set. Prints NN, first and second tier, DCG and MAP
(leave-one-out, mean over queries) with the default measure; the 95 % bootstrap interval of MAP over queries; the
lowest and highest MAP over folds of the classes, each fold evaluated without the others, so an easier task; the median
wall time a mesh of the pipeline, of the eigenpairs that most share, and of each descriptor beyond these;
and the median bytes a shape as float32.
"""

from __future__ import annotations

import argparse
import os
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
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

SHOWN = ("nn", "first_tier", "second_tier", "dcg", "map")
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
        surface: Surface = timed("surface", lambda: surface_of(description))
        if names != ["srg"]:
            timed("eigenpairs", surface.spectrum)
        arrays = {name: timed(name, partial(descriptor_named(name).describe, surface)) for name in names}
        return Kept(arrays, seconds)
    except ReebaseError as refusal:
        return f"{source}: {refusal.message}"


def folds(labels: list[str], count: int, seed: int = 0) -> list[np.ndarray]:
    """Indices of the shapes of each fold: whole classes, dealt out at random."""
    classes = np.random.default_rng(seed).permutation(sorted(set(labels)))
    return [np.flatnonzero(np.isin(labels, part)) for part in np.array_split(classes, count) if len(part) > 1]


def main() -> None:
    default = [name for name in ("articulated-a", "rigid-a") if (DATA / name).is_dir()] + ["synthetic"]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", default=default)
    parser.add_argument("--descriptors", nargs="+", default=list(DESCRIPTORS), choices=list(DESCRIPTORS))
    parser.add_argument("--denoise", default=Profile().denoise)
    parser.add_argument("--folds", type=int, default=3)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    work = partial(kept, names=options.descriptors, profile=Profile(denoise=options.denoise))
    with ProcessPoolExecutor(options.jobs, mp_context=get_context("spawn")) as pool:
        list(pool.map(work, [next(iter(synthetic_set(per_class=1))).mesh] * options.jobs))  # compiles
        for name in options.sets:
            labels, sources = load(name)
            found = list(pool.map(work, sources))
            for refusal in (one for one in found if isinstance(one, str)):
                print("  left out:", refusal)
            pairs = [(one, label) for one, label in zip(found, labels, strict=True) if not isinstance(one, str)]
            report(name, [one for one, _ in pairs], [label for _, label in pairs], options)


def report(name: str, shapes: list[Kept], labels: list[str], options: argparse.Namespace) -> None:
    def milliseconds(what: str) -> float:
        return UNIT * float(np.median([shape.seconds.get(what, 0.0) for shape in shapes]))

    print(
        f"\n{name}: {len(shapes)} shapes, denoise {options.denoise}; "
        f"pipeline {milliseconds('pipeline'):.0f} ms a mesh, eigenpairs {milliseconds('eigenpairs'):.0f} ms"
    )
    print(f"{'':10s}", *(f"{key:>11s}" for key in SHOWN), f"{'MAP 95 %':>15s} {'over folds':>13s}    ms  bytes")
    parts = folds(labels, options.folds)
    for which in options.descriptors:
        D = descriptor_named(which).distances([shape.arrays[which] for shape in shapes])
        full = evaluate(D, labels).to_json()
        low, high = full["intervals"]["map"]
        over = [
            evaluate(D[np.ix_(part, part)], [labels[i] for i in part], bootstrap=0).to_json()["overall"]["map"]
            for part in parts
        ]
        size = 4 * float(np.median([shape.arrays[which].size for shape in shapes]))
        print(
            f"{which:10s}", *(f"{full['overall'][key]:11.3f}" for key in SHOWN),
            f"  [{low:.3f}, {high:.3f}] {min(over):6.3f}-{max(over):.3f} {milliseconds(which):5.1f} {size:6.0f}",
            flush=True,
        )  # fmt: skip


if __name__ == "__main__":
    main()
