"""Whether a disturbed copy still finds its original first: the rate, by disturbance and descriptor.

    ./run python benchmarks/self_match.py [SET ...] [--copies 40] [--descriptors srg extended] [--denoise none]

SET is a folder with labels.csv, or `synthetic`; by default articulated-a and rigid-a, looked for under $REEBASE_DATA or
../shared/data, where present, and the synthetic set. Every shape of the set is described; then `--copies` of them are
disturbed in each way of reebase/evaluation/disturb.py (decimated to half the vertices, noise of 0.2 mean edge lengths,
three copies in one file, ...), described as any mesh is, and looked up among the originals by the descriptor's first
measure. Prints the share whose nearest shape is their original, or one that the source holds with equal features. A
descriptor that took poses of one animal for one another would fail here first.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from retrieval import DATA, load

from reebase.descriptors import DESCRIPTORS, descriptor_named, surface_of
from reebase.errors import ReebaseError
from reebase.evaluation.disturb import DISTURBANCES
from reebase.mesh import Mesh, clean, read
from reebase.pipeline import Profile, describe

EQUAL = 1e-9
"""Dissimilarity between originals below which they are the same shape twice."""


def kept(mesh: Mesh, names: list[str], profile: Profile) -> dict[str, np.ndarray] | None:
    try:
        surface = surface_of(describe(mesh, profile))
        return {name: descriptor_named(name).describe(surface) for name in names}
    except ReebaseError:
        return None


def main() -> None:
    default = [name for name in ("articulated-a", "rigid-a") if (DATA / name).is_dir()] + ["synthetic"]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", default=default)
    parser.add_argument("--copies", type=int, default=40)
    parser.add_argument("--descriptors", nargs="+", default=["srg", "extended"], choices=list(DESCRIPTORS))
    parser.add_argument("--denoise", default=Profile().denoise)
    options = parser.parse_args()
    profile = Profile(denoise=options.denoise)
    for name in options.sets:
        _, sources = load(name)
        meshes = [clean(read(source) if isinstance(source, Path) else source)[0] for source in sources]
        originals = [kept(mesh, options.descriptors, profile) for mesh in meshes]
        known = [at for at, one in enumerate(originals) if one is not None]
        chosen = known[:: max(1, len(known) // options.copies)]
        print(f"\n{name}: {len(chosen)} of {len(known)} shapes disturbed, denoise {options.denoise}", flush=True)
        print(f"{'':12s}", *(f"{which:>10s}" for which in options.descriptors))
        for disturbance, disturb in DISTURBANCES.items():
            copies = [
                (at, kept(disturb(meshes[at], np.random.default_rng(at)), options.descriptors, profile))
                for at in chosen
            ]
            rates = [rate(which, originals, known, copies) for which in options.descriptors]
            print(f"{disturbance:12s}", *(f"{one:10.3f}" for one in rates), flush=True)


def rate(
    which: str, originals: list[dict[str, np.ndarray] | None], known: list[int],
    copies: list[tuple[int, dict[str, np.ndarray] | None]],
) -> float:  # fmt: skip
    """Share of the copies whose nearest original is their own; one that could not be described found nothing."""
    gallery = [originals[at][which] for at in known]
    found = 0
    for at, copy in copies:
        if copy is not None:
            nearest = int(np.argmin(descriptor_named(which).distances_to(copy[which], gallery)))
            own = descriptor_named(which).compare(originals[at][which], gallery[nearest])
            found += known[nearest] == at or own <= EQUAL
    return found / len(copies)


if __name__ == "__main__":
    main()
