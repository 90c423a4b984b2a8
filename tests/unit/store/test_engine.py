"""The database: one writer, snapshots beside it, failures with a name."""

from __future__ import annotations

import sqlite3
import threading
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from sqlalchemy import insert, select, text
from sqlalchemy.exc import IntegrityError, OperationalError

from store import collections, engine, migrate, tables
from store.engine import Database, sqlite_url
from store.errors import StoreBusy, UnsupportedDatabase
from store.records import Collection
from store.settings import Settings
from store.sql import read_clock


def names(database: Database) -> list[str]:
    column = tables.collection.c.name
    with database.read() as conn:
        return list(conn.execute(select(column).order_by(column)).scalars())


def test_the_promises_of_the_design(database: Database) -> None:
    with database.write() as conn:
        found = {
            name: conn.exec_driver_sql(f"PRAGMA {name}").scalar()
            for name in ("journal_mode", "synchronous", "foreign_keys", "busy_timeout")
        }
    assert found == {"journal_mode": "wal", "synchronous": 2, "foreign_keys": 1, "busy_timeout": 10000}


def test_a_transaction_is_all_or_nothing(database: Database) -> None:
    with pytest.raises(ZeroDivisionError), database.write() as conn:
        collections.create(conn, "ants")
        1 / 0  # noqa: B018 - to raise
    assert names(database) == []


def test_a_reader_cannot_write(database: Database) -> None:
    with database.read() as conn, pytest.raises(OperationalError, match="readonly"):
        conn.execute(insert(tables.revision).values(id=1, value=1, floor=0))


def test_a_reader_sees_one_snapshot_and_does_not_wait_for_the_writer(database: Database) -> None:
    count = text("SELECT count(*) FROM collection")
    with database.read() as before, database.write() as conn:
        assert before.execute(count).scalar() == 0
        collections.create(conn, "ants")
        assert names(database) == []
        conn.commit()
        assert before.execute(count).scalar() == 0
    assert names(database) == ["ants"]


def test_writers_of_many_threads_take_turns(database: Database) -> None:
    def add(thread: int) -> None:
        for number in range(10):
            with database.write() as conn:
                collections.create(conn, f"c{thread}-{number}")
            assert f"c{thread}-{number}" in names(database)

    threads = [threading.Thread(target=add, args=(n,)) for n in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(names(database)) == 80


def test_a_nested_writer_is_a_mistake_not_a_deadlock(database: Database) -> None:
    with database.write(), pytest.raises(RuntimeError, match="already open"), database.write():
        pass


def test_closed_means_closed(settings: Settings) -> None:
    migrate.upgrade(settings.database_url)
    database = Database(settings.database_url)
    database.close()
    database.close()
    with pytest.raises(RuntimeError, match="closed"), database.read():
        pass
    with pytest.raises(RuntimeError, match="closed"), database.write():
        pass


def test_a_database_that_another_process_keeps_locked(
    settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    migrate.upgrade(settings.database_url)
    monkeypatch.setattr(engine, "BUSY_SECONDS", 0.05)
    database = Database(settings.database_url)
    other = sqlite3.connect(database.path, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    with pytest.raises(StoreBusy), database.write():
        pass
    assert names(database) == []
    other.execute("COMMIT")
    other.close()
    with database.write() as conn:
        collections.create(conn, "ants")
    database.close()


@pytest.mark.parametrize(
    "url",
    ["postgresql+psycopg://localhost/a", "sqlite://", "sqlite:///:memory:", "nonsense", "sqlite:///a?mode=ro"],
)
def test_other_databases_are_refused(url: str) -> None:
    with pytest.raises(UnsupportedDatabase):
        Database(url)


def test_an_old_sqlite_is_refused_with_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sqlite3, "sqlite_version_info", (3, 36, 0))
    with pytest.raises(UnsupportedDatabase, match=r"3\.37"):
        Database(f"sqlite:///{tmp_path / 'a.sqlite'}")


def test_a_path_with_odd_characters(tmp_path: Path) -> None:
    path = tmp_path / "a b#c%20ü?x=1" / "reebase.sqlite"
    assert Settings(home=path.parent).database_url == sqlite_url(path)
    migrate.upgrade(sqlite_url(path))
    assert path.exists()


def test_the_clock_is_the_present_in_utc(database: Database) -> None:
    with database.read() as conn:
        assert abs(read_clock(conn) - datetime.now(UTC)) < timedelta(seconds=1)


def test_strict_tables_and_foreign_keys(database: Database, collection: Collection) -> None:
    with pytest.raises(IntegrityError, match="cannot store TEXT value in INTEGER"), database.write() as conn:
        conn.exec_driver_sql("UPDATE collection SET created_at = 'yesterday'")
    with pytest.raises(IntegrityError, match="FOREIGN KEY"), database.write() as conn:
        conn.exec_driver_sql("INSERT INTO shape_tag (shape_id, tag) VALUES ('nobody', 'x')")
