"""What a map is of: a sample of the shapes that are there and described as the collection wants it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from reebase.pipeline import Profile
from reebase.ranking import ranking_named
from store import collections, maps, results, shapes, tasks
from store.engine import Database
from store.records import Collection, Shape, Task
from tests.unit.store.descriptions import description

MOST = 4


def test_the_sample_is_of_the_shapes_that_a_map_can_show(
    database: Database, queue: tasks.DatabaseQueue, collection: Collection, upload: Callable[..., tuple[Shape, Task]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(maps, "MOST", MOST)
    made = [upload()[0].id for _ in range(20)]
    for _ in made:
        task = queue.claim("w")
        assert task is not None
        with database.write() as conn:
            results.store_description(
                conn, task, description(np.ones((2, 3))), cleaned_sha256="e" * 64, denoised_sha256="e" * 64
            )

    def mapped() -> maps.Mapped:
        with database.read() as conn:
            return maps.mapped(conn, collections.get(conn, collection.name), ranking_named("srg"))

    first = mapped()
    assert (len(first.ids), first.left_out) == (MOST, 16)
    with database.write() as conn:
        for shape in first.ids[:2]:
            shapes.delete(conn, collection.id, shape)
    second = mapped()
    # Others take the places of those that went; those that are still there stay.
    assert (len(second.ids), second.left_out) == (MOST, 14)
    assert set(first.ids[2:]) <= set(second.ids) and not set(first.ids[:2]) & set(second.ids)
    with database.write() as conn:
        changed = collections.update(conn, collection.name, profile={"bands": 17})
    assert (mapped().ids, mapped().left_out) == ([], 0)
    left = [shape for shape in made if shape not in second.ids and shape not in first.ids][:3]
    while (task := queue.claim("w")) is not None:
        if task.shape_id in left:
            with database.write() as conn:
                found = description(np.ones((2, 3)), Profile(**changed.profile))
                results.store_description(conn, task, found, cleaned_sha256="e" * 64, denoised_sha256="e" * 64)
    assert (set(mapped().ids), mapped().left_out) == (set(left), 0)
