"""Which bands, pruning and operator serve retrieval by srg: a sweep, with the choice cross-validated over classes.

    ./run python benchmarks/skeleton_sweep.py [SET ...] [--bands 32 64 128 256 512] [--levels width area]
        [--threshold 0.005 0.01 0.02] [--saliency area length] [--operator auto tufted] [--folds 5]

SET is a folder with labels.csv, or `synthetic`; by default the labelled sets under $REEBASE_DATA or ../shared/data,
where present, and the synthetic set. Every mesh is cleaned and its phi_2 solved once an operator, without denoising.

levels: `width` cuts bands of equal width in phi_2, as the thesis does, `area` bands of equal area.
Folds: the classes of a set are dealt out to folds; for each fold the setting with the best mean of MAP over sets on the
classes of the other folds is measured on the fold's own. What it prints: MAP and NN of every setting on every set, the
choice of each fold, and how far the held-out MAP lies below the fold's own best.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from reebase.errors import ReebaseError
from reebase.evaluation.matrix import dissimilarity_matrix
from reebase.evaluation.measures import evaluate
from reebase.evaluation.synthetic import synthetic_set
from reebase.matching.features import endpoint_features
from reebase.mesh import Mesh
from reebase.mesh.clean import clean
from reebase.mesh.read import read
from reebase.mesh.topology import largest_component
from reebase.skeleton import prune, reeb_graph, rooted
from reebase.spectrum import eigenpairs, operator

DATA = Path(os.environ.get("REEBASE_DATA", Path(__file__).resolve().parent.parent.parent / "shared" / "data"))
SETS = ("articulated-a", "rigid-a", "hires-a")
Array = npt.NDArray[np.float64]


class Setting(NamedTuple):
    operator: str
    levels: str
    bands: int
    saliency: str
    threshold: float


def load(name: str) -> tuple[list[str], list[Mesh]]:
    """Labels and the largest components of the cleaned meshes."""
    if name == "synthetic":
        shapes = list(synthetic_set())
        return [shape.label for shape in shapes], [shape.mesh for shape in shapes]
    folder = Path(name) if Path(name).is_dir() else DATA / name
    with (folder / "labels.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    labels, meshes = [], []
    for row in rows:
        try:
            cleaned, _ = clean(read(folder / row["file"]))
            meshes.append(largest_component(cleaned)[0])
            labels.append(row["label"])
        except ReebaseError as refusal:
            print(f"  left out: {row['file']}: {refusal.message}")
    return labels, meshes


def main() -> None:
    present = [name for name in SETS if (DATA / name).is_dir()]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", default=[*present, "synthetic"])
    parser.add_argument("--operator", nargs="+", default=["auto", "tufted"])
    parser.add_argument("--levels", nargs="+", default=["width", "area"])
    parser.add_argument("--bands", nargs="+", type=int, default=[32, 64, 128, 256, 512])
    parser.add_argument("--saliency", nargs="+", default=["area", "length"])
    parser.add_argument("--threshold", nargs="+", type=float, default=[0.0025, 0.005, 0.01, 0.02])
    parser.add_argument("--folds", type=int, default=5)
    options = parser.parse_args()
    settings = [
        Setting(*values)
        for values in itertools.product(
            options.operator, options.levels, options.bands, options.saliency, options.threshold
        )
    ]
    matrices: dict[str, dict[Setting, Array]] = {}
    labels_of: dict[str, list[str]] = {}
    print("set            operator  levels  bands saliency  least     NN    MAP  ends")
    for name in options.sets:
        labels, meshes = load(name)
        labels_of[name], matrices[name] = labels, {}
        for kind in options.operator:
            fields = [eigenpairs(operator(mesh, kind), 2).eigenvectors[:, 1] for mesh in meshes]
            for levels, bands in itertools.product(options.levels, options.bands):
                graphs = [
                    reeb_graph(mesh, phi, bands, levels)
                    for mesh, phi in zip(meshes, fields, strict=True)
                ]
                for saliency, threshold in itertools.product(options.saliency, options.threshold):
                    setting = Setting(kind, levels, bands, saliency, threshold)
                    features = [endpoint_features(rooted(prune(graph, threshold, saliency))) for graph in graphs]
                    matrices[name][setting] = dissimilarity_matrix(features, "matching")
                    found = measured(matrices[name][setting], labels)
                    ends = np.mean([len(omega) for omega in features])
                    print(
                        f"{name:14} {kind:9} {levels:7} {bands:5} {saliency:8} {threshold:6.4f} "
                        f"{found['nn']:6.3f} {found['map']:6.3f} {ends:5.1f}", flush=True,
                    )  # fmt: skip
    cross_validate(settings, matrices, labels_of, options.folds)


def measured(matrix: Array, labels: list[str], classes: set[str] | None = None) -> dict[str, float]:
    """NN and MAP of the shapes of these classes among themselves."""
    rows = [i for i, label in enumerate(labels) if classes is None or label in classes]
    report = evaluate(matrix[np.ix_(rows, rows)], [labels[i] for i in rows], bootstrap=0).to_json()["overall"]
    return {"nn": report["nn"], "map": report["map"]}


def cross_validate(
    settings: list[Setting], matrices: dict[str, dict[Setting, Array]], labels_of: dict[str, list[str]], folds: int
) -> None:
    print("\nmean MAP over the sets, best ten settings:")
    means = {
        setting: np.mean([measured(matrices[name][setting], labels_of[name])["map"] for name in matrices])
        for setting in settings
    }
    for setting in sorted(settings, key=lambda s: -means[s])[:10]:
        print(f"  {means[setting]:.4f}  {' '.join(map(str, setting))}")
    classes = {name: sorted(set(labels)) for name, labels in labels_of.items()}
    print(f"\nchosen on the classes of {folds - 1} folds, measured on the classes of the last:")
    for fold in range(folds):
        held = {name: set(of[fold::folds]) for name, of in classes.items()}
        rest = {name: set(of) - held[name] for name, of in classes.items()}

        def score(setting: Setting, among: dict[str, set[str]]) -> float:
            sets = [name for name in matrices if len(among[name]) > 1]
            return float(np.mean([measured(matrices[n][setting], labels_of[n], among[n])["map"] for n in sets]))

        chosen = max(settings, key=lambda s: score(s, rest))
        best = max(score(setting, held) for setting in settings)
        reached = score(chosen, held)
        print(f"  fold {fold}: {' '.join(map(str, chosen))}: held-out MAP {reached:.3f}, its own best {best:.3f}")


if __name__ == "__main__":
    main()
