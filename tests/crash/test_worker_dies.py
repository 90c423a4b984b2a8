"""SIGKILL to the worker, its zygote or its child, wherever that hurts most: every upload still ends, once."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest
from sqlalchemy import select

from reebase.pipeline import STAGES
from store import tables, tasks
from tests.crash.house import LEASE, alive, wait_until

CHILD_POINTS = ("child.start", *(f"child.{stage}" for stage in (*STAGES, "descriptors", "write")), "child.end")
WORKER_POINTS = ("worker.claimed", "worker.child_done", "worker.blobs_stored", "worker.rows_committed")


def await_death(*processes):
    wait_until(lambda: not any(map(alive, processes)), 5, "the death of the processes")


def only(events):
    (found,) = events
    return found


def test_the_worker_is_killed_at_every_point_of_its_own(house):
    collection = house.collection()
    uploads = [house.upload(collection, number)[1] for number in range(2)]
    for point in WORKER_POINTS:
        worker = house.start_worker(fault=f"{point}=kill")
        assert worker.end() == -signal.SIGKILL
    house.start_worker()
    house.await_end(*uploads)
    # The first was committed before the last kill; being killed after the commit is no crash of the task.
    assert [house.task(task).crashes for task in uploads] == [3, 0]
    assert {house.task(task).state for task in uploads} == {"succeeded"}
    house.check()


def test_the_worker_is_killed_while_its_child_is_at_each_stage(house, tmp_path):
    _, task = house.upload(house.collection(), 0)
    for point in CHILD_POINTS:
        held = tmp_path / point
        worker = house.start_worker(fault=f"{point}=hold:{held}")
        wait_until(held.exists, what=f"the child reaching {point}")
        child, zygote = int(held.read_text()), only(worker.events("ready"))["zygote"]
        assert alive(child)
        worker.kill()
        await_death(child, zygote)
        held.unlink()
    house.start_worker()
    house.await_end(task)
    assert house.task(task).state == "succeeded"
    assert house.task(task).crashes == len(CHILD_POINTS)
    house.check()


def test_the_child_is_killed_at_each_stage(house, tmp_path):
    _, task = house.upload(house.collection(), 0)
    faults = [f"{point}=kill@{tmp_path / point}" for point in CHILD_POINTS]
    worker = house.start_worker(fault=",".join(faults))
    house.await_end(task)
    assert house.task(task).state == "succeeded"
    assert house.task(task).crashes == len(CHILD_POINTS)
    assert worker.process.poll() is None
    house.check()


def test_the_zygote_is_killed_at_work_and_at_rest(house, tmp_path):
    collection = house.collection()
    _, first = house.upload(collection, 0)
    held = tmp_path / "held"
    worker = house.start_worker(fault=f"child.skeleton=hold:{held}@{tmp_path / 'once'}")
    zygote = only(worker.events("ready"))["zygote"]
    wait_until(held.exists)
    child = int(held.read_text())
    os.kill(zygote, signal.SIGKILL)
    await_death(child)
    (task,) = house.await_end(first)
    assert (task.state, task.crashes) == ("succeeded", 1)
    (zygote,) = children_of(worker.pid)
    os.kill(zygote, signal.SIGKILL)
    (task,) = house.await_end(house.upload(collection, 1)[1])
    assert (task.state, task.crashes) == ("succeeded", 0)
    house.check()


def children_of(process):
    listed = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    return [int(child) for child in listed if alive(int(child))]


def test_a_task_that_kills_its_worker_is_given_up_and_the_queue_goes_on(build):
    house = build(max_crashes=2)
    collection = house.collection()
    _, deadly = house.upload(collection, 0)
    for _ in range(2):
        assert house.start_worker(fault="worker.claimed=kill").end() == -signal.SIGKILL
    _, other = house.upload(collection, 1)
    house.start_worker()
    deadly, other = house.await_end(deadly, other)
    assert (deadly.state, deadly.error_code, deadly.crashes) == ("failed", "worker_died", 2)
    assert other.state == "succeeded"
    house.check()


def test_memory_and_time_without_end_fail_their_task_alone(build, tmp_path):
    house = build(child_memory_bytes=512 << 20, child_cpu_seconds=2)
    collection = house.collection()
    waiting = [house.upload(collection, number)[1] for number in range(4)]
    faults = {"child.clean": "allocate", "child.operator": "spin", "child.skeleton": "crash"}
    house.start_worker(
        fault=",".join(f"{point}={action}@{tmp_path / action}" for point, action in faults.items())
    )
    ended = house.await_end(*waiting)
    codes = [task.error_code for task in ended]
    assert codes == ["out_of_memory", "timed_out", "child_crashed", None]
    assert all("message" in task.error_detail for task in ended[:3])
    assert [task.attempt for task in ended] == [1, 1, 1, 1]
    house.check()


def test_a_frozen_worker_wakes_up_too_late(house, tmp_path):
    shape, task = house.upload(house.collection(), 0)
    held = tmp_path / "held"
    frozen = house.start_worker("--name", "frozen", fault=f"worker.blobs_stored=hold:{held}")
    wait_until(held.exists)
    frozen.kill(signal.SIGSTOP)
    held.unlink()
    time.sleep(LEASE)
    house.start_worker("--name", "other")
    house.await_end(task)
    before = features_row(house, shape)
    frozen.kill(signal.SIGCONT)
    assert frozen.await_event("task_ended")["outcome"] == "lost"
    after = house.task(task)
    assert (after.state, after.attempt) == ("succeeded", 2)
    assert features_row(house, shape) == before
    house.check()


def features_row(house, shape):
    table = tables.endpoint_features
    with house.database.read() as conn:
        return conn.execute(select(table).where(table.c.shape_id == shape.id)).one()


def test_sigterm_puts_back_what_does_not_end_in_time(house, tmp_path):
    _, task = house.upload(house.collection(), 0)
    held = tmp_path / "held"
    worker = house.start_worker("--grace", "0.2", fault=f"child.clean=hold:{held}")
    wait_until(held.exists)
    child = int(held.read_text())
    worker.kill(signal.SIGTERM)
    assert worker.end() == 0
    assert not alive(child)
    found = house.task(task)
    assert (found.state, found.crashes, found.worker) == ("queued", 0, None)
    house.start_worker("--once")
    house.await_end(task)
    house.check()


def test_sigterm_lets_what_ends_in_time_end(house, tmp_path):
    _, task = house.upload(house.collection(), 0)
    worker = house.start_worker("--grace", "20", fault="child.clean=freeze:1")
    house.await_state(task, "running")
    worker.kill(signal.SIGTERM)
    assert worker.end() == 0
    assert house.task(task).state == "succeeded"
    house.check()


def test_a_worker_whose_starter_died_stops(house):
    reader, writer = os.pipe()
    worker = house.start_worker(stdin=reader, REEBASE_LIFELINE="1")
    os.close(reader)
    os.close(writer)
    assert worker.end() == 0


@pytest.mark.parametrize("state", ["running", "queued"])
def test_a_cancelled_task_ends_as_cancelled(house, tmp_path, state):
    from store import tasks

    _, task = house.upload(house.collection(), 0)
    if state == "running":
        held = tmp_path / "held"
        house.start_worker(fault=f"child.clean=hold:{held}")
        wait_until(held.exists)
        child = int(held.read_text())
    with house.database.write() as conn:
        tasks.cancel(conn, task.id)
    (ended,) = house.await_end(task)
    assert ended.state == "cancelled"
    if state == "running":
        assert not alive(child)
    house.check()


def test_the_worker_is_killed_while_it_fills_a_collection(house):
    collection = house.collection()
    options = {"per_class": 1, "classes": ["snakes", "pliers"], "seed": 0}
    with house.database.write() as conn:
        params = {"synthetic": options, "owner": None}
        filling = tasks.enqueue(conn, "synthesise", collection_id=collection.id, params=params)
    for _ in range(2):
        worker = house.start_worker(fault="worker.blobs_stored=kill")
        assert worker.end() == -signal.SIGKILL
    house.start_worker()
    house.await_end(filling)
    assert (house.task(filling).state, house.task(filling).crashes) == ("succeeded", 2)
    with house.database.read() as conn:
        made = conn.execute(select(tables.shape.c.name, tables.shape.c.task_id)).all()
        descriptions = [tasks.get(conn, row.task_id) for row in made]
    assert sorted(row.name for row in made) == ["pliers-00", "snakes-00"]
    house.await_end(*descriptions)
    house.check()
