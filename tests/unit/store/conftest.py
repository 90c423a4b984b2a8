"""A store of its own for every test, and the smallest things to put into it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from store import collections, migrate, shapes, tasks
from store.engine import Database
from store.records import Collection, Shape, Task
from store.settings import Settings


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    return Settings(home=tmp_path / "home")


@pytest.fixture
def database(settings: Settings) -> Iterator[Database]:
    migrate.upgrade(settings.database_url)
    database = Database(settings.database_url)
    yield database
    database.close()


@pytest.fixture
def queue(database: Database, settings: Settings) -> tasks.DatabaseQueue:
    return tasks.DatabaseQueue(database, settings)


@pytest.fixture
def collection(database: Database) -> Collection:
    with database.write() as conn:
        return collections.create(conn, "ants")


@pytest.fixture
def upload(database: Database, collection: Collection) -> Callable[..., tuple[Shape, Task]]:
    """Adds a shape whose bytes nobody has, and the task that describes it."""
    numbers = itertools.count()

    def uploaded(**values: object) -> tuple[Shape, Task]:
        number = next(numbers)
        given = {"sha256": f"{number:064x}", "bytes": 1, "format": "ply", "name": f"shape {number}", **values}
        with database.write() as conn:
            shape, created = shapes.add(conn, collection.id, **given)  # type: ignore[arg-type]
            assert created
            task = tasks.enqueue(conn, "describe", collection_id=collection.id, shape_id=shape.id)
        return shape, task

    return uploaded
