"""What denoising is worth to retrieval: every filter named, on each set as it is and with noise.

    ./run python benchmarks/denoising_retrieval.py [SET ...] [--denoise none finite_volume auto] [--noise 0 0.2 0.4]

SET is a folder with labels.csv, or `synthetic`; by default articulated-a, rigid-a and hires-a, looked for under
$REEBASE_DATA or ../shared/data, where present, and the synthetic set. Noise is along the normals, in mean edge lengths,
another draw for each shape. Two tasks: `among` has every shape of the set with the same noise, each a query among the
others (leave-one-out); `copies` looks up the noisy copies among the originals, each described with the same filter:
the share whose nearest is their own original, and NN and MAP over the others. For `srg`, `extended` and `fused`,
which ranks unless a query names another. At the end, over all sets, what each filter but the last has less than it in
mean average precision, with 95 % bootstrap intervals over queries. --cache keeps what is described in a folder.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from retrieval import DATA, load

from reebase.denoise import add_noise
from reebase.descriptors import descriptor_named, surface_of
from reebase.errors import ReebaseError
from reebase.evaluation.measures import evaluate
from reebase.mesh import Mesh, clean, read
from reebase.pipeline import Profile, describe
from reebase.ranking import FUSED, PARTS, fuse, fused_matrix, statistics

NAMES = ("srg", *PARTS)
SHOWN = ("srg", "extended", FUSED)
Kept = dict[str, np.ndarray]
Precise = dict[tuple[float, str, str, str], list[np.ndarray]]
"""Average precisions of the queries of each set, by noise, task, ranking and filter."""


def kept(mesh: Mesh, profile: Profile) -> Kept | None:
    """What each descriptor keeps of a mesh; None where one refuses."""
    try:
        surface = surface_of(describe(mesh, profile))
        return {name: descriptor_named(name).describe(surface) for name in NAMES}
    except ReebaseError as refusal:
        print("  left out:", refusal.message)
        return None


def described(name: str, meshes: list[Mesh], noise: float, method: str, cache: Path | None) -> list[Kept | None]:
    """Every mesh with noise, denoised and described."""
    file = cache / f"{Path(name).name}-{noise:g}-{method}.npz" if cache else None
    if file is not None and file.is_file():
        with np.load(file) as archive:
            return [
                {one: archive[f"{at} {one}"] for one in NAMES} if f"{at} srg" in archive else None
                for at in range(len(meshes))
            ]
    profile = Profile(denoise=method)
    found = [
        kept(add_noise(mesh, noise, seed=number) if noise else mesh, profile) for number, mesh in enumerate(meshes)
    ]
    if file is not None:
        arrays = {f"{at} {one}": kept_of[one] for at, kept_of in enumerate(found) if kept_of for one in NAMES}
        np.savez(file, **arrays)
    return found


def matrices(shapes: list[Kept]) -> dict[str, np.ndarray]:
    """The dissimilarities of all pairs under each ranking that is shown."""
    parts = {name: descriptor_named(name).distances([one[name] for one in shapes]) for name in NAMES}
    return {"srg": parts["srg"], "extended": parts["extended"], FUSED: fused_matrix(parts)}


def across(originals: list[Kept], copies: list[Kept]) -> dict[str, np.ndarray]:
    """The dissimilarity of each copy, a row, to each original."""
    count = len(originals)
    parts = {name: descriptor_named(name).distances([one[name] for one in [*originals, *copies]]) for name in NAMES}
    known = statistics({part: parts[part][:count, :count] for part in PARTS}, np.arange(count))
    outside = statistics({part: parts[part][count:, :count] for part in PARTS}, np.full(count, -1))
    fused = []
    for row in range(count):
        own = {part: float(outside.scales[part][row]) for part in PARTS}
        fused.append(fuse({part: parts[part][count + row, :count] for part in PARTS}, own, known).dissimilarities)
    return {**{name: parts[name][count:, :count] for name in ("srg", "extended")}, FUSED: np.array(fused)}


def precisions(D: np.ndarray, labels: list[str]) -> np.ndarray:
    """The average precision of each query among the others, (n,), NaN where nothing is to be found."""
    found = np.full(len(D), np.nan)
    for query, row in enumerate(D):
        order = np.argsort(row, kind="stable")
        relevant = np.array(labels)[order[order != query]] == labels[query]
        if relevant.any():
            found[query] = (np.cumsum(relevant) / np.arange(1, len(relevant) + 1))[relevant].mean()
    return found


def main() -> None:
    default = [name for name in ("articulated-a", "rigid-a", "hires-a") if (DATA / name).is_dir()] + ["synthetic"]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", default=default)
    parser.add_argument("--denoise", nargs="+", default=["none", "finite_volume", "auto"])
    parser.add_argument("--noise", nargs="+", type=float, default=[0.0, 0.2, 0.4])
    parser.add_argument("--cache", type=Path)
    options = parser.parse_args()
    if options.cache:
        options.cache.mkdir(parents=True, exist_ok=True)
    precise: Precise = {}
    for name in options.sets:
        labels, sources = load(name)
        meshes = [clean(read(source) if isinstance(source, Path) else source)[0] for source in sources]
        print(f"\n{name}: {len(meshes)} shapes".ljust(43), *(f"{which:>22s}" for which in SHOWN))
        for noise in options.noise:
            for method in options.denoise:
                originals = described(name, meshes, 0.0, method, options.cache)
                copies = described(name, meshes, noise, method, options.cache) if noise else originals
                both = [at for at in range(len(meshes)) if originals[at] is not None and copies[at] is not None]
                report(noise, method, [originals[at] for at in both], [copies[at] for at in both],
                       [labels[at] for at in both], precise)  # fmt: skip
    differences(precise, options.denoise)


def report(
    noise: float, method: str, originals: list[Kept], copies: list[Kept], labels: list[str], precise: Precise
) -> None:
    """Both tasks at one noise by one filter; adds the average precisions of queries."""
    cells = []
    for which, D in matrices(copies).items():
        precise.setdefault((noise, "among", which, method), []).append(precisions(D, labels))
        found = evaluate(D, labels, bootstrap=0).overall
        cells.append(f"NN {found['nn']:.3f} MAP {found['map']:.3f}")
    print(f"  noise {noise:g}, {method}, among".ljust(42), *(f"{cell:>22s}" for cell in cells), flush=True)
    if noise:
        cells = []
        for which, D in across(originals, copies).items():
            precise.setdefault((noise, "copies", which, method), []).append(precisions(D, labels))
            own = np.mean(np.diag(D) <= D.min(axis=1) + 1e-9)
            found = evaluate(D - np.diag(np.diag(D)), labels, bootstrap=0).overall
            cells.append(f"own {own:.3f} MAP {found['map']:.3f}")
        print(f"  noise {noise:g}, {method}, copies".ljust(42), *(f"{cell:>22s}" for cell in cells), flush=True)


def differences(precise: Precise, methods: list[str], rounds: int = 2000) -> None:
    """What the last filter gains over each other one, over all sets."""
    random = np.random.default_rng(0)
    print(f"\nmean average precision with {methods[-1]} above that with another filter, mean over the sets")
    for noise, task, which, method in precise:
        if method == methods[-1]:
            continue
        pairs = zip(precise[noise, task, which, methods[-1]], precise[noise, task, which, method], strict=True)
        gains = [one[~np.isnan(one)] for one in (best - other for best, other in pairs)]
        drawn = [np.mean([random.choice(one, len(one)).mean() for one in gains]) for _ in range(rounds)]
        low, high = np.percentile(drawn, [2.5, 97.5])
        print(f"  noise {noise:g}, {task}, {which}, {method}".ljust(48), end=" ")
        print(f"{np.mean([one.mean() for one in gains]):+.4f} ({low:+.4f} to {high:+.4f})")


if __name__ == "__main__":
    main()
