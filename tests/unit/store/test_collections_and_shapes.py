"""Collections and shapes: names once, bytes once, filters, and a profile that changes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from sqlalchemy import event, update

from reebase.errors import ParameterError, ReebaseError, UnknownName
from reebase.pipeline import Profile
from store import collections, keys, results, revision, shapes, tables, tasks
from store.engine import Database
from store.errors import (
    CollectionExists,
    CollectionNotFound,
    InvalidCursor,
    QuotaExceeded,
    ShapeExists,
    ShapeNotFound,
    TaskNotRetryable,
)
from store.follower import IndexFollower
from store.records import Collection, Filters, Shape, Task
from tests.unit.store.descriptions import description

Upload = Callable[..., tuple[Shape, Task]]
SHA = "e" * 64


def test_create_and_get(database: Database) -> None:
    with database.write() as conn:
        made = collections.create(conn, "ants", {"bands": 32}, "from the garden")
        with pytest.raises(CollectionExists):
            collections.create(conn, "ants")
        assert collections.get(conn, "ants") == collections.by_id(conn, made.id) == made
    assert made.profile == Profile(bands=32).to_json()
    assert made.profile_key == Profile(bands=32).key
    assert (made.description, made.created_at) == ("from the garden", made.updated_at)
    with database.read() as conn, pytest.raises(CollectionNotFound):
        collections.get(conn, "bees")


@pytest.mark.parametrize("name", ["", "Ants", "-ants", "a" * 64, "ants/1", "ants ", "ants\n", "ä"])
def test_names_that_cannot_stand_in_a_url(database: Database, name: str) -> None:
    with pytest.raises(ParameterError), database.write() as conn:
        collections.create(conn, name)


@pytest.mark.parametrize(
    ("profile", "error"),
    [({"colour": "red"}, UnknownName), ({"denoise": "magic"}, ReebaseError), ({"bands": 0}, ReebaseError)],
)
def test_profiles_that_no_pipeline_runs(database: Database, profile: dict[str, Any], error: type[ReebaseError]) -> None:
    with pytest.raises(error), database.write() as conn:
        collections.create(conn, "ants", profile)


def test_pages_of_collections(database: Database) -> None:
    with database.write() as conn:
        made = [collections.create(conn, f"c{n}") for n in range(5)]
    with database.read() as conn:
        first = collections.list_page(conn, limit=3)
        second = collections.list_page(conn, limit=3, cursor=first.next)
        with pytest.raises(InvalidCursor):
            collections.list_page(conn, cursor="x")
    assert [*first.items, *second.items] == made
    assert second.next is None


def test_another_profile_queues_every_shape_anew(
    database: Database, queue: tasks.DatabaseQueue, collection: Collection, upload: Upload
) -> None:
    described, _ = upload()
    running, _ = upload()
    waiting, _ = upload()
    first = queue.claim("w")
    assert first is not None
    with database.write() as conn:
        found = description(np.ones((2, 3)))
        results.store_description(conn, first, found, cleaned_sha256=SHA, denoised_sha256=SHA)
    held = queue.claim("w")
    assert held is not None and held.shape_id == running.id
    with database.write() as conn:
        assert collections.counts(conn, collection.id).by_endpoint_count == {2: 1}
        same = collections.update(conn, "ants", description="new words", profile={"bands": Profile().bands})
    assert (same.profile_key, same.description) == (collection.profile_key, "new words")
    assert queue.heartbeat(held, "read", 0.1) == "ok"
    with database.write() as conn:
        changed = collections.update(conn, "ants", profile={"bands": 17})
        counts = collections.counts(conn, collection.id)
    assert changed.profile == {**collection.profile, "bands": 17}
    assert changed.profile_key != collection.profile_key
    assert (counts.by_state, counts.by_endpoint_count, counts.shapes) == ({"queued": 3}, {}, 3)
    assert queue.heartbeat(held, "read", 0.2) == "lost"
    claimed = [queue.claim("w") for _ in range(4)]
    assert [task and task.shape_id for task in claimed] == [described.id, running.id, waiting.id, None]


def test_another_profile_takes_few_statements_however_many_shapes_there_are(
    database: Database, collection: Collection, upload: Upload
) -> None:
    def statements(bands: int) -> int:
        asked: list[object] = []
        event.listen(database._writer, "before_cursor_execute", lambda *seen: asked.append(seen))
        with database.write() as conn:
            collections.update(conn, "ants", profile={"bands": bands})
        return len(asked)

    upload()
    few = statements(20)
    for _ in range(30):
        upload()
    assert statements(21) == few


def test_an_upgrade_of_the_pipeline_queues_what_older_versions_described(
    database: Database, collection: Collection, upload: Upload, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, task = upload()
    with database.write() as conn:
        assert collections.renew_profiles(conn) == 0
    monkeypatch.setattr("reebase.pipeline.PIPELINE_VERSION", 10**6)
    with database.write() as conn:
        assert collections.renew_profiles(conn) == 1
        assert tasks.get(conn, task.id).state == "cancelled"
        assert collections.get(conn, "ants").profile_key == Profile().key != collection.profile_key
        assert collections.renew_profiles(conn) == 0


def test_deleting_a_collection_deletes_what_is_in_it(
    database: Database, collection: Collection, upload: Upload
) -> None:
    shape, task = upload(tags=["x"], metadata={"a": 1})
    with database.write() as conn:
        before = revision.current(conn)
        collections.delete(conn, "ants")
        assert shapes.by_ids(conn, [shape.id]) == {}
        assert tasks.get(conn, task.id).state == "cancelled"
        assert revision.current(conn) == before + 1
        with pytest.raises(CollectionNotFound):
            collections.delete(conn, "ants")


def test_the_same_bytes_are_the_same_shape(database: Database, collection: Collection) -> None:
    given: dict[str, Any] = {"sha256": SHA, "bytes": 9, "format": "obj"}
    with database.write() as conn:
        made, created = shapes.add(
            conn, collection.id, **given, name="ant", filename="ant.obj", label="ants", tags=["b", "a", "b"],
            metadata={"n": 1.5, "nested": {"x": [1, None]}},
        )  # fmt: skip
        again, repeated = shapes.add(conn, collection.id, **given, name="other", tags=["c"])
        other = collections.create(conn, "bees")
        assert shapes.add(conn, other.id, **given, name="bee")[1]
    assert (created, repeated) == (True, False)
    assert again == made
    assert (made.tags, made.metadata) == (("a", "b"), {"n": 1.5, "nested": {"x": [1, None]}})
    assert (made.state, made.endpoint_count, made.flags, made.task_id) == ("queued", None, (), None)


def test_update_leaves_what_is_not_given(database: Database, collection: Collection, upload: Upload) -> None:
    shape, _ = upload(label="ants", tags=["a"], metadata={"x": 1})
    with database.write() as conn:
        same = shapes.update(conn, collection.id, shape.id, name="new")
        assert (same.name, same.label, same.tags, same.metadata) == ("new", "ants", ("a",), {"x": 1})
        cleared = shapes.update(conn, collection.id, shape.id, label=None, tags=[], metadata={"y": 2})
        assert (cleared.label, cleared.tags, cleared.metadata) == (None, (), {"y": 2})
        assert shapes.ids_matching(conn, collection.id, Filters(metadata={"x": 1})) == frozenset()
        assert shapes.ids_matching(conn, collection.id, Filters(metadata={"y": 2})) == {shape.id}
    with database.write() as conn, pytest.raises(ShapeNotFound):
        shapes.update(conn, "other", shape.id, name="stolen")


def test_filters(database: Database, collection: Collection, upload: Upload) -> None:
    one, _ = upload(label="ants", tags=["red", "small"], metadata={"year": 2004, "who": {"a": 1}})
    two, _ = upload(label="ants", tags=["red"], metadata={"year": 2004.0, "who": None})
    three, _ = upload(label="bees", metadata={"year": "2004", "%": "_"})
    cases: list[tuple[Filters, set[str]]] = [
        (Filters(), {one.id, two.id, three.id}),
        (Filters(label="ants"), {one.id, two.id}),
        (Filters(tags=("red",)), {one.id, two.id}),
        (Filters(tags=("red", "small")), {one.id}),
        (Filters(metadata={"year": 2004}), {one.id, two.id}),
        (Filters(metadata={"year": "2004"}), {three.id}),
        (Filters(metadata={"who": None}), {two.id}),
        (Filters(metadata={"who": {"a": 1.0}, "year": 2004}), {one.id}),
        (Filters(metadata={"%": "_"}), {three.id}),
        (Filters(state="queued", sha256=two.sha256), {two.id}),
        (Filters(state="failed"), set()),
        (Filters(label="' OR 1=1 --"), set()),
    ]
    with database.read() as conn:
        for filters, expected in cases:
            assert shapes.ids_matching(conn, collection.id, filters) == expected, filters
            listed = shapes.list_page(conn, collection.id, filters).items
            assert {shape.id for shape in listed} == expected
        assert shapes.ids_matching(conn, "other", Filters()) == frozenset()
    assert not Filters()
    assert all(filters for filters, _ in cases[1:])


def test_pages_of_shapes_and_many_ids(database: Database, collection: Collection, upload: Upload) -> None:
    made = [upload()[0].id for _ in range(7)]
    with database.read() as conn:
        found: list[str] = []
        cursor = None
        while True:
            page = shapes.list_page(conn, collection.id, limit=3, cursor=cursor)
            found += [shape.id for shape in page.items]
            cursor = page.next
            if cursor is None:
                break
        assert found == made
        wanted = [*made, *(f"nobody {n}" for n in range(1200))]
        assert set(shapes.by_ids(conn, wanted)) == set(made)


def test_delete_tells_the_followers(database: Database, collection: Collection, upload: Upload) -> None:
    shape, _ = upload()
    with database.write() as conn:
        before = revision.current(conn)
        assert shapes.delete(conn, collection.id, shape.id).id == shape.id
        assert revision.current(conn) == before + 1
        with pytest.raises(ShapeNotFound):
            shapes.get(conn, collection.id, shape.id)
        with pytest.raises(ShapeNotFound):
            shapes.delete(conn, collection.id, shape.id)


def described(database: Database, queue: tasks.DatabaseQueue, label: str = "ants") -> Task:
    task = queue.claim("w")
    assert task is not None
    with database.write() as conn:
        found = description(np.ones((2, 3)))
        return results.store_description(conn, task, found, cleaned_sha256=SHA, denoised_sha256=SHA)


def test_a_deleted_shape_is_nowhere_until_it_is_restored(
    database: Database, queue: tasks.DatabaseQueue, collection: Collection, upload: Upload
) -> None:
    with database.write() as conn:
        key, _ = keys.create(conn, "write", max_shapes=1)
    shape, _ = upload(label="ants", tags=["x"], owner=key.id)
    described(database, queue)
    with database.write() as conn:
        before = shapes.get(conn, collection.id, shape.id)
        index = IndexFollower(database)
        assert shape.id in index.index(collection.id, collection.profile_key)
        with pytest.raises(QuotaExceeded):
            keys.check_quota(conn, key)
        shapes.delete(conn, collection.id, shape.id)
    with database.write() as conn:
        for gone in (shapes.get, shapes.update, shapes.delete):
            with pytest.raises(ShapeNotFound):
                gone(conn, collection.id, shape.id)
        assert shapes.by_ids(conn, [shape.id]) == {}
        assert shapes.list_page(conn, collection.id).items == ()
        assert shapes.ids_matching(conn, collection.id, Filters(label="ants")) == frozenset()
        counts = collections.counts(conn, collection.id)
        assert (counts.by_state, counts.by_endpoint_count) == ({}, {})
        assert results.labelled(conn, collection.id, collection.profile_key).ids == []
        keys.check_quota(conn, key)
    for follower in (index, IndexFollower(database)):
        assert shape.id not in follower.index(collection.id, collection.profile_key)
    with database.write() as conn:
        restored = shapes.restore(conn, collection.id, shape.id)
        assert dataclasses.replace(restored, updated_at=before.updated_at) == before
        assert shapes.restore(conn, collection.id, shape.id) == restored
        assert results.labelled(conn, collection.id, collection.profile_key).ids == [shape.id]
    for follower in (index, IndexFollower(database)):
        assert shape.id in follower.index(collection.id, collection.profile_key)
    assert queue.claim("w") is None


def test_bytes_that_came_again_stand_in_the_way_of_restoring(
    database: Database, collection: Collection, upload: Upload
) -> None:
    first, _ = upload(sha256=SHA)
    with database.write() as conn:
        shapes.delete(conn, collection.id, first.id)
    second, _ = upload(sha256=SHA)
    assert second.id != first.id
    with database.write() as conn:
        with pytest.raises(ShapeExists) as refused:
            shapes.restore(conn, collection.id, first.id)
        assert refused.value.details["shape"] == second.id
        shapes.delete(conn, collection.id, second.id)
        assert shapes.restore(conn, collection.id, first.id).id == first.id


def test_restoring_describes_what_was_cut_off_or_is_outdated(
    database: Database, queue: tasks.DatabaseQueue, collection: Collection, upload: Upload
) -> None:
    outdated, _ = upload()
    described(database, queue)
    cut, _ = upload()
    failed, _ = upload()
    held = [queue.claim("w"), queue.claim("w")]
    assert held[0] is not None and held[1] is not None
    with database.write() as conn:
        tasks.fail(conn, held[1], "broken", "It is broken.")
        for shape in (outdated, cut, failed):
            shapes.delete(conn, collection.id, shape.id)
        collections.update(conn, "ants", profile={"bands": 17})
    assert queue.heartbeat(held[0], "read", 0.1) == "lost"
    assert queue.claim("w") is None
    with database.write() as conn:
        with pytest.raises(TaskNotRetryable):
            tasks.retry(conn, held[1].id)
        states = [shapes.restore(conn, collection.id, shape.id).state for shape in (outdated, cut, failed)]
    assert states == ["queued", "queued", "failed"]


@pytest.mark.parametrize("was", ["queued", "cancelled"])
def test_what_is_described_is_indexed_when_it_is_restored(
    database: Database, queue: tasks.DatabaseQueue, collection: Collection, upload: Upload, was: str
) -> None:
    shape, _ = upload()
    described(database, queue)
    with database.write() as conn:
        assert tasks.describe_anew(conn, collection.id, {shape.id}) == 1
        shapes.delete(conn, collection.id, shape.id)
        if was == "cancelled":  # as deletions of before left it
            conn.execute(update(tables.shape).values(state="cancelled"))
        assert shapes.restore(conn, collection.id, shape.id).state == "indexed"
    assert shape.id in IndexFollower(database).index(collection.id, collection.profile_key)
    assert queue.claim("w") is None


def test_what_was_deleted_long_ago_is_purged(database: Database, collection: Collection, upload: Upload) -> None:
    kept, _ = upload()
    shape, _ = upload()
    with database.write() as conn:
        shapes.delete(conn, collection.id, shape.id)
        assert shapes.purge(conn, 3600.0) == 0
        assert shapes.purge(conn, -1.0) == 1
        with pytest.raises(ShapeNotFound):
            shapes.restore(conn, collection.id, shape.id)
        assert shapes.list_page(conn, collection.id).items == (shapes.get(conn, collection.id, kept.id),)
