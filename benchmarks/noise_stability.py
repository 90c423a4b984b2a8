"""How endpoint counts and D move with noise (thesis, Figure 4.13), with and without denoising.

    ./run python benchmarks/noise_stability.py [SET ...] [--shapes 20] [--picture docs/pictures/noise.svg]

SET is a folder with labels.csv, or `synthetic`; by default the synthetic set, and articulated-a under $REEBASE_DATA or
../shared/data where present; `--shapes` of each, spread over its classes. Noise along the normals, sigma from 0 to 0.4
mean edge lengths (2.31). For `srg` and `extended`, under each way of denoising: the share of shapes that keep their
endpoint count, the median change of the count, and the median D to the shape without noise under the same profile; and
as a measure for it the median D between shapes of one class and of two. The picture, of the first set alone, is drawn
with matplotlib.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from retrieval import DATA, load

from reebase.denoise.noise import add_noise
from reebase.descriptors import descriptor_named, surface_of
from reebase.mesh import Mesh, clean, read
from reebase.pipeline import Profile, describe

STRENGTHS = (0.0, 0.05, 0.1, 0.2, 0.3, 0.4)
DENOISE = ("none", "finite_volume", "auto")
DESCRIPTORS = ("srg", "extended")
Kept = dict[str, np.ndarray]
Curves = dict[tuple[str, str], list[tuple[float, float, float]]]


def kept(mesh: Mesh, denoise: str) -> Kept:
    surface = surface_of(describe(mesh, Profile(denoise=denoise)))
    return {name: descriptor_named(name).describe(surface) for name in DESCRIPTORS}


def measure(labels: list[str], meshes: list[Mesh]) -> tuple[Curves, dict[tuple[str, str], tuple[float, float]]]:
    curves: Curves = {}
    typical = {}
    same = np.array([[a == b for a in labels] for b in labels])
    apart = ~np.eye(len(labels), dtype=bool)
    for denoise in DENOISE:
        clear = [kept(mesh, denoise) for mesh in meshes]
        for name in DESCRIPTORS:
            D = descriptor_named(name).distances([one[name] for one in clear])
            typical[denoise, name] = float(np.median(D[same & apart])), float(np.median(D[~same]))
        for strength in STRENGTHS:
            noisy = [kept(add_noise(mesh, strength, seed=seed), denoise) for seed, mesh in enumerate(meshes)]
            for name in DESCRIPTORS:
                change = np.array([len(a[name]) - len(b[name]) for a, b in zip(noisy, clear, strict=True)])
                D = np.array([
                    descriptor_named(name).compare(b[name], a[name]) for a, b in zip(noisy, clear, strict=True)
                ])  # fmt: skip
                row = float(np.mean(change == 0)), float(np.mean(change)), float(np.median(D))
                curves.setdefault((denoise, name), []).append(row)
    return curves, typical


def main() -> None:
    default = ["synthetic"] + [name for name in ("articulated-a",) if (DATA / name).is_dir()]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", default=default)
    parser.add_argument("--shapes", type=int, default=20)
    parser.add_argument("--picture", type=Path)
    options = parser.parse_args()
    for number, name in enumerate(options.sets):
        labels, sources = load(name)
        # Two neighbours of each class stay together, so that there are pairs of one class.
        step = max(2, 2 * (len(labels) // options.shapes))
        chosen = [at for at in range(len(labels)) if at % step < 2][: options.shapes]
        meshes = [clean(read(sources[at]) if isinstance(sources[at], Path) else sources[at])[0] for at in chosen]
        curves, typical = measure([labels[at] for at in chosen], meshes)
        print(f"\n{name}: {len(chosen)} shapes; noise in mean edge lengths: share with the same endpoint count, mean")
        print("change of the count, median D to the shape without noise")
        print(f"{'':24s}", *(f"{strength:>17g}" for strength in STRENGTHS), f"{'D in class, else':>18s}")
        for (denoise, which), rows in curves.items():
            cells = (f"{same:.2f} {change:+.1f} {D:6.3f}" for same, change, D in rows)
            within, between = typical[denoise, which]
            print(f"{which:10s}{denoise:14s}", *(f"{cell:>17s}" for cell in cells), f"{within:9.3f}{between:9.3f}")
        if number == 0 and options.picture:
            draw(options.picture, curves, typical)


def draw(target: Path, curves: Curves, typical: dict[tuple[str, str], tuple[float, float]]) -> None:
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams["svg.hashsalt"] = "reebase"
    from matplotlib import pyplot

    figure, panels = pyplot.subplots(2, 2, figsize=(9, 6), sharex=True)
    for column, name in enumerate(DESCRIPTORS):
        for denoise in DENOISE:
            rows = np.array(curves[denoise, name])
            panels[0, column].plot(STRENGTHS, rows[:, 0], marker="o", label=denoise)
            panels[1, column].plot(STRENGTHS, rows[:, 2], marker="o", label=denoise)
        within = np.mean([typical[denoise, name][0] for denoise in DENOISE])
        panels[1, column].axhline(within, color="grey", linestyle=":", label="two of one class")
        panels[0, column].set_title(name)
        panels[0, column].set_ylim(0, 1.05)
        panels[1, column].set_xlabel("σ in mean edge lengths")
        panels[1, column].legend(fontsize=8)
    panels[0, 0].set_ylabel("share with the same\nendpoint count")
    panels[1, 0].set_ylabel("median D to the shape\nwithout noise")
    figure.tight_layout()
    figure.savefig(target, metadata={"Date": None})


if __name__ == "__main__":
    main()
