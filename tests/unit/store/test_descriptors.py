"""What descriptors keep: rows that round-trip by version, galleries that follow them, and who lacks some."""

from __future__ import annotations

import random
import threading
from collections.abc import Callable

import numpy as np
import pytest
from pydantic import ValidationError

from reebase.descriptors import DESCRIPTORS, Kept
from reebase.pipeline import Profile
from reebase.ranking import FUSED, PARTS, ranking_named
from store import collections, descriptors, results, shapes, sweep, tasks
from store.answers import answer_query
from store.blobs import MemoryBlobs
from store.engine import Database
from store.errors import NothingToCompare, ResultNotFound
from store.follower import IndexFollower
from store.query import QuerySpec
from store.records import Collection, Shape, Task
from store.settings import Settings
from tests.unit.store.descriptions import description

Upload = Callable[..., tuple[Shape, Task]]
SHA = "e" * 64
RANKINGS = (ranking_named(FUSED), ranking_named("hks"), ranking_named("extended"))


def kept(seed: int, names: tuple[str, ...] = PARTS) -> dict[str, Kept]:
    """Something for each descriptor; shapes with seeds that differ by a multiple of 3 are alike."""
    dice = np.random.default_rng(seed)
    found = {}
    for name in names:
        explained = DESCRIPTORS[name].comparison.explain is not None
        rows, width = (36, 100) if name == "views" else (dice.integers(2, 5) if explained else 1, 6)
        values = np.abs(seed % 3 + 0.1 * dice.random((rows, width))).astype(np.float32)
        found[name] = Kept(values, dice.random((rows, 3)).astype(np.float32) if explained else None)
    return found


@pytest.fixture
def describe(database: Database, queue: tasks.DatabaseQueue) -> Callable[..., Task]:
    """Ends the oldest task with what is kept of this seed."""

    def described(seed: int, names: tuple[str, ...] = (*PARTS, "hks"), profile: Profile | None = None) -> Task:
        task = queue.claim("w")
        assert task is not None
        found = description(np.random.default_rng(seed).random((2 + seed % 3, 3)), profile)
        with database.write() as conn:
            return results.store_description(
                conn, task, found, cleaned_sha256=SHA, denoised_sha256=SHA, kept=kept(seed, names),
                refused={} if "hks" in names else {"hks": {"code": "x", "detail": "y"}},
            )  # fmt: skip

    return described


def test_rows_round_trip(
    database: Database, collection: Collection, upload: Upload, describe: Callable[..., Task]
) -> None:
    shape, _ = upload()
    task = describe(4, ("extended", "views"))
    assert task.result is not None
    assert task.result["without"] == {"hks": {"code": "x", "detail": "y"}}
    with database.read() as conn:
        found = descriptors.of_shapes(conn, [shape.id], DESCRIPTORS, collection.profile_key)
        assert descriptors.of_shapes(conn, [shape.id], ["extended"], "another") == {}
        assert descriptors.names_of(conn, shape.id) == {"extended", "views"}
    assert found.keys() == {shape.id}
    for name, one in kept(4, ("extended", "views")).items():
        np.testing.assert_array_equal(found[shape.id][name].values, one.values)
        assert found[shape.id][name].values.dtype == np.float32
        np.testing.assert_equal(found[shape.id][name].places, one.places)


def test_a_row_of_another_version_is_not_read(
    database: Database,
    collection: Collection,
    upload: Upload,
    describe: Callable[..., Task],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    import dataclasses

    from reebase.descriptors import registry

    shape, _ = upload()
    describe(1)
    newer = dataclasses.replace(DESCRIPTORS["hks"], version=DESCRIPTORS["hks"].version + 1)
    monkeypatch.setattr(registry, "DESCRIPTORS", {**DESCRIPTORS, "hks": newer})
    with database.read() as conn:
        found = descriptors.of_shapes(conn, [shape.id], ["hks", "wks"], collection.profile_key)
        assert list(found[shape.id]) == ["wks"]
        assert descriptors.lacking(conn, collection, ["wks"]) == []
        assert descriptors.lacking(conn, collection, ["hks", "wks"]) == [shape.id]
        with pytest.raises(NothingToCompare, match="hks"):
            descriptors.check_any(conn, collection, ["hks"])


def test_who_lacks_what(
    database: Database, collection: Collection, upload: Upload, describe: Callable[..., Task]
) -> None:
    whole, _ = upload(label="a")
    describe(0)
    part, _ = upload(label="a", name="part")
    describe(1, ("extended",))
    upload(label="a")  # is never described
    with database.read() as conn:
        counts = descriptors.coverage(conn, collection, ["srg", "extended", "hks", "d2"])
        assert counts == {"srg": 2, "extended": 2, "hks": 1, "d2": 0}
        assert descriptors.lacking(conn, collection, ["srg", "extended", "hks"]) == [part.id]
        assert descriptors.lacking(conn, collection, ["srg"]) == []
        found = results.labelled(conn, collection.id, collection.profile_key, ("srg", "hks"))
        assert (found.ids, found.lacking) == ([whole.id], ["part"])
        assert [len(found.kept[name]) for name in ("srg", "hks")] == [1, 1]
    with database.write() as conn:
        assert tasks.describe_anew(conn, collection.id, {part.id}, {"descriptors": ["d2"]}) == 1
        # One that waits is not queued twice.
        assert descriptors.lacking(conn, collection, ["hks"]) == []
        assert shapes.get(conn, collection.id, part.id).state == "queued"
        assert shapes.get(conn, collection.id, whole.id).state == "indexed"


def contents(follower: IndexFollower, collection: Collection, key: str) -> list[object]:
    found: list[object] = []
    for ranking in RANKINGS:
        hung = follower.gallery(collection.id, key, ranking)
        asked = {name: one.values for name, one in kept(0, tuple(ranking.parts)).items()}
        ranked = hung.gallery.rank(asked, again=ranking.rerank)
        found += [hung.gallery.ids, hung.lacking, ranked.dissimilarities.tolist()]
    return found


@pytest.mark.parametrize("seed", range(2))
def test_a_gallery_equals_a_fresh_one_after_any_history(
    seed: int,
    database: Database,
    collection: Collection,
    upload: Upload,
    describe: Callable[..., Task],
    settings: Settings,
) -> None:
    """Adds, deletes, restores, re-descriptions with more and less, profiles and sweeps, looked at in between."""
    dice = random.Random(seed)
    follower, small = IndexFollower(database), IndexFollower(database, memory_bytes=1)
    eager = settings.model_copy(update={"keep_tombstones_seconds": 0.0})
    made: list[str] = []
    profile = Profile()
    for step in range(50):
        what = dice.choice(["add", "add", "add", "delete", "restore", "again", "profile", "sweep"])
        names = dice.choice([(*PARTS, "hks"), PARTS, ("hks",), ()])
        with database.write() as conn:
            present = sorted(shapes.by_ids(conn, made))
            if what == "delete" and present:
                shapes.delete(conn, collection.id, dice.choice(present))
            elif what == "restore" and made:
                shapes.restore(conn, collection.id, dice.choice(made))
                tasks.cancel_live(conn, collection_id=collection.id)
            elif what == "again" and present:
                tasks.enqueue(conn, "describe", collection_id=collection.id, shape_id=dice.choice(present))
            elif what == "profile" and dice.random() < 0.3:
                profile = Profile(bands=dice.randint(2, 100))
                collections.update(conn, "ants", profile={"bands": profile.bands})
                tasks.cancel_live(conn, collection_id=collection.id)
        if what == "add":
            made.append(upload()[0].id)
        if what in ("add", "again") and (what == "add" or present):
            describe(step, names, profile)
        if what == "sweep":
            sweep.sweep(database, MemoryBlobs(), eager)
        expected = contents(IndexFollower(database), collection, profile.key)
        assert contents(follower, collection, profile.key) == expected
        assert contents(small, collection, profile.key) == expected


def test_memory_is_bounded_by_what_was_asked_for_last(
    database: Database, collection: Collection, upload: Upload, describe: Callable[..., Task]
) -> None:
    for seed in range(6):
        upload()
        describe(seed)
    follower = IndexFollower(database)
    sizes = {one: follower.gallery(collection.id, collection.profile_key, one).gallery.bytes for one in RANKINGS}
    follower = IndexFollower(database, memory_bytes=sizes[RANKINGS[0]] + sizes[RANKINGS[1]])

    def held() -> set[str]:
        return {key[1].name for key, one in follower._followed.items() if key[1] is not None and one is not None}

    for ranking, expected in zip(RANKINGS, ({"fused"}, {"fused", "hks"}, {"hks", "extended"}), strict=True):
        follower.gallery(collection.id, collection.profile_key, ranking)
        assert held() == expected
    # One that is larger than all that is allowed is still searched.
    tiny = IndexFollower(database, memory_bytes=1)
    assert len(tiny.gallery(collection.id, collection.profile_key, RANKINGS[0]).gallery) == 6


def test_what_queries_will_need_is_read_ahead_while_it_fits(
    database: Database, collection: Collection, upload: Upload, describe: Callable[..., Task]
) -> None:
    for seed in range(3):
        upload()
        describe(seed)

    def read(memory_bytes: int, *, stopped: bool = False) -> list[int]:
        follower, stopping = IndexFollower(database, memory_bytes), threading.Event()
        if stopped:
            stopping.set()
        follower.read_ahead(RANKINGS[0], stopping)
        return [len(one.held.gallery) for key, one in follower._followed.items() if key[1] is not None]

    assert read(1 << 30) == [3]
    assert read(1 << 30, stopped=True) == []
    assert read(1000) == []


def test_many_threads_rank_while_shapes_arrive(
    database: Database, collection: Collection, upload: Upload, describe: Callable[..., Task]
) -> None:
    first, _ = upload()
    describe(0)
    follower = IndexFollower(database)
    failures: list[BaseException] = []
    stop = threading.Event()

    def ask() -> None:
        try:
            while not stop.is_set():
                answer = answer_query(
                    database, follower, QuerySpec("ants", first.id, k=3, tolerance=None, descriptor=FUSED)
                )
                assert all(hit["shape"]["id"] != first.id for hit in answer["hits"])
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=ask) for _ in range(3)]
    for thread in threads:
        thread.start()
    made = []
    for seed in range(1, 16):
        made.append(upload()[0].id)
        describe(seed)
        if seed % 5 == 4:
            with database.write() as conn:
                shapes.delete(conn, collection.id, made.pop(0))
    stop.set()
    for thread in threads:
        thread.join()
    assert failures == []
    answer = answer_query(database, follower, QuerySpec("ants", first.id, k=50, tolerance=None, descriptor=FUSED))
    assert {hit["shape"]["id"] for hit in answer["hits"]} == set(made)
    # Those that were made alike come first.
    alike = {id for id, seed in zip(made, range(16 - len(made), 16), strict=True) if seed % 3 == 0}
    assert {hit["shape"]["id"] for hit in answer["hits"][: len(alike)]} == alike


def test_a_shape_that_lacks_what_is_compared_is_no_query(
    database: Database, collection: Collection, upload: Upload, describe: Callable[..., Task]
) -> None:
    shape, _ = upload()
    describe(0, ("hks",))
    spec = QuerySpec("ants", shape.id, tolerance=None, descriptor=FUSED)
    with pytest.raises(ResultNotFound, match="Reindex") as refused:
        answer_query(database, IndexFollower(database), spec)
    assert refused.value.details["descriptors"] == list(PARTS)
    with database.write() as conn:
        tasks.describe_anew(conn, collection.id)
    with pytest.raises(ResultNotFound, match="waits to be described"):
        answer_query(database, IndexFollower(database), spec)


def test_the_setting_names_descriptors(monkeypatch: pytest.MonkeyPatch) -> None:
    assert set(Settings().descriptors) >= set(PARTS)
    monkeypatch.setenv("REEBASE_DESCRIPTORS", "wks, srg,hks")
    assert Settings().descriptors == ("hks", "wks")
    monkeypatch.setenv("REEBASE_DESCRIPTORS", "")
    assert Settings().descriptors == ()
    monkeypatch.setenv("REEBASE_DESCRIPTORS", "hks,best")
    with pytest.raises(ValidationError, match="no descriptor best"):
        Settings()
