"""Retrieval of labelled sets by the thesis's descriptor: every measure of D, with and without denoising, by bands.

    ./run python benchmarks/retrieval.py [SET ...] [--bands 64 128] [--denoise finite_volume none] [--jobs 2]

SET is a folder with labels.csv, or `synthetic`; by default articulated-a and rigid-a, looked for under
$REEBASE_DATA or ../shared/data, where present, and the synthetic set. Prints NN, FT, ST, MAP and DCG (leave-one-out,
mean over queries) of each, the wall time of describing, and the peak memory of a process.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import os
import resource
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from reebase.errors import ReebaseError
from reebase.evaluation.matrix import dissimilarity_matrix
from reebase.evaluation.measures import evaluate
from reebase.evaluation.synthetic import synthetic_set
from reebase.matching import MEASURES
from reebase.mesh import Mesh
from reebase.pipeline import Profile, describe

DATA = Path(os.environ.get("REEBASE_DATA", Path(__file__).resolve().parent.parent.parent / "shared" / "data"))
SHOWN = ("nn", "first_tier", "second_tier", "map", "dcg")


def load(name: str) -> tuple[list[str], list[Path | Mesh]]:
    """Labels and sources of a set."""
    if name == "synthetic":
        shapes = list(synthetic_set())
        return [shape.label for shape in shapes], [shape.mesh for shape in shapes]
    folder = Path(name) if Path(name).is_dir() else DATA / name
    with (folder / "labels.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    return [row["label"] for row in rows], [folder / row["file"] for row in rows]


def features(task: tuple[Path | Mesh, Profile]) -> np.ndarray | str:
    source, profile = task
    try:
        return describe(source, profile).features
    except ReebaseError as refusal:
        return f"{source}: {refusal.message}"


def main() -> None:
    default = [name for name in ("articulated-a", "rigid-a") if (DATA / name).is_dir()] + ["synthetic"]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", default=default)
    parser.add_argument("--bands", nargs="+", type=int, default=[Profile().bands])
    parser.add_argument("--denoise", nargs="+", default=["finite_volume", "none"])
    parser.add_argument("--area", nargs="+", default=["band"])
    parser.add_argument("--operator", nargs="+", default=["auto"])
    parser.add_argument("--threshold", nargs="+", type=float, default=[Profile().threshold])
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    with ProcessPoolExecutor(options.jobs, mp_context=get_context("spawn")) as pool:
        list(pool.map(features, [(next(iter(synthetic_set(per_class=1))).mesh, Profile())] * options.jobs))
        for name in options.sets:
            labels, sources = load(name)
            for bands, denoise, area, threshold, operator in itertools.product(
                options.bands, options.denoise, options.area, options.threshold, options.operator
            ):
                profile = Profile(denoise=denoise, bands=bands, area=area, threshold=threshold, operator=operator)
                start = time.perf_counter()
                found = list(pool.map(features, [(source, profile) for source in sources], chunksize=4))
                seconds = time.perf_counter() - start
                for refusal in (one for one in found if isinstance(one, str)):
                    print("  left out:", refusal)
                kept = [(one, label) for one, label in zip(found, labels, strict=True) if not isinstance(one, str)]
                print(
                    f"\n{name}: {len(kept)} of {len(sources)} described in {seconds:.1f} s; "
                    f"{bands} bands, denoise {denoise}, area {area}, threshold {threshold}, operator {operator}"
                )
                for measure in MEASURES:
                    matrix = dissimilarity_matrix([one for one, _ in kept], measure)
                    report = evaluate(matrix, [label for _, label in kept], bootstrap=0).to_json()["overall"]
                    print(f"  {measure:15s}", "  ".join(f"{key} {report[key]:.3f}" for key in SHOWN), flush=True)
    peak = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    print(f"\npeak memory of a process: {peak / 1024:.0f} MiB")


if __name__ == "__main__":
    main()
