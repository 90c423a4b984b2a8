"""Events: how things are at first, every change that may be seen, and an end that leaks nothing."""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from store import keys, tasks
from store.settings import Settings
from tests.http.serving import Served, api_alone, whole_service
from tests.http.test_browsing import put
from tests.http.test_main_job import uploaded
from tests.http.test_problems import is_problem
from tests.shapes import capsule

Told = tuple[str, dict[str, Any], str]


def events(reply: httpx.Response) -> Iterator[Told]:
    """(name, data, id) of each event as it comes; comments are left out."""
    name, data, number = "message", "", ""
    end = time.monotonic() + 100
    for line in reply.iter_lines():
        assert time.monotonic() < end, "Only heartbeats for so long."
        field, _, value = line.partition(": ")
        if field == "event":
            name = value
        elif field == "data":
            data = value
        elif field == "id":
            number = value
        elif not line and data:
            yield name, json.loads(data), number
            name, data = "message", ""


def until(told: Iterator[Told], name: str, **wanted: Any) -> dict[str, Any]:
    """The first event of that name whose data has what is wanted."""
    for found, data, _ in told:
        if found == name and all(data.get(key) == value for key, value in wanted.items()):
            return data
    raise AssertionError(f"The stream ended before {name} {wanted}.")


def test_the_life_of_a_shape_is_told(http: httpx.Client, collection: str) -> None:
    name = collection.rpartition("/")[2]
    with http.stream("GET", "/v1/events", params={"collection": name}) as reply:
        assert reply.headers["content-type"].startswith("text/event-stream")
        assert reply.headers["cache-control"] == "no-store"
        told = events(reply)
        first, data, number = next(told)
        assert (first, data["tasks"], data["waiting"]) == ("snapshot", [], {"queued": 0, "running": 0})
        assert abs(int(number) / 1e6 - time.time()) < 60
        shape = uploaded(http, collection, capsule(length=2.5))
        done = until(told, "task", state="succeeded")
        assert (done["shape"], done["collection"]) == (shape.rpartition("/")[2], name)
        assert done["result"] is None and done["progress"]["fraction"] == 1.0
        assert until(told, "collection")["collection"] == name
        http.delete(shape)
        until(told, "collection")


def test_what_waits_is_in_the_snapshot_and_what_changes_is_told(alone: Served, api: httpx.Client, shelf: str) -> None:
    put(api, shelf, "one")
    with api.stream("GET", "/v1/events", params={"collection": shelf.rpartition("/")[2]}) as reply:
        told = events(reply)
        _, snapshot, _ = next(told)
        assert [task["state"] for task in snapshot["tasks"]] == ["queued"]
        assert snapshot["waiting"] == {"queued": 1, "running": 0}
        put(api, shelf, "two")
        second = until(told, "task", state="queued")
        assert until(told, "waiting", queued=2) == {"queued": 2, "running": 0}
        database = alone.database()
        queue = tasks.DatabaseQueue(database, Settings(home=alone.home))
        while (held := queue.claim("w")) is not None and held.id != second["id"]:
            pass
        assert held is not None
        queue.heartbeat(held, "eigenpairs", 0.6)
        running = until(told, "task", id=held.id, state="running", progress={"stage": "eigenpairs", "fraction": 0.6})
        assert running["error"] is None
        with database.write() as conn:
            tasks.fail(conn, held, "broken", "It is broken.")
        failed = until(told, "task", id=held.id, state="failed")
        assert failed["error"]["code"] == "broken"
        database.close()


def test_other_collections_and_tasks_are_not_told(api: httpx.Client, shelf: str) -> None:
    other = "/v1/collections/not-told"
    api.post("/v1/collections", json={"name": "not-told"}).raise_for_status()
    shape = put(api, shelf, "mine")
    task = api.get(f"{shelf}/shapes/{shape}").json()["task"]
    with (
        api.stream("GET", "/v1/events", params={"collection": shelf.rpartition("/")[2]}) as one,
        api.stream("GET", "/v1/events", params={"task": task}) as two,
    ):
        of_collection, of_task = events(one), events(two)
        next(of_collection)
        assert [found["id"] for found in next(of_task)[1]["tasks"]] == [task]
        put(api, other, "not mine")
        again = put(api, shelf, "mine again")
        assert until(of_collection, "task")["shape"] == again
        api.post(f"/v1/tasks/{task}/cancel").raise_for_status()
        assert until(of_task, "task") == {**api.get(f"/v1/tasks/{task}").json()}


def test_whoever_comes_back_hears_what_ended_meanwhile(api: httpx.Client, shelf: str) -> None:
    name = shelf.rpartition("/")[2]
    shape = put(api, shelf, "one")
    task = api.get(f"{shelf}/shapes/{shape}").json()["task"]
    with api.stream("GET", "/v1/events", params={"collection": name}) as reply:
        _, _, number = next(events(reply))
    api.post(f"/v1/tasks/{task}/cancel").raise_for_status()
    asked = {"params": {"collection": name}}
    with api.stream("GET", "/v1/events", headers={"Last-Event-ID": number}, **asked) as reply:
        told = events(reply)
        assert next(told)[0] == "snapshot"
        assert until(told, "task")["id"] == task
    for wrong in ("yesterday", "-1", "9" * 18):
        refused = api.get("/v1/events", headers={"Last-Event-ID": wrong}, **asked)
        is_problem(refused, 422, "validation_error")


def test_refusals(api: httpx.Client) -> None:
    is_problem(api.get("/v1/events", params={"collection": "absent"}), 404, "collection_not_found")
    is_problem(api.get("/v1/events", params={"task": "absent"}), 404, "task_not_found")
    is_problem(api.get("/v1/events", params={"collection": "No Name"}), 422, "validation_error")


def test_a_stream_ends_after_its_time_and_places_are_given_back(tmp_path: Path) -> None:
    with api_alone(tmp_path, max_streams=2, max_stream_seconds=0.6) as served, served.client() as client:
        for _ in range(3):
            with client.stream("GET", "/v1/events") as one, client.stream("GET", "/v1/events"):
                refused = client.get("/v1/events")
                is_problem(refused, 503, "too_many_streams")
                assert refused.headers["retry-after"] == "5"
                assert [name for name, *_ in events(one)] == ["snapshot", "bye"]
            # Left without reading: the place is free as soon as the service notices.
            end = time.monotonic() + 5
            while client.get("/v1/events").status_code != 200:
                assert time.monotonic() < end


def test_a_key_hears_of_its_own_collection_alone(tmp_path: Path) -> None:
    with api_alone(tmp_path, require_keys=True) as served:
        database = served.database()
        with database.write() as conn:
            admin = keys.create(conn, "admin")[1]
        with served.client(headers={"Authorization": f"Bearer {admin}"}) as client:
            for name in ("mine", "yours"):
                client.post("/v1/collections", json={"name": name}).raise_for_status()
            with database.write() as conn:
                secret = keys.create(conn, "read", "mine")[1]
            database.close()
            with served.client(headers={"Authorization": f"Bearer {secret}"}) as reader:
                assert reader.get("/v1/events", params={"collection": "yours"}).status_code == 403
                with reader.stream("GET", "/v1/events") as reply:
                    told = events(reply)
                    next(told)
                    put(client, "/v1/collections/yours", "secret")
                    put(client, "/v1/collections/mine", "open")
                    assert until(told, "task")["collection"] == "mine"
        with served.client() as nobody:
            is_problem(nobody.get("/v1/events"), 401, "missing_key")


def test_streams_do_not_hold_up_the_end(tmp_path: Path) -> None:
    with whole_service(tmp_path / "home") as served, served.client() as client:
        assert served.process is not None
        names: list[str] = []
        opened = threading.Event()

        def listen() -> None:
            with client.stream("GET", "/v1/events") as reply:
                for name, *_ in events(reply):
                    names.append(name)
                    opened.set()

        listener = threading.Thread(target=listen)
        listener.start()
        assert opened.wait(10)
        began = time.monotonic()
        os.kill(served.process.pid, signal.SIGTERM)
        listener.join(10)
        served.process.wait(20)
        assert time.monotonic() - began < 10
        assert names == ["snapshot", "bye"]
        assert served.process.returncode == 0


@pytest.mark.parametrize("count", [30])
def test_a_reader_that_is_too_slow_is_told_to_start_over(count: int) -> None:
    import asyncio
    from datetime import UTC, datetime

    from service.events import Event, EventHub, Scope

    async def flood() -> list[str]:
        hub = EventHub.__new__(EventHub)
        hub.subscriptions = set()
        from service.events import Subscription

        slow = Subscription(hub, Scope(lambda _: True), queue=asyncio.Queue(10))
        moment = datetime.now(UTC)
        for number in range(count):
            slow.tell(Event("task", {"number": number}, moment))
        return [slow.queue.get_nowait().name for _ in range(slow.queue.qsize())]

    names = asyncio.run(flood())
    assert names[0] == "reset" and len(names) <= 10
