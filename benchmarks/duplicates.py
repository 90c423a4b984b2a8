"""The search for duplicates: how often two different shapes are taken for one, and how often each kind of copy is seen.

    ./run python benchmarks/duplicates.py [SET ...] [--copies 40] [--only different|copies]

SET is a folder with labels.csv, or `synthetic`; by default articulated-a and rigid-a, looked for under $REEBASE_DATA or
../shared/data, where present, and the synthetic set. Prints the pairs of different shapes, how many of them are
candidates, and how many are found, by confidence (pairs with equal bytes, which the sources hold a few of, are left out
and counted); each that is found is named, to be looked at. Then, of `--copies` shapes, each disturbed in each way and
put beside its original: the share that is a candidate, that is found, and that is found with the right words for what
was done; and the median time of a signature and of a comparison.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import itertools
import time
from collections import Counter
from pathlib import Path

import numpy as np
from retrieval import DATA

from reebase.duplicates import Shape, candidates, compared, find_duplicates, signature
from reebase.duplicates.alignment import Surface
from reebase.duplicates.find import REACH
from reebase.duplicates.findings import finding_of
from reebase.evaluation.disturb import DISTURBANCES
from reebase.evaluation.synthetic import synthetic_set
from reebase.mesh import Mesh, clean, read

EXPECTED: dict[str, set[str]] = {
    "exported": {"same_mesh"}, "shuffled": {"same_mesh"}, "moved": {"same_mesh", "moved"},
    "in_inches": {"same_mesh", "rescaled"}, "rescaled": {"same_mesh", "rescaled"},
    "mirrored": {"same_mesh", "mirrored", "moved"}, "remeshed": {"remeshed", "moved"},
    "decimated": {"decimated", "moved"}, "noisy": {"noisy", "moved"}, "copies": {"same_mesh", "copies"},
}  # fmt: skip
"""What a finding must say of each disturbance, and nothing else."""


def load(name: str) -> list[tuple[str, Mesh, str]]:
    """Name, cleaned mesh and digest of each shape of a set."""
    if name == "synthetic":
        return [(shape.name, clean(shape.mesh)[0], shape.name) for shape in synthetic_set(per_class=10)]
    folder = Path(name) if Path(name).is_dir() else DATA / name
    with (folder / "labels.csv").open(newline="") as lines:
        files = [row["file"] for row in csv.DictReader(lines)]
    digest = [hashlib.sha256((folder / file).read_bytes()).hexdigest() for file in files]
    return [(file, clean(read(folder / file))[0], one) for file, one in zip(files, digest, strict=True)]


def different(shapes: list[tuple[str, Mesh, str]]) -> None:
    start = time.perf_counter()
    signatures = np.array([signature(mesh) for _, mesh, _ in shapes])
    each = (time.perf_counter() - start) / len(shapes)
    surfaces = [Surface(mesh) for _, mesh, _ in shapes]
    pairs = [one for one in candidates(signatures) if one.parts == (False, False)]
    equal = sum(a[2] == b[2] for a, b in itertools.combinations(shapes, 2))
    found: Counter[str] = Counter()
    seconds = []
    for pair in pairs:
        if shapes[pair.first][2] == shapes[pair.second][2]:
            continue
        begun = time.perf_counter()
        evidence = compared(surfaces[pair.first], surfaces[pair.second])
        seconds.append(time.perf_counter() - begun)
        if evidence is not None:
            one = finding_of(shapes[pair.first][0], shapes[pair.second][0], evidence, surfaces[pair.second].size)
            found[one.confidence] += 1
            print(f"    {one.confidence}: {one.words} (signatures {pair.distance:.4f} apart)", flush=True)
    count = len(shapes) * (len(shapes) - 1) // 2 - equal
    print(
        f"  {count} pairs of different files ({equal} with equal bytes left out), {len(pairs)} candidates; found "
        f"{dict(found)}: {sum(found.values()) / count:.5%} of the pairs; "
        f"signature {1000 * each:.1f} ms, comparison {1000 * np.median(seconds):.0f} ms",
        flush=True,
    )


def copies(shapes: list[tuple[str, Mesh, str]], count: int) -> None:
    chosen = shapes[:: max(1, len(shapes) // count)]
    print(f"  {len(chosen)} shapes, each disturbed in each way: candidate / found / told as what it is")
    for name, disturb in DISTURBANCES.items():
        near = seen = right = 0
        wrong: Counter[str] = Counter()
        for number, (_, mesh, _) in enumerate(chosen):
            copy = clean(disturb(mesh, np.random.default_rng(number)))[0]
            pair = [Shape.of("original", mesh), Shape.of("copy", copy)]
            near += any(True for _ in candidates(np.array([one.signature for one in pair]), REACH))
            # A file of copies is also a finding of its own.
            findings = [one for one in find_duplicates(pair) if one.first != one.second]
            seen += bool(findings)
            said = set(findings[0].classes) if findings else set()
            right += said == EXPECTED[name]
            if findings and said != EXPECTED[name]:
                unsure = findings[0].evidence is not None and findings[0].evidence.mirrored is None
                wrong[" ".join(findings[0].classes) + (" (mirror image alike)" if unsure else "")] += 1
        share = [f"{one / len(chosen):.3f}" for one in (near, seen, right)]
        print(f"    {name:10s} {' / '.join(share)}  {dict(wrong) or ''}", flush=True)


def main() -> None:
    default = [name for name in ("articulated-a", "rigid-a") if (DATA / name).is_dir()] + ["synthetic"]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", default=default)
    parser.add_argument("--copies", type=int, default=40)
    parser.add_argument("--only", choices=("different", "copies"))
    options = parser.parse_args()
    for name in options.sets:
        shapes = load(name)
        print(f"{name}: {len(shapes)} shapes", flush=True)
        if options.only != "copies":
            different(shapes)
        if options.only != "different":
            copies(shapes, options.copies)


if __name__ == "__main__":
    main()
