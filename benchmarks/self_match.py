"""Whether a disturbed copy still finds its original first: the rate, by disturbance and ranking.

    ./run python benchmarks/self_match.py [SET ...] [--copies 40] [--rankings srg extended fused re-ranked]
        [--only remeshed ...] [--profiles denoise=none denoise=none,operator=tufted] [--missed]

SET is a folder with labels.csv, or `synthetic`; by default articulated-a and rigid-a, looked for under $REEBASE_DATA or
../shared/data, where present, and the synthetic set. Every shape of the set is described; then `--copies` of them are
disturbed in each way of reebase/evaluation/disturb.py (decimated to half the vertices, noise of 0.2 mean edge lengths,
three copies in one file, ...), described as any mesh is, and looked up among the originals by a gallery, as the service
does: `re-ranked` is what a query gets that names no descriptor. Prints the share whose nearest shape is their
original, or one that the source holds with equal features. `--missed` names the others: the copy, the rank of its
original, and what came first. A descriptor that took poses of one animal for one another would fail here first.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from retrieval import DATA, load

from reebase.descriptors import descriptor_named, surface_of
from reebase.errors import ReebaseError
from reebase.evaluation.disturb import DISTURBANCES
from reebase.mesh import Mesh, clean, read
from reebase.pipeline import Profile, describe
from reebase.ranking import RANKINGS, Ranking, ranking_named
from reebase.search import Gallery

EQUAL = 1e-9
"""Dissimilarity between originals below which they are the same shape twice."""

RERANKED = "re-ranked"
Kept = Mapping[str, np.ndarray]


def ranking(name: str) -> Ranking:
    return ranking_named("fused", rerank=True) if name == RERANKED else ranking_named(name, rerank=False)


def profile_of(text: str) -> tuple[str, Profile]:
    """What differs from the default: parameter=value, several by commas."""
    changes = dict(one.split("=") for one in text.split(","))
    return text, Profile(**{name: type(getattr(Profile(), name))(value) for name, value in changes.items()})


def kept(mesh: Mesh, parts: list[str], profile: Profile) -> Kept | None:
    try:
        surface = surface_of(describe(mesh, profile))
        return {name: descriptor_named(name).describe(surface) for name in parts}
    except ReebaseError:
        return None


def main() -> None:
    default = [name for name in ("articulated-a", "rigid-a") if (DATA / name).is_dir()] + ["synthetic"]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", nargs="*", default=default)
    parser.add_argument("--copies", type=int, default=40)
    parser.add_argument("--rankings", nargs="+", default=["srg", "extended", "fused", RERANKED],
                        choices=[*RANKINGS, RERANKED])  # fmt: skip
    parser.add_argument("--only", nargs="+", default=list(DISTURBANCES), choices=list(DISTURBANCES))
    parser.add_argument("--profiles", nargs="+", type=profile_of, default=[("", Profile())])
    parser.add_argument("--missed", action="store_true")
    options = parser.parse_args()
    rankings = {name: ranking(name) for name in options.rankings}
    parts = sorted({part for one in rankings.values() for part in one.parts})
    titles, profiles = zip(*options.profiles, strict=True)
    for name in options.sets:
        _, sources = load(name)
        names = [one.name if isinstance(one, Path) else f"{name} {at}" for at, one in enumerate(sources)]
        meshes = [clean(read(source) if isinstance(source, Path) else source)[0] for source in sources]
        galleries, originals = [], []
        for profile in profiles:
            found = {str(at): kept(mesh, parts, profile) for at, mesh in enumerate(meshes)}
            known = {id: one for id, one in found.items() if one is not None}
            originals.append(known)
            galleries.append({
                which: Gallery(one).changed({id: {part: own[part] for part in one.parts} for id, own in known.items()})
                for which, one in rankings.items()
            })  # fmt: skip
        both = [id for id in originals[0] if all(id in one for one in originals)]
        chosen = both[:: max(1, len(both) // options.copies)]
        print(f"\n{name}: {len(chosen)} of {len(both)} shapes disturbed")
        columns = [f"{which} {title}".strip() for title in titles for which in rankings]
        print(f"{'':10s}", *(f"{column:>26s}" for column in columns), flush=True)
        for disturbance in options.only:
            ranks: list[list[int]] = [[] for _ in columns]
            missed = []
            for id in chosen:
                copy = DISTURBANCES[disturbance](meshes[int(id)], np.random.default_rng(int(id)))
                described = [kept(copy, parts, profile) for profile in profiles]
                for column, (profile, which) in enumerate((p, w) for p in range(len(profiles)) for w in rankings):
                    gallery = galleries[profile][which]
                    rank, first = looked_up(gallery, described[profile], id, originals[profile])
                    ranks[column].append(rank)
                    if rank > 0:
                        before = names[int(first)] if first else "refused"
                        missed.append((columns[column], names[int(id)], rank, before))
            shares = [np.mean(np.array(column) == 0) for column in ranks]
            print(f"{disturbance:10s}", *(f"{share:26.3f}" for share in shares), flush=True)
            for column, one, rank, before in missed if options.missed else []:
                print(f"    {column}: {one} at {rank + 1} after {before}", flush=True)


def looked_up(gallery: Gallery, query: Kept | None, id: str, originals: Mapping[str, Kept]) -> tuple[int, str]:
    """How many shapes come before the original, 0 where one equal to it is first; and the first."""
    if query is None:
        return len(gallery), ""
    asked = {part: query[part] for part in gallery.ranking.parts}
    found = gallery.rank(asked, again=gallery.ranking.rerank).dissimilarities
    first = gallery.ids[int(np.argmin(found))]
    equal = all(
        descriptor_named(part).compare(originals[id][part], originals[first][part], measure) <= EQUAL
        for part, measure in gallery.ranking.parts.items()
    )
    return (0 if equal else int((found < found[gallery.places[id]]).sum())), first


if __name__ == "__main__":
    main()
