"""The constants of `extended`, `moments`, `fused` and re-ranking: what other values give, and what folds would choose.

    ./run python benchmarks/choices.py [SET ...] [--folds 4] [--only extended]

SET is a folder with labels.csv, or several as one set, A+B; by default articulated-a+rigid-a and hires-a, looked for
under $REEBASE_DATA or ../shared/data. One constant is changed at a time. The classes of each set are dealt into folds;
for each fold the value with the best mean average precision on the classes outside it is chosen, and judged on the
classes inside. Prints the value in use, MAP of every value on all classes (mean over the sets), the choice of each
fold, and the MAP of the value in use and of the chosen ones inside the folds.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from itertools import chain
from pathlib import Path
from types import MappingProxyType, ModuleType
from typing import Any, NamedTuple

import numpy as np
from descriptors import folds
from retrieval import DATA, load

from reebase.descriptors import Surface, descriptor_named, extended, moments, surface_of
from reebase.evaluation.measures import evaluate
from reebase.mesh import Mesh
from reebase.pipeline import Profile, describe
from reebase.ranking import PARTS, diffusion, fused_matrix, fusion, reranked_matrix


class Choice(NamedTuple):
    """A constant of a module, the values to try beside its own, and what it bears on."""

    module: ModuleType
    name: str
    values: list[Any]
    bears_on: str


def weights(module: ModuleType, name: str, factors: tuple[float, ...]) -> list[Choice]:
    """One choice for each of several weights: itself times each factor."""
    own: Mapping[str, float] = getattr(module, name)
    bears_on = "fused" if module is fusion else module.__name__.rpartition(".")[2]
    return [
        Choice(module, name, [MappingProxyType({**own, key: factor * own[key]}) for factor in factors], bears_on)
        for key in own
    ]


CHOICES = [
    Choice(extended, "TIME", [0.03, 0.05, 0.07], "extended"),
    Choice(extended, "LEAST", [0.01, 0.03, 0.05], "extended"),
    Choice(extended, "CHARGE", [1.0, 2.0], "extended"),
    Choice(extended, "CHARGES", [(0.3, 1.5), (0.8, 1.5), (0.6, 1.0), (0.6, 2.5)], "extended"),
    *weights(extended, "OWN", (0.0, 0.5, 1.5)),
    *weights(extended, "SHARED", (0.0, 0.5, 1.5)),
    *weights(moments, "WEIGHTS", (0.0, 0.5, 2.0)),
    *weights(fusion, "WEIGHTS", (0.0, 0.5, 2.0)),
    Choice(fusion, "NEAREST", [5, 15, 20], "fused"),
    Choice(fusion, "SHARE", [10, 20, 1000], "fused"),
    Choice(diffusion, "NEIGHBOURS", [5, 6, 7, 10, 12], "re-ranked"),
    Choice(diffusion, "NEAR", [0.45, 0.5, 0.6, 0.7], "re-ranked"),
    Choice(diffusion, "STEPS", [15, 31, 127], "re-ranked"),
]


class Labelled(NamedTuple):
    """A set: its surfaces, their labels, and the distances of the parts with the constants in use."""

    surfaces: list[Surface]
    labels: list[str]
    parts: dict[str, np.ndarray]


def matrix(one: Labelled, bears_on: str) -> np.ndarray:
    if bears_on in PARTS:
        return distances(one.surfaces, bears_on)
    fused = fused_matrix(one.parts)
    return fused if bears_on == "fused" else reranked_matrix(fused)


def distances(surfaces: list[Surface], name: str) -> np.ndarray:
    descriptor = descriptor_named(name)
    return descriptor.distances([descriptor.describe(surface) for surface in surfaces])


def precision(D: np.ndarray, labels: list[str], among: np.ndarray) -> float:
    chosen = [labels[i] for i in among]
    return float(evaluate(D[np.ix_(among, among)], chosen, bootstrap=0).overall["map"])


def with_value(choice: Choice, value: Any, compute: Callable[[], Any]) -> Any:
    own = getattr(choice.module, choice.name)
    setattr(choice.module, choice.name, value)
    try:
        return compute()
    finally:
        setattr(choice.module, choice.name, own)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    default = [name for name in ("articulated-a+rigid-a", "hires-a") if (DATA / name.partition("+")[0]).is_dir()]
    parser.add_argument("sets", nargs="*", default=default)
    parser.add_argument("--folds", type=int, default=4)
    parser.add_argument("--denoise", default="none")
    parser.add_argument("--only", nargs="*", default=["extended", "moments", "fused", "re-ranked"])
    options = parser.parse_args()
    sets = [labelled(name, Profile(denoise=options.denoise)) for name in options.sets]
    for name, one in zip(options.sets, sets, strict=True):
        if len(set(one.labels)) < 2 * options.folds:
            parser.error(f"{name} has {len(set(one.labels))} classes: {options.folds} folds of two or more need more.")
    for choice in CHOICES:
        if choice.bears_on in options.only:
            report(choice, sets, options.folds)


def labelled(name: str, profile: Profile) -> Labelled:
    labels, sources = (list(chain(*parts)) for parts in zip(*map(load, name.split("+")), strict=True))
    surfaces = [surface(source, profile) for source in sources]
    return Labelled(surfaces, labels, {part: distances(surfaces, part) for part in PARTS})


def surface(source: Path | Mesh, profile: Profile) -> Surface:
    return surface_of(describe(source, profile))


def report(choice: Choice, sets: list[Labelled], count: int) -> None:
    own = getattr(choice.module, choice.name)
    values = [own, *choice.values]
    found = [with_value(choice, value, lambda: [matrix(one, choice.bears_on) for one in sets]) for value in values]
    parts = [folds(one.labels, count) for one in sets]
    everywhere = [mean(of, sets, [np.arange(len(one.labels)) for one in sets]) for of in found]
    chosen, inside = [], []
    for fold in range(count):
        held = [part[fold] for part in parts]
        rest = [np.setdiff1d(np.arange(len(one.labels)), part) for one, part in zip(sets, held, strict=True)]
        best = int(np.argmax([mean(of, sets, rest) for of in found]))
        chosen.append(shown(values[best], own))
        inside.append((mean(found[0], sets, held), mean(found[best], sets, held)))
    print(f"{choice.bears_on}: {choice.name} {'' if isinstance(own, Mapping) else own}")
    scores = (f"{shown(value, own)}: {score:.4f}" for value, score in zip(values, everywhere, strict=True))
    print("   ", "  ".join(scores))
    in_use, picked = np.mean(inside, axis=0)
    print(f"    folds choose {', '.join(chosen)}; inside them {in_use:.4f} in use, {picked:.4f} chosen", flush=True)


def mean(found: list[np.ndarray], sets: list[Labelled], among: list[np.ndarray]) -> float:
    return float(np.mean([precision(D, one.labels, part) for D, one, part in zip(found, sets, among, strict=True)]))


def shown(value: Any, own: Any) -> str:
    if not isinstance(value, Mapping):
        return str(value)
    return next((f"{key} {value[key]:g}" for key in value if value[key] != own[key]), "in use")


if __name__ == "__main__":
    main()
