"""Nothing that is named is removed, nothing unnamed stays, and a backup gives all of it back."""

from __future__ import annotations

import dataclasses
import io
import json
import os
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from sqlalchemy import select, update

from store import collections, evaluations, idempotency, migrate, results, shapes, tables, tasks
from store.backup import backup, restore, verify
from store.blobs import LocalBlobs
from store.engine import Database
from store.errors import (
    BlobNotFound,
    CorruptBackup,
    EvaluationNotFound,
    ResultNotFound,
    StaleClaim,
    TargetNotEmpty,
    TaskNotFound,
    UnsupportedDatabase,
)
from store.idempotency import Answer, Request
from store.records import Collection, Shape, Task
from store.settings import Settings
from store.sql import now
from store.sweep import Swept, remove_unnamed, sweep
from tests.unit.store.descriptions import description

Upload = Callable[..., tuple[Shape, Task]]
NOTHING = Swept(0, 0, 0, 0, 0, 0)


@pytest.fixture
def blobs(settings: Settings) -> LocalBlobs:
    return LocalBlobs(settings.blobs)


@pytest.fixture
def full(
    database: Database, blobs: LocalBlobs, queue: tasks.DatabaseQueue, upload: Upload, collection: Collection
) -> dict[str, str]:
    """A described shape, an evaluation with its matrix, and a query that waits: name -> blob."""
    file = io.BytesIO()
    np.save(file, np.arange(4.0).reshape(2, 2))
    data = {
        "upload": b"ply", "cleaned": b"cleaned", "denoised": b"denoised", "query": b"query",
        "matrix": file.getvalue(),
    }  # fmt: skip
    names = {name: blobs.put_if_absent(content) for name, content in data.items()}
    upload(sha256=names["upload"])
    task = queue.claim("w")
    assert task is not None
    with database.write() as conn:
        results.store_description(
            conn, task, description(np.ones((2, 3))), cleaned_sha256=names["cleaned"],
            denoised_sha256=names["denoised"],
        )  # fmt: skip
        evaluations.create(conn, params={"measure": "matching"}, collection_id=collection.id)
    task = queue.claim("w")
    assert task is not None
    with database.write() as conn:
        items = [{"id": "a", "name": "a", "label": "x"}, {"id": "b", "name": "b", "label": "x"}]
        evaluations.complete(conn, task, {"map": 0.5}, items=items, matrix_sha256=names["matrix"])
        tasks.enqueue(conn, "query", collection_id=collection.id, blob=names["query"])
    return names


def age(blobs: LocalBlobs, seconds: float) -> None:
    then = time.time() - seconds
    for sha256 in blobs.all():
        os.utime(blobs.path(sha256), (then, then))


def test_what_is_named_stays(database: Database, blobs: LocalBlobs, settings: Settings, full: dict[str, str]) -> None:
    age(blobs, 10 * settings.sweep_grace_seconds)
    assert sweep(database, blobs, settings) == NOTHING
    assert set(blobs.all()) == set(full.values())


def test_what_is_not_named_goes_after_the_grace(
    database: Database, blobs: LocalBlobs, settings: Settings, full: dict[str, str]
) -> None:
    orphan = blobs.put_if_absent(b"orphan")
    assert sweep(database, blobs, settings) == NOTHING
    age(blobs, 10 * settings.sweep_grace_seconds)
    blobs.put_if_absent(b"young")
    assert sweep(database, blobs, settings).blobs == 1
    assert not blobs.exists(orphan)
    assert len(list(blobs.all())) == 6


def test_deleting_leaves_the_blobs_to_the_sweep(
    database: Database, blobs: LocalBlobs, settings: Settings, full: dict[str, str], queue: tasks.DatabaseQueue
) -> None:
    eager = settings.model_copy(update={"sweep_grace_seconds": 0.0})
    task = queue.claim("w", ["query"])
    assert task is not None
    with database.write() as conn:
        queue.succeed(conn, task, {"hits": []})
    assert sweep(database, blobs, eager).blobs == 1
    assert not blobs.exists(full["query"])
    with database.write() as conn:
        collections.delete(conn, "ants")
    assert blobs.exists(full["upload"])
    assert sweep(database, blobs, eager).blobs == 3
    assert list(blobs.all()) == [full["matrix"]]
    with database.write() as conn:
        evaluations.delete(conn, evaluations.list_page(conn).items[0].id)
    assert sweep(database, blobs, eager).blobs == 1
    assert list(blobs.all()) == []


def test_a_row_that_commits_after_the_first_look_saves_its_blob(
    database: Database, blobs: LocalBlobs, settings: Settings, collection: Collection,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    sha256 = blobs.put_if_absent(b"in flight")
    age(blobs, 10 * settings.sweep_grace_seconds)
    write = database.write

    def write_after_an_upload():  # type: ignore[no-untyped-def]
        monkeypatch.undo()
        with database.write() as conn:
            shapes.add(conn, collection.id, sha256=sha256, bytes=9, format="ply", name="x")
        return write()

    # The first writer removes old rows, the second looks again at the one blob that nothing named.
    writers = [write_after_an_upload, write]

    def next_writer():  # type: ignore[no-untyped-def]
        return writers.pop()()

    monkeypatch.setattr(database, "write", next_writer)
    assert sweep(database, blobs, settings).blobs == 0
    assert writers == []
    assert blobs.exists(sha256)


def test_putting_a_blob_again_saves_it_before_its_row_is_there(
    database: Database, blobs: LocalBlobs, settings: Settings
) -> None:
    sha256 = blobs.put_if_absent(b"again")
    age(blobs, 10 * settings.sweep_grace_seconds)
    blobs.put_if_absent(b"again")
    assert sweep(database, blobs, settings) == NOTHING
    assert blobs.exists(sha256)


def test_old_queries_keys_and_tombstones_go(
    database: Database, blobs: LocalBlobs, settings: Settings, full: dict[str, str], upload: Upload
) -> None:
    shape, _ = upload()
    with database.write() as conn:
        shapes.delete(conn, shape.collection_id, shape.id)
        query = tasks.list_page(conn, kind="query").items[0]
        tasks.cancel(conn, query.id)
        idempotency.keep(conn, Request("k", "p", "POST", "/", "f"), Answer(200), keep_seconds=-1)
        long_ago = now(-30 * 86400)
        conn.execute(update(tables.tombstone).values(deleted_at=long_ago))
        conn.execute(update(tables.task).where(tables.task.c.kind == "query").values(finished_at=long_ago))
    swept = sweep(database, blobs, settings)
    assert (swept.idempotency_keys, swept.tasks, swept.tombstones) == (1, 1, 1)
    with database.read() as conn:
        with pytest.raises(TaskNotFound):
            tasks.get(conn, query.id)
        assert len(tasks.list_page(conn, kind="describe").items) == 2
    assert sweep(database, blobs, settings) == NOTHING


def test_descriptions_of_shapes_that_are_gone_go_after_a_while(
    database: Database, blobs: LocalBlobs, settings: Settings, upload: Upload
) -> None:
    gone, _ = upload()
    kept, _ = upload()
    with database.write() as conn:
        shapes.delete(conn, gone.collection_id, gone.id)
        mine = tables.task.c.shape_id.in_([gone.id, kept.id])
        conn.execute(update(tables.task).where(mine).values(state="cancelled", finished_at=now(-30 * 86400)))
    assert sweep(database, blobs, settings).tasks == 0  # it can still be restored, with its history
    with database.write() as conn:
        conn.execute(update(tables.shape).where(tables.shape.c.id == gone.id).values(deleted_at=now(-2 * 86400)))
    swept = sweep(database, blobs, settings)
    assert (swept.shapes, swept.tasks) == (1, 1)
    with database.read() as conn:
        assert {one.shape_id for one in tasks.list_page(conn, kind="describe").items} == {kept.id}


def test_evaluations(database: Database, blobs: LocalBlobs, full: dict[str, str], collection: Collection) -> None:
    with database.write() as conn:
        listed = evaluations.list_page(conn, collection_id=collection.id).items[0]
        done = evaluations.get(conn, listed.id)
        waiting = evaluations.create(conn, params={"synthetic": {"seed": 1}})
        assert [e.id for e in evaluations.list_page(conn, limit=1).items] == [waiting.id]
        cursor = evaluations.list_page(conn, limit=1).next
        assert evaluations.list_page(conn, limit=1, cursor=cursor).items == (listed,)
    assert listed == dataclasses.replace(done, report=None, items=None) and done.report is not None
    with database.write() as conn:
        assert evaluations.of_task(conn, waiting.task.id) == waiting
    assert (done.report, done.task.state, done.task.result) == (
        {"map": 0.5}, "succeeded", {"evaluation": done.id},
    )  # fmt: skip
    assert done.items is not None and [item["id"] for item in done.items] == ["a", "b"]
    rows = [*evaluations.matrix_rows(blobs, evaluations.matrix_of(done))]
    assert np.array_equal(rows, np.arange(4.0).reshape(2, 2))
    assert (waiting.report, waiting.task.state, waiting.task.params) == (None, "queued", waiting.params)
    with pytest.raises(ResultNotFound):
        evaluations.matrix_of(waiting)
    with pytest.raises(StaleClaim), database.write() as conn:
        evaluations.complete(conn, waiting.task, {"map": 1.0}, items=[], matrix_sha256=None)
    with database.write() as conn:
        assert evaluations.get(conn, waiting.id).report is None
        evaluations.delete(conn, waiting.id)
        for call in (evaluations.get, evaluations.delete):
            with pytest.raises(EvaluationNotFound):
                call(conn, waiting.id)
        with pytest.raises(TaskNotFound):
            tasks.get(conn, waiting.task.id)


@pytest.mark.parametrize("n", [0, 1, 700])
def test_a_matrix_comes_in_rows_wherever_the_pieces_of_its_blob_end(blobs: LocalBlobs, n: int) -> None:
    expected = np.random.default_rng(n).random((n, n))
    file = io.BytesIO()
    np.save(file, expected)
    rows = [*evaluations.matrix_rows(blobs, blobs.put_if_absent(file.getvalue()))]
    assert len(rows) == n
    assert all(map(np.array_equal, rows, expected))


def dump(database: Database) -> dict[str, list[str]]:
    with database.read() as conn:
        return {
            table.name: sorted(str(row) for row in conn.execute(select(table)))
            for table in tables.metadata.sorted_tables
        }


def test_a_backup_gives_everything_back(
    database: Database, blobs: LocalBlobs, full: dict[str, str], tmp_path: Path
) -> None:
    orphan = blobs.put_if_absent(b"orphan")
    made = backup(database, blobs, tmp_path / "backup")
    before = dump(database)
    with database.write() as conn:
        collections.create(conn, "later")
    there = Settings(home=tmp_path / "elsewhere")
    assert restore(tmp_path / "backup", there) == made == verify(tmp_path / "backup")
    assert set(made.blobs) == set(full.values())
    assert made.schema == migrate.head()
    restored = Database(there.database_url)
    assert dump(restored) == before
    kept = LocalBlobs(there.blobs)
    for sha256 in full.values():
        assert kept.get(sha256) == blobs.get(sha256)
    with pytest.raises(BlobNotFound):
        kept.get(orphan)
    restored.close()
    with pytest.raises(TargetNotEmpty):
        restore(tmp_path / "backup", there)
    with pytest.raises(TargetNotEmpty):
        backup(database, blobs, tmp_path / "backup")
    assert list(tmp_path.glob("**/*.partial*")) == []


def test_what_ran_during_the_backup_is_queued_after_the_restore(
    database: Database, blobs: LocalBlobs, queue: tasks.DatabaseQueue, full: dict[str, str], tmp_path: Path
) -> None:
    task = queue.claim("w")
    assert task is not None
    backup(database, blobs, tmp_path / "backup")
    there = Settings(home=tmp_path / "elsewhere")
    restore(tmp_path / "backup", there)
    restored = Database(there.database_url)
    with restored.read() as conn:
        again = tasks.get(conn, task.id)
    restored.close()
    assert (again.state, again.crashes, again.attempt) == ("queued", 0, 1)


@pytest.mark.parametrize("damage", ["blob", "missing blob", "database", "manifest", "no manifest", "no database"])
def test_a_damaged_backup_restores_nothing(
    database: Database, blobs: LocalBlobs, full: dict[str, str], tmp_path: Path, damage: str
) -> None:
    source = tmp_path / "backup"
    backup(database, blobs, source)
    blob = LocalBlobs(source / "blobs").path(full["denoised"])
    if damage == "blob":
        blob.write_bytes(b"Denoised")
    elif damage == "missing blob":
        blob.unlink()
    elif damage == "database":
        content = bytearray((source / "reebase.sqlite").read_bytes())
        content[-1] ^= 1
        (source / "reebase.sqlite").write_bytes(content)
    elif damage == "manifest":
        record = json.loads((source / "manifest.json").read_text())
        del record["blobs"]
        (source / "manifest.json").write_text(json.dumps(record))
    else:
        (source / {"no manifest": "manifest.json", "no database": "reebase.sqlite"}[damage]).unlink()
    there = Settings(home=tmp_path / "elsewhere")
    with pytest.raises(CorruptBackup):
        restore(source, there)
    assert not there.home.exists()


@pytest.mark.parametrize("left", ["reebase.sqlite", "reebase.sqlite-wal", "reebase.sqlite-shm"])
def test_what_a_database_left_behind_is_not_mixed_into_the_restored_one(
    database: Database, blobs: LocalBlobs, full: dict[str, str], tmp_path: Path, left: str
) -> None:
    backup(database, blobs, tmp_path / "backup")
    there = Settings(home=tmp_path / "elsewhere")
    there.home.mkdir()
    (there.home / left).write_bytes(b"old")
    with pytest.raises(TargetNotEmpty, match=left):
        restore(tmp_path / "backup", there)


def test_a_store_that_is_damaged_says_so_when_backed_up(
    database: Database, blobs: LocalBlobs, full: dict[str, str], tmp_path: Path
) -> None:
    blobs.delete(full["cleaned"])
    with pytest.raises(BlobNotFound, match=full["cleaned"]):
        backup(database, blobs, tmp_path / "backup")
    assert not (tmp_path / "backup").exists()


def ended(database: Database, sha256: str) -> None:
    with database.write() as conn:
        tasks.cancel(conn, tasks.enqueue(conn, "query", blob=sha256).id)


def test_the_mesh_of_a_query_that_ended_is_removed_without_a_grace(
    database: Database, blobs: LocalBlobs, settings: Settings, full: dict[str, str]
) -> None:
    grace = settings.sweep_grace_seconds
    assert not remove_unnamed(database, blobs, full["query"], grace)  # its task waits
    with database.write() as conn:
        tasks.cancel(conn, tasks.list_page(conn, kind="query").items[0].id)
    assert remove_unnamed(database, blobs, full["query"], grace)
    # A query by the bytes of a shape, and one whose end nobody saw.
    ended(database, full["upload"])
    lost = blobs.put_if_absent(b"lost")
    ended(database, lost)
    assert not remove_unnamed(database, blobs, full["upload"], grace)
    assert sweep(database, blobs, settings).blobs == 1
    assert set(blobs.all()) == set(full.values()) - {full["query"]}


def test_who_puts_the_mesh_of_a_query_again_keeps_it(database: Database, blobs: LocalBlobs, settings: Settings) -> None:
    sha256 = blobs.put_if_absent(b"query")
    ended(database, sha256)
    time.sleep(0.02)
    blobs.put_if_absent(b"query")
    assert not remove_unnamed(database, blobs, sha256, settings.sweep_grace_seconds)


def test_uploads_that_race_with_the_end_of_queries_never_lose_what_they_named(
    database: Database, blobs: LocalBlobs, settings: Settings
) -> None:
    """Same bytes from all sides: whatever is named is there, or its sender was told to send it again."""
    end, found = time.monotonic() + 2.0, {"kept": 0, "refused": 0, "removed": 0, "lost": 0}

    def ask() -> None:
        while time.monotonic() < end:
            sha256 = blobs.put_if_absent(b"the same")
            with database.write() as conn:
                if not blobs.exists(sha256):  # as Upload.check_kept
                    found["refused"] += 1
                    continue
                task = tasks.enqueue(conn, "query", blob=sha256)
            found["kept" if blobs.exists(sha256) else "lost"] += 1
            with database.write() as conn:
                found["lost"] += not blobs.exists(sha256)
                tasks.cancel(conn, task.id)
            found["removed"] += remove_unnamed(database, blobs, sha256, settings.sweep_grace_seconds)

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found["kept"] and found["removed"] and not found["lost"], found


LATER = """
from alembic import op

revision, down_revision, branch_labels, depends_on = "9001", "0003", None, None


def upgrade() -> None:
    op.execute("ALTER TABLE evaluation RENAME COLUMN picture TO matrix_sha256")
"""


def test_an_older_schema_is_backed_up_as_it_is_and_migrated_when_restored(
    database: Database, blobs: LocalBlobs, full: dict[str, str], settings: Settings, tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    with database.write() as conn:
        conn.exec_driver_sql("ALTER TABLE evaluation RENAME COLUMN matrix_sha256 TO picture")
    shutil.copytree(migrate._SCRIPTS, tmp_path / "migrations")
    (tmp_path / "migrations" / "versions" / "9001_later.py").write_text(LATER)
    monkeypatch.setattr(migrate, "_SCRIPTS", tmp_path / "migrations")
    with pytest.raises(UnsupportedDatabase, match=r"run `.* migrate`"):
        migrate.check(settings.database_url)
    migrate.check(settings.database_url, any_schema=True)
    made = backup(database, blobs, tmp_path / "backup")
    assert (made.schema, set(made.blobs)) == ("0003", set(full.values()))
    assert migrate.current(settings.database_url) == "0003"
    assert [path.name for path in (tmp_path / "backup").iterdir() if path.is_dir()] == ["blobs"]
    there = Settings(home=tmp_path / "elsewhere")
    restore(tmp_path / "backup", there)
    assert migrate.current(there.database_url) == "9001"
