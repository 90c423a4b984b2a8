"""Results that round-trip, an index that follows them, and answers that equal a slow obvious search."""

from __future__ import annotations

import json
import random
import threading
from collections.abc import Callable

import numpy as np
import pytest
from sqlalchemy.exc import IntegrityError

from reebase.descriptors import Kept
from reebase.errors import UnknownName
from reebase.matching import dissimilarity
from reebase.pipeline import PIPELINE_VERSION, Profile
from reebase.search import Index
from store import collections, descriptors, results, revision, shapes, sweep, tasks
from store.answers import answer_query
from store.blobs import MemoryBlobs
from store.engine import Database
from store.errors import CollectionNotFound, ProfileChanged, ResultNotFound, ShapeNotFound
from store.follower import IndexFollower
from store.query import Query, QuerySpec
from store.records import Collection, Shape, Task
from store.settings import Settings
from tests.unit.store.descriptions import description

Upload = Callable[..., tuple[Shape, Task]]
Describe = Callable[..., Task]
SHA = "e" * 64


@pytest.fixture
def describe(database: Database, queue: tasks.DatabaseQueue) -> Describe:
    """Ends the oldest task with these features."""

    def described(features: np.ndarray, profile: Profile | None = None) -> Task:
        task = queue.claim("w")
        assert task is not None
        found = description(features, profile)
        with database.write() as conn:
            return results.store_description(
                conn, task, found, cleaned_sha256=SHA, denoised_sha256=SHA,
                kept={"shape_dna": Kept(np.float32(found.eigenvalues[None]))},
            )  # fmt: skip

    return described


def omega(seed: int, count: int = 4) -> np.ndarray:
    return np.random.default_rng(seed).random((count, 3))


def mesh(seed: int, count: int = 4, profile: Profile | None = None) -> Query:
    return Query.of(description(omega(seed, count), profile))


def test_everything_round_trips(database: Database, upload: Upload, describe: Describe) -> None:
    shape, _ = upload()
    task = describe(omega(1))
    expected = description(omega(1))
    with database.read() as conn:
        features = results.features(conn, shape.id)
        skeleton = results.skeleton(conn, shape.id)
        health = results.health(conn, shape.id)
        kept = descriptors.of_shapes(conn, [shape.id], ["shape_dna", "hks"], Profile().key)
        after = shapes.get(conn, shape.collection_id, shape.id)
    assert np.array_equal(features.features, expected.features)
    assert (features.endpoint_count, features.profile_key) == (4, Profile().key)
    assert features.pipeline_version == PIPELINE_VERSION
    for name in ("positions", "areas", "ring_areas", "bands", "edges", "lengths", "endpoints", "root"):
        found, given = getattr(skeleton.skeleton, name), getattr(expected.skeleton, name)
        assert np.array_equal(found, given)
        assert np.asarray(found).dtype == np.asarray(given).dtype
    assert np.array_equal(skeleton.eigenvalues, expected.eigenvalues)
    assert (skeleton.cleaned_sha256, skeleton.denoised_sha256) == (SHA, SHA)
    assert (health.report, health.seconds) == (expected.health, expected.seconds)
    assert list(kept[shape.id]) == ["shape_dna"]
    assert np.array_equal(kept[shape.id]["shape_dna"].values, expected.eigenvalues[None].astype(np.float32))
    assert (after.state, after.endpoint_count, after.flags) == ("indexed", 4, ("open_surface",))
    assert task.result == {"endpoint_count": 4, "flags": ["open_surface"]}


def test_a_shape_without_endpoints_is_a_result(
    database: Database, collection: Collection, upload: Upload, describe: Describe
) -> None:
    shape, _ = upload()
    describe(np.empty((0, 3)))
    with database.read() as conn:
        assert results.features(conn, shape.id).features.shape == (0, 3)
        assert collections.counts(conn, collection.id).by_endpoint_count == {0: 1}


def test_before_there_are_results(database: Database, queue: tasks.DatabaseQueue, upload: Upload) -> None:
    shape, _ = upload()
    with database.read() as conn:
        for read in (results.features, results.skeleton, results.health):
            with pytest.raises(ResultNotFound, match="waits to be described"):
                read(conn, shape.id)
    task = queue.claim("w")
    assert task is not None
    queue.heartbeat(task, "eigenpairs", 0.5)
    with database.write() as conn:
        with pytest.raises(ResultNotFound, match=r"still being described \(stage eigenpairs\)"):
            results.features(conn, shape.id)
        tasks.fail(conn, task, "no_faces", {"message": "No faces.", "found": 0})
        with pytest.raises(ResultNotFound, match=r"could not be described: No faces\.") as failed:
            results.skeleton(conn, shape.id)
    error = {"code": "no_faces", "detail": "No faces.", "details": {"found": 0}}
    assert failed.value.details == {"shape": shape.id, "state": "failed", "task": task.id, "error": error}


def test_features_that_do_not_fit_their_count_are_refused(
    database: Database, upload: Upload, describe: Describe
) -> None:
    upload()
    describe(omega(1))
    with pytest.raises(IntegrityError, match="endpoint_features_size"), database.write() as conn:
        conn.exec_driver_sql("UPDATE endpoint_features SET endpoint_count = 3")


def test_labelled(
    database: Database, collection: Collection, upload: Upload, describe: Describe
) -> None:
    one, _ = upload(label="ants", name="first")
    upload()
    upload(label="ants")
    three, _ = upload(label="bees", name="last")
    for seed in range(2):
        describe(omega(seed))
    describe(omega(2), Profile(bands=17))
    describe(omega(3, 2))
    with database.read() as conn:
        found = results.labelled(conn, collection.id, collection.profile_key)
    assert (found.ids, found.names) == ([one.id, three.id], ["first", "last"])
    assert found.labels == ["ants", "bees"]
    assert [len(features) for features in found.kept["srg"]] == [4, 2]
    assert np.array_equal(found.kept["srg"][1], omega(3, 2))


def contents(index: Index, ids: list[str]) -> dict[str, bytes]:
    return {name: index.features_of(name).tobytes() for name in ids if name in index}


@pytest.mark.parametrize("seed", range(3))
def test_the_index_equals_a_fresh_one_after_any_history(
    seed: int, database: Database, queue: tasks.DatabaseQueue, collection: Collection, upload: Upload,
    describe: Describe, settings: Settings,
) -> None:  # fmt: skip
    """Adds, deletes, re-describes, profile changes and sweeps in random order, looked at in between."""
    dice = random.Random(seed)
    followers = [IndexFollower(database), IndexFollower(database)]
    eager = settings.model_copy(update={"keep_tombstones_seconds": 0.0})
    made: list[str] = []
    bands = 64
    for step in range(60):
        what = dice.choice(["add", "add", "add", "delete", "again", "profile", "sweep", "look"])
        with database.read() as conn:
            present = sorted(shapes.by_ids(conn, made))
            profile = Profile(bands=bands)
        if what == "add":
            made.append(upload()[0].id)
            describe(omega(step, dice.randint(0, 5)), profile)
        elif what == "delete" and present:
            with database.write() as conn:
                shapes.delete(conn, collection.id, dice.choice(present))
        elif what == "again" and present:
            with database.write() as conn:
                tasks.enqueue(
                    conn, "describe", collection_id=collection.id, shape_id=dice.choice(present)
                )
            describe(omega(step, dice.randint(0, 5)), profile)
        elif what == "profile" and dice.random() < 0.5:
            bands = dice.randint(2, 100)
            with database.write() as conn:
                collections.update(conn, "ants", profile={"bands": bands})
            for _ in range(dice.randint(0, len(present))):
                describe(omega(step, 2), Profile(bands=bands))
            with database.write() as conn:
                tasks.cancel_live(conn, collection_id=collection.id)
        elif what == "sweep":
            sweep.sweep(database, MemoryBlobs(), eager)
        # One follower looks at every step, the other now and then.
        for follower in followers[: 2 if what == "look" else 1]:
            key = Profile(bands=bands).key
            fresh = IndexFollower(database).index(collection.id, key)
            assert contents(follower.index(collection.id, key), made) == contents(fresh, made)
            assert len(follower.index(collection.id, key)) == len(fresh)
    assert queue.claim("w") is None


def test_a_follower_that_is_up_to_date_keeps_its_index(
    database: Database, collection: Collection, upload: Upload, describe: Describe
) -> None:
    upload()
    describe(omega(1))
    follower = IndexFollower(database)
    index = follower.index(collection.id, collection.profile_key)
    upload()
    describe(omega(2))
    assert follower.index(collection.id, collection.profile_key) is index
    assert len(index) == 2
    with database.write() as conn:
        collections.delete(conn, "ants")
    with pytest.raises(CollectionNotFound):
        follower.index(collection.id, collection.profile_key)


def test_many_threads_ask_while_shapes_arrive(
    database: Database, collection: Collection, upload: Upload, describe: Describe
) -> None:
    follower = IndexFollower(database)
    failures: list[BaseException] = []
    stop = threading.Event()

    def ask() -> None:
        try:
            while not stop.is_set():
                answer_query(database, follower, QuerySpec("ants", k=3, tolerance=None), mesh(0))
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=ask) for _ in range(3)]
    for thread in threads:
        thread.start()
    made = []
    for seed in range(15):
        made.append(upload()[0].id)
        describe(omega(seed, 1 + seed % 4))
        if seed % 5 == 4:
            with database.write() as conn:
                shapes.delete(conn, collection.id, made.pop(0))
    stop.set()
    for thread in threads:
        thread.join()
    assert failures == []
    assert len(follower.index(collection.id, collection.profile_key)) == 12


@pytest.fixture
def ants(upload: Upload, describe: Describe) -> list[Shape]:
    """Twelve shapes of 3 to 5 endpoints; every second is red."""
    made = []
    for seed in range(12):
        tags = ["red"] if seed % 2 else []
        made.append(upload(label="ants" if seed < 6 else "bees", tags=tags, metadata={"n": seed})[0])
        describe(omega(seed, 3 + seed % 3))
    return made


def test_an_answer_equals_a_slow_search(database: Database, ants: list[Shape]) -> None:
    follower = IndexFollower(database)
    query = ants[4]
    answer = answer_query(database, follower, QuerySpec("ants", query.id, k=5, tolerance=1))
    slow = sorted(
        (dissimilarity(omega(4, 4), omega(seed, 3 + seed % 3)), shape.id)
        for seed, shape in enumerate(ants)
        if seed != 4
    )
    assert [(hit["dissimilarity"], hit["shape"]["id"]) for hit in answer["hits"]] == slow[:5]
    assert [hit["rank"] for hit in answer["hits"]] == [1, 2, 3, 4, 5]
    assert answer["query"]["shape"] == query.id
    assert answer["query"]["features"] == omega(4, 4).tolist()
    assert answer["query"]["flags"] == ["open_surface"]
    assert answer["considered"] == 11
    assert answer["buckets"] == [
        {"endpoint_count": 3, "shapes": 4}, {"endpoint_count": 4, "shapes": 3},
        {"endpoint_count": 5, "shapes": 4},
    ]  # fmt: skip
    for hit in answer["hits"]:
        parts = [*hit["pairs"], *hit["unmatched_query"], *hit["unmatched_hit"]]
        total = sum(part.get("distance", part.get("charge")) for part in parts)
        assert total == pytest.approx(hit["dissimilarity"], abs=1e-12)
        assert len(hit["pairs"]) == min(4, hit["endpoint_count"])
    assert json.loads(json.dumps(answer, allow_nan=False)) == answer


def test_a_stored_shape_is_not_its_own_hit_unless_asked(database: Database, ants: list[Shape]) -> None:
    follower = IndexFollower(database)
    for spec in (
        QuerySpec("ants", ants[0].id, k=100, tolerance=None),
        QuerySpec("ants", ants[0].id, k=100, tolerance=None, label="ants"),
    ):
        ids = {hit["shape"]["id"] for hit in answer_query(database, follower, spec)["hits"]}
        assert ants[0].id not in ids
        assert len(ids) == (11 if spec.label is None else 5)
    first = answer_query(database, follower, QuerySpec("ants", ants[0].id, include_self=True))["hits"][0]
    assert (first["shape"]["id"], first["dissimilarity"]) == (ants[0].id, 0.0)
    by_mesh = answer_query(database, follower, QuerySpec("ants"), mesh(0, 3))
    assert by_mesh["query"]["shape"] is None
    assert by_mesh["hits"][0]["shape"]["id"] == ants[0].id


def test_filters_and_bounds(database: Database, ants: list[Shape]) -> None:
    follower = IndexFollower(database)

    def ids(**asked: object) -> set[str]:
        spec = QuerySpec("ants", tolerance=None, k=100, **asked)  # type: ignore[arg-type]
        answer = answer_query(database, follower, spec, mesh(3, 3))
        if spec.max_dissimilarity is None:
            assert answer["considered"] == len(answer["hits"])
        return {hit["shape"]["id"] for hit in answer["hits"]}

    assert ids(label="bees") == {shape.id for shape in ants[6:]}
    assert ids(tags=("red",), label="bees") == {shape.id for shape in ants[7::2]}
    assert ids(metadata={"n": 3}) == {ants[3].id}
    assert ids(max_dissimilarity=1e-12) == {ants[3].id}
    assert ids(label="wasps") == set()
    for measure in ("matching", "matching_mean", "greedy", "literal"):
        assert len(ids(measure=measure)) == 12


def test_what_cannot_be_answered(
    database: Database, ants: list[Shape], upload: Upload, describe: Describe
) -> None:
    follower = IndexFollower(database)
    waiting, _ = upload()
    for spec, error in (
        (QuerySpec("wasps"), CollectionNotFound),
        (QuerySpec("ants", "nobody"), ShapeNotFound),
        (QuerySpec("ants", waiting.id), ResultNotFound),
        (QuerySpec("ants", ants[0].id, measure="guess"), UnknownName),
    ):
        with pytest.raises(error):
            answer_query(database, follower, spec, mesh(0))
    with pytest.raises(ValueError, match="stored shape or a described mesh"):
        answer_query(database, follower, QuerySpec("ants"))
    with database.write() as conn:
        collections.update(conn, "ants", profile={"bands": 17})
    with pytest.raises(ResultNotFound, match="present profile"):
        answer_query(database, follower, QuerySpec("ants", ants[0].id))
    with pytest.raises(ProfileChanged):
        answer_query(database, follower, QuerySpec("ants"), mesh(0))
    described = mesh(0, profile=Profile(bands=17))
    assert answer_query(database, follower, QuerySpec("ants"), described)["considered"] == 0


def test_a_spec_survives_a_task(database: Database) -> None:
    spec = QuerySpec("ants", None, 3, None, "greedy", "x", ("a", "b"), {"y": 1}, 0.5)
    with database.write() as conn:
        task = tasks.enqueue(conn, "query", params={**spec.to_params(), "format": "ply"}, blob=SHA)
    assert QuerySpec.from_params(task.params) == spec


def test_revisions_rise_one_by_one(database: Database, upload: Upload, describe: Describe) -> None:
    for expected in range(1, 4):
        upload()
        describe(omega(expected))
        with database.read() as conn:
            assert revision.current(conn) == expected
