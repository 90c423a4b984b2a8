"""Denoising quality: every registered filter on noisy/truth pairs, beside other tools' filters in the same run.

    ./run python benchmarks/denoising.py [FOLDER] [--methods mean taubin] [--iterations 1 5 10 20] [--plots FOLDER]
                                         [--patience 90]

FOLDER has pairs.csv with columns noisy,truth; by default denoise-a, looked for under $REEBASE_DATA or ../shared/data.
Where that is absent, the shapes of ``noisy_shapes.py``. Prints, averaged over pairs and after each number of
iterations: the mean angle between the face normals of result and truth, and the same within one ring of edges above 60
degrees; the face-normal error (3.8); the visual error (2.33) in squared mean edges; the mean displacement in mean
edges; the mean distance of 500 vertices to the true surface in percent of the diagonal; the mean absolute change of
volume in percent over closed truths; seconds of processor time, and nanoseconds per vertex and iteration, topology
included. An iteration of a filter of normals is one round of several passes. What would take longer than --patience is
left out. --plots draws the errors over the iterations, as the thesis's Figures 2.8-2.9 and 3.14-3.16 do. Then `auto`
stands beside each fixed filter at the number of iterations that serves it best, with the angle by kind of shape; below
it bootstrap intervals over shapes of auto's angle and of what the best five leave more, its choices, and what it makes
of the truths, which have no noise. On denoise-a a row states what a prototype of the same reading, or other
implementations of the same paper at the same setting, measured; the script exits 1 when ours is more than 0.3 degrees
off (or worse).
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from denoising_peers import peers
from noisy_shapes import noisy_pairs

from reebase.denoise import (
    METHODS,
    choose,
    denoise,
    displacement,
    edge_angle,
    errors,
    face_normal_error,
    mean_angle,
    visual_error,
    volume_change,
)
from reebase.denoise.distance import distances_to_surface
from reebase.errors import MeshError
from reebase.mesh.geometry import mean_edge_length
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read
from reebase.mesh.topology import Edges

DATA = Path(os.environ.get("REEBASE_DATA", Path(__file__).resolve().parent.parent.parent / "shared" / "data"))
EXPECTED = {
    "finite_volume": {1: 15.5, 2: 12.3, 3: 11.6, 5: 12.0, 10: 14.2},
    "bilateral_normal": {1: 9.7},
    "guided_normal": {1: 8.91},
    "fast_effective": {1: 9.06},
    "taubin": {20: 10.4},
}
"""Mean angle on denoise-a by iterations: finite_volume by a prototype, the others by implementations in C++."""
TOLERANCE = 0.3
COLUMNS = ("angle", "at edges", "E (3.8)", "visual", "disp", "dist %", "volume %")
HEADS = (
    "mean angle between face normals, degrees", "the same within a ring of sharp edges, degrees",
    "face-normal error (3.8)", "visual error (2.33), squared mean edges", "displacement, mean edges",
    "distance to the true surface, % of the diagonal", "absolute change of volume, %",
)  # fmt: skip
SAMPLE = 500
"""Vertices of a mesh whose distance to the true surface is measured: it takes longer than most filters."""
ONCE = ("auto", "l0", "meshlib by normals")
"""Methods that settle everything in one iteration."""

Pair = tuple[str, Mesh, Mesh]
Run = Callable[[Mesh, int], Mesh]


def pairs_in(folder: Path) -> list[Pair]:
    """Name, noisy mesh and truth of each pair in a folder."""
    with (folder / "pairs.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    return [(row["noisy"], read(folder / row["noisy"]), read(folder / row["truth"])) for row in rows]


def kinds_in(folder: Path) -> list[str]:
    """The kind of shape of each pair, where the list has it; else none."""
    with (folder / "pairs.csv").open(newline="") as lines:
        return [row["kind"] for row in csv.DictReader(lines) if row.get("kind")]


def ours(name: str, boundary: str) -> Run:
    """A registered filter at its defaults."""
    return lambda mesh, iterations: denoise(mesh, name, iterations, boundary=boundary)


def means(pairs: list[Pair], results: list[Mesh]) -> list[float]:
    """Each measure of COLUMNS, averaged over the pairs that have it."""
    table = np.array([measures(truth, result) for (_, _, truth), result in zip(pairs, results, strict=True)])
    counts = np.isfinite(table).sum(axis=0)
    return [float(np.nansum(one) / count) if count else np.nan for one, count in zip(table.T, counts, strict=True)]


def edges_once(find: Callable[[np.ndarray], Edges]) -> Callable[[np.ndarray], Edges]:
    """Finds the edges of each list of faces once, as the same truths are compared with again and again."""
    known: dict[int, tuple[np.ndarray, Edges]] = {}

    def found(faces: np.ndarray) -> Edges:
        if id(faces) not in known:
            known[id(faces)] = faces, find(faces)
        return known[id(faces)][1]

    return found


def measures(truth: Mesh, result: Mesh) -> list[float]:
    """Each measure of COLUMNS, NaN for one that the pair does not have."""
    corners = truth.vertices[truth.faces].reshape(-1, 3)
    diagonal = np.linalg.norm(corners.max(axis=0) - corners.min(axis=0))
    some = np.unique(truth.faces)[:: max(1, len(truth.vertices) // SAMPLE)]
    try:
        volume = abs(volume_change(truth, result))
    except MeshError:
        volume = np.nan
    at_edges = edge_angle(truth, result)
    return [
        mean_angle(truth, result), np.nan if at_edges is None else at_edges, face_normal_error(truth, result),
        visual_error(truth, result) / mean_edge_length(truth) ** 2, displacement(truth, result),
        100 * float(distances_to_surface(result.vertices[some], truth).mean() / diagonal), volume,
    ]  # fmt: skip


def expected_row(name: str, found: list[float], iterations: list[int]) -> float:
    """How far a row of angles is from what is expected, in degrees; prints the latter."""
    expected = np.array([EXPECTED[name].get(count, np.nan) for count in iterations])
    if np.isnan(expected).all():
        return 0.0
    print(f"{name}, expected".ljust(28), *("       " if np.isnan(angle) else f"{angle:7.2f}" for angle in expected))
    over = np.array(found) - expected
    return float(np.nanmax(np.abs(over) if name == "finite_volume" else over))


class Measured(NamedTuple):
    """What a method gave: each measure after each number of iterations, the angles of each pair then, and the best."""

    rows: list[list[float]]
    angles: list[list[float]]

    @property
    def best(self) -> int:
        """The place of the row with the least angle."""
        return int(np.argmin([row[0] for row in self.rows]))


def detail_table(
    runs: dict[str, Run], pairs: list[Pair], iterations: list[int], patience: float
) -> dict[str, Measured]:
    """Every measure, and the time, of each run after each number of iterations."""
    vertices = sum(len(noisy.vertices) for _, noisy, _ in pairs)
    print("all measures".ljust(28), *(head.rjust(9) for head in (*COLUMNS, "s", "ns/v/it")))
    print("noisy".ljust(28), *(f"{value:9.3f}" for value in means(pairs, [noisy for _, noisy, _ in pairs])))
    found: dict[str, Measured] = {}
    for name, run in runs.items():
        one = found[name] = Measured([], [])
        each = 0.0
        for count in iterations if name not in ONCE else iterations[:1]:
            if each * count > patience:
                print(f"{name} x{count}".ljust(28), f"left out, would take {each * count:.0f} s", flush=True)
                continue
            start = time.process_time()
            results = [run(noisy, count) for _, noisy, _ in pairs]
            seconds = time.process_time() - start
            each = seconds / count
            one.rows.append(means(pairs, results))
            one.angles.append(
                [mean_angle(truth, result) for (_, _, truth), result in zip(pairs, results, strict=True)]
            )
            print(f"{name} x{count}".ljust(28), *(f"{value:9.3f}" for value in one.rows[-1]), end=" ")
            print(f"{seconds:9.2f} {1e9 * each / vertices:9.0f}", flush=True)
    return found


def draw(found: dict[str, Measured], iterations: list[int], folder: Path) -> None:
    """One plot a measure over the iterations: ours in full lines, other tools' in broken ones."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    folder.mkdir(parents=True, exist_ok=True)
    for column, head in enumerate(COLUMNS):
        figure = Figure(figsize=(9, 6), layout="constrained")
        axes = figure.add_subplot()
        for number, (name, one) in enumerate(found.items()):
            axes.plot(
                iterations[: len(one.rows)], [row[column] for row in one.rows], label=name,
                color=colormaps["tab20"](number % 20), linestyle="-" if name in METHODS else "--",
                marker="o" if len(one.rows) > 1 else "*", markersize=3 if len(one.rows) > 1 else 9,
            )  # fmt: skip
        if column != COLUMNS.index("angle"):
            axes.set_yscale("log")
        # One filter that fails at one iteration would make the others one line.
        axes.set_ylim(top=1.1 * np.percentile([row[column] for one in found.values() for row in one.rows], 98))
        axes.set(xlabel="iterations", ylabel=HEADS[column], xticks=iterations)
        axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1, 0.5))
        figure.savefig(folder / f"{''.join(c for c in head if c.isalnum())}.svg")


def comparison(found: dict[str, Measured], pairs: list[Pair], iterations: list[int], kinds: list[str]) -> None:
    """auto once, and every other run at its best number of iterations: angle, E, displacement, volume, kinds."""
    groups = sorted(set(kinds))
    print("\nauto beside fixed filters".ljust(29), *(head[:9].rjust(9) for head in (*COLUMNS, *groups)))
    for name, one in sorted(found.items(), key=lambda entry: (entry[0] != "auto", entry[1].rows[entry[1].best][0])):
        angles = np.array(one.angles[one.best])
        values = (*one.rows[one.best], *(angles[np.array(kinds) == group].mean() for group in groups))
        print(f"{name} x{iterations[one.best]}".ljust(28), *(f"{value:9.3f}" for value in values), flush=True)
    if "auto" not in found:
        return
    angles = {name: np.array(one.angles[one.best]) for name, one in found.items()}
    chosen = angles.pop("auto")
    names = [name for name, _, _ in pairs]
    print("\nauto: {:.2f} to {:.2f} degrees, 95 % bootstrap interval over shapes".format(*interval(chosen, names)))
    if angles:
        told = np.min(list(angles.values()), axis=0)
        low, high = interval(told, names)
        print(f"the best of all others for each pair, told the truth: {told.mean():.2f}, {low:.2f} to {high:.2f}")
    for name in sorted(angles, key=lambda name: float(angles[name].mean()))[:5]:
        low, high = interval(angles[name] - chosen, names)
        print(f"{name} leaves {(angles[name] - chosen).mean():.2f} more, {low:.2f} to {high:.2f}")
    for (name, noisy, _), angle in zip(pairs, chosen, strict=True):
        choice = choose(noisy)
        parts = "; ".join(
            f"{part.share:.0%} {part.method} x{part.iterations} {' '.join(map(str, part.parameters.values()))}"
            for part in choice.parts
        )
        print(f"{name[:28]:28} {angle:7.2f}  {choice.surface:6} {parts}")
    of_clean(pairs)


def of_clean(pairs: list[Pair]) -> None:
    """What auto makes of each truth: the noise that it finds, and how far the result is."""
    print("\nauto on truths".ljust(29), *(head.rjust(9) for head in ("noise", "angle", "disp", "volume %")))
    rows = []
    for truth in {truth.vertices.tobytes(): truth for _, _, truth in pairs}.values():
        choice, result = choose(truth), denoise(truth, "auto")
        found = measures(truth, result)
        rows.append([choice.noise, *(found[COLUMNS.index(head)] for head in ("angle", "disp", "volume %"))])
        print(f"{truth!r:28}", *(f"{value:9.3f}" for value in rows[-1]), choice.surface, flush=True)
    print("mean".ljust(28), *(f"{value:9.3f}" for value in np.nanmean(rows, axis=0)))


def interval(angles: np.ndarray, names: list[str], rounds: int = 10_000) -> tuple[float, float]:
    """Of the mean angle, with whole shapes drawn: pairs whose names begin with the same letters are of one shape."""
    shapes = np.array([re.sub(r"(_g)?\d.*", "", name.split(" ")[0]) for name in names])
    members = [angles[shapes == one] for one in sorted(set(shapes))]
    sums, counts = np.array([one.sum() for one in members]), np.array([len(one) for one in members])
    drawn = np.random.default_rng(0).integers(0, len(sums), (rounds, len(sums)))
    low, high = np.percentile(sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1), [2.5, 97.5])
    return float(low), float(high)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, default=DATA / "denoise-a")
    parser.add_argument("--methods", nargs="+", choices=list(METHODS), help="only these, and no peers")
    parser.add_argument("--iterations", nargs="+", type=int, default=[1, 5, 10, 20])
    parser.add_argument("--plots", type=Path, help="draw the errors over the iterations into this folder")
    parser.add_argument("--patience", type=float, default=90.0, help="seconds that a row may take")
    parser.add_argument("--boundary", default="curve")
    parser.add_argument("--each", action="store_true", help="also the angle of each pair by each filter")
    options = parser.parse_args()
    real = (options.folder / "pairs.csv").is_file()
    if real:
        pairs, kinds = pairs_in(options.folder), kinds_in(options.folder)
    else:
        own = list(noisy_pairs())
        pairs, kinds = [(pair.name, pair.noisy, pair.truth) for pair in own], [pair.kind for pair in own]
    runs = {name: ours(name, options.boundary) for name in options.methods or METHODS}
    if not options.methods:
        runs |= peers()
    for run in runs.values():
        run(pairs[0][1], 1)  # compiles, so that no timing contains it

    print(f"{len(pairs)} pairs of {options.folder.name if real else 'the synthetic set'},", end=" ")
    print(f"noisy {np.mean([mean_angle(truth, noisy) for _, noisy, truth in pairs]):.2f} degrees;", end=" ")
    print(f"Python {platform.python_version()}, numpy {np.__version__}\n")
    errors.edges = edges_once(errors.edges)
    measured = detail_table(runs, pairs, options.iterations, options.patience)
    if options.plots:
        draw(measured, options.iterations, options.plots)
    rows = {name: [values[0] for values in one.rows] for name, one in measured.items()}
    off = {}
    if options.folder.name == "denoise-a" and real:
        off = {name: expected_row(name, rows[name], options.iterations) for name in EXPECTED if name in rows}
    comparison(measured, pairs, options.iterations, kinds)
    if options.each:
        for method, one in measured.items():
            print(f"\n{method}, each pair".ljust(29), *(f"x{count}".rjust(7) for count in options.iterations))
            for (name, _, _), angles in zip(pairs, np.transpose(one.angles), strict=True):
                print(name[:28].ljust(28), *(f"{angle:7.2f}" for angle in angles))
    for name, degrees in off.items():
        if degrees > TOLERANCE:
            print(f"\n{name} is {degrees:.2f} degrees off what is expected")
    if any(degrees > TOLERANCE for degrees in off.values()):
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
