"""Migrations: they build exactly what tables.py says, on a populated database too, and only once."""

from __future__ import annotations

import multiprocessing
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from sqlalchemy import Connection, Select, create_engine, inspect, select, text

from store import collections, evaluations, migrate, results, shapes, tables, tasks
from store.engine import Database
from store.errors import UnsupportedDatabase
from store.settings import Settings
from tests.unit.store.descriptions import description


@pytest.fixture
def url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path / 'reebase.sqlite'}"


def schema(conn: Connection) -> dict[str, set[str]]:
    """Name -> the parts of its statement, without their order and layout: SQLite writes an added column as it likes."""
    rows = conn.exec_driver_sql("SELECT name, sql FROM sqlite_master WHERE sql IS NOT NULL").all()
    return {name: parts(sql) for name, sql in rows if name != "alembic_version"}


def parts(statement: str) -> set[str]:
    lines = re.split(r"\n|,(?= \w+ (?:BLOB|INTEGER|REAL|TEXT)\b)", statement)
    return {re.sub(r"\s+", " ", line.strip(" ,")).strip() for line in lines} - {"", ")"}


def populate(url: str) -> None:
    database = Database(url)
    queue = tasks.DatabaseQueue(database, Settings())
    with database.write() as conn:
        collection = collections.create(conn, "ants")
        shape, _ = shapes.add(
            conn, collection.id, sha256="a" * 64, bytes=1, format="ply", name="ant", label="ants", tags=["x"],
            metadata={"year": 1},
        )  # fmt: skip
        tasks.enqueue(conn, "describe", collection_id=collection.id, shape_id=shape.id)
    task = queue.claim("w")
    assert task is not None
    with database.write() as conn:
        found = description(np.ones((2, 3)))
        results.store_description(conn, task, found, cleaned_sha256="b" * 64, denoised_sha256="c" * 64)
        evaluations.create(conn, params={}, collection_id=collection.id)
    database.close()


def test_migrations_build_the_tables_to_the_letter(url: str, tmp_path: Path) -> None:
    migrate.upgrade(url)
    database = Database(url)
    plain = create_engine(f"sqlite:///{tmp_path / 'plain.sqlite'}")
    with database.read() as migrated, plain.connect() as direct:
        tables.metadata.create_all(direct)
        assert schema(migrated) == schema(direct)
        # And as Alembic sees it, so that the next revision starts from nothing pending.
        assert compare_metadata(MigrationContext.configure(migrated), tables.metadata) == []
        strict = migrated.exec_driver_sql("PRAGMA table_list").mappings().all()
        assert {row["name"] for row in strict if row["strict"]} == set(tables.metadata.tables)
    plain.dispose()
    database.close()


def test_up_and_down_on_a_populated_database(url: str) -> None:
    migrate.upgrade(url)
    populate(url)
    migrate.upgrade(url)
    assert migrate.current(url) == migrate.head()
    migrate.downgrade(url, "base")
    assert migrate.current(url) is None
    database = Database(url)
    with database.read() as conn:
        assert inspect(conn).get_table_names() == ["alembic_version"]
    database.close()
    migrate.upgrade(url)
    populate(url)


# A database of the first schema, as its own version wrote it.
_FIRST = """
INSERT INTO collection VALUES ('c', 'ants', '', '{}', 'k', 1, 1);
INSERT INTO shape VALUES ('s', 'c', <a>, 1, 'ply', NULL, 'ant', 'ants', '{}', 'indexed', 't', NULL, 1, 2);
INSERT INTO shape_tag VALUES ('s', 'x');
INSERT INTO task VALUES ('t', 'describe', 'succeeded', 1, 'c', 's', '{}', NULL, '{"n":1}', NULL, NULL, NULL, 1.0,
                         2, 1, 0, NULL, NULL, 1, 2, 3);
INSERT INTO endpoint_features VALUES ('s', 'c', 'k', 1, 1, zeroblob(24), 1);
INSERT INTO skeleton VALUES ('s', 'k', 1, x'00', x'00', <b>, <c>);
INSERT INTO evaluation VALUES ('e', 't', 'c', '{}', NULL, NULL, NULL, 1);
INSERT INTO idempotency VALUES ('key', 'me', 'POST', '/v1', 'f', NULL, NULL, 201, '{}', x'01', 9);
INSERT INTO idempotency VALUES ('held', 'me', 'POST', '/v1', 'f', 'h', 5, NULL, NULL, NULL, 9);
"""


def contents(database: Database, *names: str) -> dict[str, list[dict[str, object]]]:
    with database.read() as conn:
        return {name: [dict(row) for row in conn.execute(rows_of(name)).mappings()] for name in names}


def rows_of(name: str) -> Select[Any]:
    return select(text("*")).select_from(text(name))


def test_the_second_schema_keeps_what_the_first_held(url: str) -> None:
    migrate.upgrade(url, "0001")
    database = Database(url)
    with database.write() as conn:
        for statement in re.sub("<(.)>", lambda found: f"'{found[1] * 64}'", _FIRST).split(";\n")[:-1]:
            conn.exec_driver_sql(statement)
    before = contents(
        database, "collection", "shape_tag", "endpoint_features", "evaluation", "shape", "task", "skeleton"
    )
    database.close()
    migrate.upgrade(url)
    database = Database(url)
    after = contents(database, *before, "idempotency")
    assert [row["key"] for row in after.pop("idempotency")] == ["key"]
    added: dict[str, dict[str, str | None]] = {
        "collection": {"profile": '{"components": "largest", "root": "centroid", "levels": "width"}'},
        "shape": {"deleted_at": None}, "skeleton": {"thumbnail_sha256": None, "display_sha256": None, "limbs": None,
                     "parts": None},
    }  # fmt: skip
    assert after == {name: [{**row, **added.get(name, {})} for row in rows] for name, rows in before.items()}
    assert all(after.values())
    with database.write() as conn:
        # The references still hold, and act.
        tasks.enqueue(conn, "denoise")
        collections.delete(conn, "ants")
        assert conn.exec_driver_sql("SELECT count(*) FROM skeleton").scalar() == 0
    database.close()
    migrate.downgrade(url, "0001")
    database = Database(url)
    with database.read() as conn:
        assert [row.kind for row in conn.exec_driver_sql("SELECT kind FROM task")] == ["describe"]
    database.close()


def test_a_migration_that_fails_changes_nothing(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("alembic.operations.base.Operations.execute", broken)
    with pytest.raises(ZeroDivisionError):
        migrate.upgrade(url)
    monkeypatch.undo()
    assert migrate.current(url) is None
    migrate.upgrade(url)
    assert migrate.current(url) == migrate.head()


def test_a_database_of_a_newer_version_is_left_alone(url: str) -> None:
    migrate.upgrade(url)
    database = Database(url)
    with database.write() as conn:
        conn.exec_driver_sql("UPDATE alembic_version SET version_num = '9999'")
    for change in (lambda: migrate.upgrade(url), lambda: migrate.downgrade(url, "base")):
        with pytest.raises(UnsupportedDatabase, match="newer"):
            change()
    with database.read() as conn:
        assert not migrate.is_current(conn)
    database.close()


def test_nothing_is_there_before_the_first_migration(url: str) -> None:
    assert migrate.current(url) is None


def test_processes_that_start_at_once_migrate_once(url: str) -> None:
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=migrate.upgrade, args=(url,)) for _ in range(4)]
    for process in processes:
        process.start()
    for process in processes:
        process.join(timeout=60)
    assert [process.exitcode for process in processes] == [0] * 4
    populate(url)
