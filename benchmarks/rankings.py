"""What a query costs in a collection of many shapes, by every ranking that is kept.

    ./run python benchmarks/rankings.py [--shapes 250 10000] [--rankings fused srg ...]

A database is filled with shapes whose descriptors are those of a few synthetic shapes with noise: what is measured is
the search, not the describing. Prints for each ranking the processor time of the first query of a process, which reads
what is kept and for `fused` measures the collection; the median of later ones by stored shapes; that of the first query
after one shape came; and the memory that the gallery holds.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from sqlalchemy import insert, update

from reebase.descriptors import DESCRIPTORS, kept, surface_of
from reebase.evaluation.synthetic import CLASSES, synthetic_shape
from reebase.pipeline import PIPELINE_VERSION, Profile, describe
from reebase.ranking import FUSED, RANKINGS, ranking_named
from store import collections, descriptors, migrate, revision, tables
from store.answers import answer_query
from store.engine import Database, sqlite_url
from store.follower import IndexFollower
from store.query import QuerySpec
from store.settings import Settings
from store.sql import new_id, now

NAMES = Settings().descriptors
QUERIES = 9


def originals() -> list[tuple[np.ndarray, dict[str, kept.Kept]]]:
    """Endpoint features and what is kept, of one shape of each class."""
    out = []
    for label in CLASSES:
        found = describe(synthetic_shape(label=label, index=0).mesh)
        out.append((found.features, kept.keep(surface_of(found), NAMES)[0]))
    return out


def fill(database: Database, count: int, seed: int = 0) -> list[str]:
    random = np.random.default_rng(seed)
    models = originals()
    key = Profile().key
    ids = [new_id() for _ in range(count)]
    with database.write() as conn:
        made = collections.create(conn, "many")
        for number, shape_id in enumerate(ids):
            features, own = models[number % len(models)]
            noisy = np.abs(features * (1 + 0.05 * random.normal(size=features.shape)))
            conn.execute(insert(tables.shape).values(
                id=shape_id, collection_id=made.id, sha256=f"{number:064x}", bytes=1, format="ply", name=str(number),
                label=CLASSES[number % len(models)], metadata={}, state="indexed", created_at=now(), updated_at=now(),
            ))  # fmt: skip
            conn.execute(insert(tables.endpoint_features).values(
                shape_id=shape_id, collection_id=made.id, profile_key=key, pipeline_version=PIPELINE_VERSION,
                endpoint_count=len(noisy), features=noisy.astype("<f8").tobytes(), revision=revision.bump(conn),
            ))  # fmt: skip
            noise = {name: np.float32(1 + 0.05 * random.normal(size=one.values.shape)) for name, one in own.items()}
            noisy_own = {name: kept.Kept(one.values * noise[name], one.places) for name, one in own.items()}
            descriptors.write(conn, shape_id, key, noisy_own)
    return ids


def measured(database: Database, ids: list[str], name: str) -> str:
    ranking = ranking_named(name)
    follower = IndexFollower(database)
    random = np.random.default_rng(1)

    def ask(shape_id: str) -> float:
        start = time.process_time()
        answer_query(database, follower, QuerySpec(
            "many", shape_id, tolerance=2 if name == "srg" else None, descriptor=name, rerank=ranking.rerank,
        ))  # fmt: skip
        return 1000 * (time.process_time() - start)

    first = ask(ids[0])
    later = [ask(ids[place]) for place in random.integers(0, len(ids), QUERIES)]
    with database.write() as conn:
        rows = tables.endpoint_features
        conn.execute(update(rows).where(rows.c.shape_id == ids[-1]).values(revision=revision.bump(conn)))
    after = ask(ids[1])
    with database.read() as conn:
        collection = collections.get(conn, "many")
    held = 0 if name == "srg" else follower.gallery(collection.id, collection.profile_key, ranking).gallery.bytes
    return f"{name:10s} {first:10.0f} {np.median(later):10.1f} {after:10.1f} {held / 1e6:10.1f}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shapes", nargs="+", type=int, default=[250, 10_000])
    known = [name for name in RANKINGS if name in (FUSED, "srg", *NAMES) and name in (FUSED, *DESCRIPTORS)]
    parser.add_argument("--rankings", nargs="+", default=known, choices=known)
    options = parser.parse_args()
    for count in options.shapes:
        with tempfile.TemporaryDirectory() as folder:
            url = sqlite_url(Path(folder) / "many.sqlite")
            migrate.upgrade(url)
            database = Database(url)
            ids = fill(database, count)
            print(f"\n{count} shapes", "first ms", "later ms", "after one came", "MB held", sep="   ")
            for name in options.rankings:
                print(measured(database, ids, name), flush=True)
            database.close()


if __name__ == "__main__":
    main()
