"""Queries and evaluations whose worker dies are done again, and leave nothing half done."""

from __future__ import annotations

import signal

from sqlalchemy import func, select

from store import evaluations, results, tables, tasks
from store.answers import QuerySpec
from tests.crash.house import alive, mesh_bytes, wait_until


def test_a_query_outlives_its_worker_and_leaves_no_blob_behind(house, tmp_path):
    collection = house.collection()
    waiting = [house.upload(collection, number)[1] for number in range(2)]
    upload = house.blobs.put_if_absent(mesh_bytes(99))
    with house.database.write() as conn:
        params = {**QuerySpec(collection.name, tolerance=None).to_params(), "format": "ply"}
        query = tasks.enqueue(conn, "query", collection_id=collection.id, params=params, blob=upload)
    # A query goes before what is older, so the first claim is the query's.
    worker = house.start_worker(fault="worker.child_done=kill")
    assert worker.end() == -signal.SIGKILL
    house.start_worker()
    ended, *_ = house.await_end(query, *waiting)
    assert (ended.state, ended.crashes) == ("succeeded", 1)
    assert ended.result["query"]["endpoint_count"] == len(ended.result["query"]["features"])
    with house.database.read() as conn:
        shapes = conn.execute(select(func.count()).select_from(tables.shape)).scalar_one()
    assert shapes == 2, "a query is not indexed"
    house.sweep(grace_seconds=0)
    assert not house.blobs.exists(upload)
    house.check()


def test_an_evaluation_outlives_its_worker(house):
    collection = house.collection()
    labels = ("cat", "cat", "dog", "dog", None)
    waiting = [house.upload(collection, n, label=label)[1] for n, label in enumerate(labels)]
    house.start_worker("--once").end(60)
    house.await_end(*waiting)
    with house.database.write() as conn:
        params = {"collection": collection.name, "measure": "matching", "bootstrap": 50}
        made = evaluations.create(conn, params=params, collection_id=collection.id)
    for point in ("worker.child_done", "worker.blobs_stored"):
        assert house.start_worker(fault=f"{point}=kill").end() == -signal.SIGKILL
    house.start_worker()
    (task,) = house.await_end(made.task)
    assert (task.state, task.crashes) == ("succeeded", 2)
    with house.database.read() as conn:
        found = evaluations.get(conn, made.id)
        known = results.labelled(conn, collection.id, collection.profile_key)
    assert [item["id"] for item in found.items] == known.ids
    assert set(found.report["overall"]) == {"nn", "first_tier", "second_tier", "e_measure", "dcg", "map"}
    rows = [*evaluations.matrix_rows(house.blobs, evaluations.matrix_of(found))]
    assert [row.shape for row in rows] == [(4,)] * 4


def test_an_evaluation_of_the_synthetic_set_tells_its_progress_and_is_cancelled_between_shapes(house):
    with house.database.write() as conn:
        params = {"synthetic": {"per_class": 3, "seed": 1, "classes": ["ants", "snakes"]}, "bootstrap": 20}
        made = evaluations.create(conn, params=params)
        doomed = evaluations.create(conn, params={"synthetic": {"per_class": 100}})
    worker = house.start_worker()
    (task,) = house.await_end(made.task, seconds=120)
    assert task.state == "succeeded"
    with house.database.read() as conn:
        found = evaluations.get(conn, made.id)
    assert [item["label"] for item in found.items] == ["ants"] * 3 + ["snakes"] * 3
    assert found.report["failed"] == []

    def begun():
        stage = house.task(doomed.task).stage or ""
        return stage.endswith(" of 1000") and not stage.startswith("shape 1 of")

    wait_until(begun, 60, "the second shape")
    with house.database.write() as conn:
        tasks.cancel(conn, doomed.task.id)
    (task,) = house.await_end(doomed.task)
    assert task.state == "cancelled"
    assert alive(worker.pid)
