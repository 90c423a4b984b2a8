"""The same shape in other meshes: its endpoint counts, and D beside what D is within a class and between classes.

    ./run python benchmarks/tessellation.py [--vertices 2000 8000 32000] [--shapes 2] [--denoise none finite_volume]
        [--fine FOLDER --coarse FOLDER]

Figures of the synthetic set, each meshed at every number of vertices on a grid of its own; then pairs of files, the
same shape in two folders that hold McGill shapes at about 12,000 and 1,000 vertices, by default hires-a and
articulated-a under $REEBASE_DATA or ../shared/data (`reebase duplicates` finds these pairs). For `srg` and `extended`,
by their first measure, and each way of denoising: the share of shapes whose meshes have one endpoint count, the median
D of two meshes of one shape, that of two shapes of one class and of two classes, all beside the number of vertices they
are at, and how often the nearest of all coarse meshes is the shape's own.
"""

from __future__ import annotations

import argparse
import itertools
import os
from pathlib import Path

import numpy as np

from reebase.descriptors import descriptor_named, surface_of
from reebase.evaluation.synthetic import CLASSES, _meshed
from reebase.evaluation.synthetic.figures import FIGURES
from reebase.mesh import Mesh
from reebase.pipeline import Profile, describe

DATA = Path(os.environ.get("REEBASE_DATA", Path(__file__).resolve().parent.parent.parent / "shared" / "data"))
DESCRIPTORS = ("srg", "extended")
PAIRED = {"ant": "ants", "bear": "teddy-bears", "hand": "hands", "human": "humans", "pliers": "pliers",
          "snake": "snakes"}  # fmt: skip
Kept = dict[str, np.ndarray]


def kept(source: Mesh | Path, denoise: str) -> Kept:
    surface = surface_of(describe(source, Profile(denoise=denoise)))
    return {name: descriptor_named(name).describe(surface) for name in DESCRIPTORS}


def figures(count: int, vertices: list[int]) -> dict[int, list[tuple[str, Mesh]]]:
    """Number of vertices -> class and mesh of each figure, the same figures for every number."""
    made: dict[int, list[tuple[str, Mesh]]] = {number: [] for number in vertices}
    for label in CLASSES:
        found = 0
        for index in itertools.count():
            random = np.random.default_rng([index, CLASSES.index(label)])
            figure = FIGURES[label](random)
            meshes = [_meshed(figure, number, np.random.default_rng([index, number])) for number in vertices]
            if all(mesh is not None for mesh in meshes):
                for number, mesh in zip(vertices, meshes, strict=True):
                    made[number].append((label, mesh))
                found += 1
            if found == count:
                break
    return made


def pairs(fine: Path, coarse: Path) -> tuple[list[tuple[str, Path]], list[tuple[str, Path]]]:
    one, other = [], []
    for label, name in PAIRED.items():
        for path in sorted(fine.glob(f"{label}-*.ply")):
            also = coarse / f"{name}-{path.stem.rpartition('-')[2]}.ply"
            if also.exists():
                one.append((label, path))
                other.append((label, also))
    return one, other


def compare(name: str, labels: list[str], first: list[Kept], second: list[Kept], titles: tuple[str, str]) -> None:
    same = np.array([[a == b for a in labels] for b in labels])
    apart = ~np.eye(len(labels), dtype=bool)
    descriptor = descriptor_named(name)
    D = np.stack([descriptor.distances_to(one[name], [other[name] for other in second]) for one in first])
    equal = np.mean([len(a[name]) == len(b[name]) for a, b in zip(first, second, strict=True)])
    print(
        f"  {name:9s}{titles[0]:>7s} to {titles[1]:>6s}: as many endpoints {equal:.2f}, "
        f"D of the shape {np.median(np.diag(D)):.3f}, of its class {np.median(D[same & apart]):.3f}, of others "
        f"{np.median(D[~same]):.3f}, itself nearest {np.mean(D.argmin(axis=1) == np.arange(len(D))):.2f}", flush=True,
    )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--vertices", nargs="+", type=int, default=[2000, 8000, 32000])
    parser.add_argument("--shapes", type=int, default=2)
    parser.add_argument("--denoise", nargs="+", default=["none", Profile().denoise])
    parser.add_argument("--fine", type=Path, default=DATA / "hires-a")
    parser.add_argument("--coarse", type=Path, default=DATA / "articulated-a")
    options = parser.parse_args()
    made = figures(options.shapes, options.vertices) if options.shapes else {}
    one, other = pairs(options.fine, options.coarse)
    for denoise in options.denoise:
        if made:
            labels = [label for label, _ in made[options.vertices[0]]]
            print(f"\n{len(labels)} figures, denoise {denoise}")
            found = {number: [kept(mesh, denoise) for _, mesh in shapes] for number, shapes in made.items()}
            for number in options.vertices:
                counts = " ".join(str(len(shape["srg"])) for shape in found[number])
                print(f"  endpoints at {number}: {counts}")
            for name, (few, many) in itertools.product(DESCRIPTORS, itertools.combinations(options.vertices, 2)):
                compare(name, labels, found[few], found[many], (str(few), str(many)))
        if one:
            print(f"\n{len(one)} pairs of files, denoise {denoise}")
            fine, coarse = ([kept(path, denoise) for _, path in paths] for paths in (one, other))
            for name in DESCRIPTORS:
                compare(name, [label for label, _ in one], fine, coarse, ("fine", "coarse"))


if __name__ == "__main__":
    main()
