"""What each reading of the thesis's descriptor is worth: one choice changed at a time, from the thesis's own on.

    ./run python benchmarks/readings.py [SET ...] [--jobs 2]

SET is a folder with labels.csv, or `synthetic`; by default articulated-a, rigid-a and hires-a, looked for under
$REEBASE_DATA or ../shared/data, where present. Of each choice (count of bands, node area, normalisation of the paths,
scale of the features, pruning, what an unmatched endpoint costs, denoising and its order, the root) prints NN and MAP
(leave-one-out, mean over queries) on every set, and the mean gain in MAP over the first line: 128 bands of equal width,
as printed otherwise, without denoising. The pipeline's default differs from it by its bands of equal area.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from retrieval import DATA, load
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from reebase.denoise import denoise
from reebase.errors import ReebaseError
from reebase.evaluation.measures import evaluate
from reebase.mesh import Mesh
from reebase.mesh.clean import clean
from reebase.mesh.read import read
from reebase.mesh.topology import largest_component
from reebase.skeleton import Skeleton, prune, reeb_graph
from reebase.spectrum import eigenpairs, operator
from reebase.spectrum import field as scalar_field


@dataclass(frozen=True)
class Reading:
    """One way to read the method."""

    bands: int = 128
    levels: str = "width"  # area
    area: str = "band"  # ring, root, none
    paths: str = "printed"  # longest, area, mean
    scale: str = "raw"  # spread
    threshold: float = 0.01
    saliency: str = "area"
    charge: str = "norm"  # free, half, constant
    root: str = "centroid"  # centre
    operator: str = "auto"
    order: str = "clean, denoise"  # denoise, clean; field only
    iterations: int = 0


CHANGES: dict[str, list[Reading]] = {
    "bands": [Reading(bands=count) for count in (16, 32, 64, 256)],
    "level sets": [Reading(levels="area")],
    "node area": [Reading(area=how) for how in ("ring", "root", "none")],
    "normalisation of paths": [Reading(paths=how) for how in ("longest", "area", "mean")],
    "scale of features": [Reading(scale="spread"), Reading(scale="spread", area="root")],
    "pruning": [
        *(Reading(threshold=t) for t in (0.0, 0.003, 0.03)),
        *(Reading(saliency="length", threshold=t) for t in (0.01, 0.03)),
    ],
    "charge of an unmatched endpoint": [Reading(charge=how) for how in ("free", "half", "constant")],
    "root": [Reading(root="centre")],
    "operator": [Reading(operator="tufted")],
    "denoising after cleaning": [Reading(iterations=count) for count in (1, 3, 5)],
    "denoising before cleaning": [Reading(order="denoise, clean", iterations=1)],
    "denoising for the field alone": [Reading(order="field only", iterations=count) for count in (1, 3)],
    "the best of these together": [
        Reading(scale="spread", levels="area", root="centre"),
        Reading(scale="spread", levels="area", root="centre", threshold=0.003, operator="tufted"),
    ],
}


def skeleton(source: Path | Mesh, reading: Reading) -> Skeleton:
    mesh = source if isinstance(source, Mesh) else read(source)
    smooth = partial(denoise, method="finite_volume", iterations=reading.iterations)
    if reading.iterations and reading.order == "denoise, clean":
        mesh = smooth(mesh)
    body = largest_component(clean(mesh)[0])[0]
    smoothed = smooth(body) if reading.iterations and reading.order != "denoise, clean" else body
    spectrum = eigenpairs(operator(smoothed, reading.operator), 3)
    carrier = body if reading.order == "field only" else smoothed
    graph = reeb_graph(carrier, scalar_field("fiedler", carrier, spectrum), reading.bands, reading.levels)
    return prune(graph, reading.threshold, reading.saliency)


def features(source: Path | Mesh, reading: Reading) -> np.ndarray | str:
    try:
        graph = skeleton(source, reading)
    except ReebaseError as refusal:
        return f"{source}: {refusal.message}"
    ends, count = graph.endpoints, len(graph.positions)
    if len(ends) == 0:
        return np.zeros((0, 3))
    edges = coo_array((graph.lengths, (graph.edges[:, 0], graph.edges[:, 1])), shape=(count, count)).tocsr()
    paths = dijkstra(edges, directed=False)
    # The centre of the graph, where the farthest endpoint is nearest, needs no positions in space.
    root = graph.root if reading.root == "centroid" else int(np.argmin(paths[:, ends].max(axis=1)))
    from_root, between, k = paths[root, ends], paths[np.ix_(ends, ends)], len(ends)
    area = {
        "band": graph.areas, "ring": graph.ring_areas, "root": np.sqrt(graph.areas * graph.areas.sum()),
        "none": np.zeros(count),
    }[reading.area]  # fmt: skip
    unit = {
        "printed": from_root.sum(), "longest": between.max(), "area": np.sqrt(graph.areas.sum()),
        "mean": from_root.mean(),
    }[reading.paths]  # fmt: skip
    sums = between.sum(axis=1) if reading.paths == "printed" else between.sum(axis=1) / k
    if unit == 0.0:
        return np.zeros((0, 3))
    return np.column_stack([area[ends] / graph.areas.sum(), sums / unit, from_root / unit])


def charges(omega: np.ndarray, how: str, constant: float) -> np.ndarray:
    norm = np.linalg.norm(omega, axis=1)
    return {"norm": norm, "free": 0 * norm, "half": norm / 2, "constant": np.full(len(norm), constant)}[how]


def matrix(shapes: list[np.ndarray], reading: Reading) -> np.ndarray:
    """D by the maximum matching of smallest weight, with another charge for those left over."""
    every = np.vstack(shapes)
    if reading.scale == "spread":
        shapes = [omega / every.std(axis=0) for omega in shapes]
        every = np.vstack(shapes)
    constant = float(np.linalg.norm(every.std(axis=0)))
    out = np.zeros((len(shapes), len(shapes)))
    for i, first in enumerate(shapes):
        for j, second in enumerate(shapes[:i]):
            few, many = (first, second) if len(first) <= len(second) else (second, first)
            alone = charges(many, reading.charge, constant)
            phi = np.linalg.norm(few[:, None] - many[None], axis=2)
            rows, columns = linear_sum_assignment(phi - alone)
            out[i, j] = out[j, i] = (phi - alone)[rows, columns].sum() + alone.sum()
    return out


def main() -> None:
    default = [name for name in ("articulated-a", "rigid-a", "hires-a") if (DATA / name).is_dir()]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", default=default)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    sets = {name: load(name) for name in options.sets}
    print(f"{'':52s}", *(f"{name:>15s}" for name in sets), "   gain")
    with ProcessPoolExecutor(options.jobs, mp_context=get_context("spawn")) as pool:
        base = report("as printed, 128 bands", Reading(), sets, pool.map)
        for choice, readings in CHANGES.items():
            for reading in readings:
                report(f"{choice}: {changed(reading)}", reading, sets, pool.map, base)


def changed(reading: Reading) -> str:
    plain = Reading()
    return ", ".join(f"{k} {v}" for k, v in vars(reading).items() if v != getattr(plain, k))


def report(
    title: str,
    reading: Reading,
    sets: dict[str, tuple[list[str], list]],
    run: Callable,
    base: list[float] | None = None,
) -> list[float]:
    maps, columns = [], []
    for labels, sources in sets.values():
        found = list(run(partial(features, reading=replace(reading)), sources))
        kept = [(one, label) for one, label in zip(found, labels, strict=True) if not isinstance(one, str)]
        D = matrix([one for one, _ in kept], reading)
        overall = evaluate(D, [label for _, label in kept], bootstrap=0).to_json()["overall"]
        maps.append(overall["map"])
        columns.append(f"  {overall['nn']:.3f} / {overall['map']:.3f}")
    gain = "" if base is None else f" {np.mean(maps) - np.mean(base):+.3f}"
    print(f"{title:52s}", *columns, gain, flush=True)
    return maps


if __name__ == "__main__":
    main()
