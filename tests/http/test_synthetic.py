"""The synthetic set at one stroke: shapes appear, are described, and are not made twice."""

from __future__ import annotations

import time
from pathlib import Path

import httpx

from store import keys
from tests.http.serving import whole_service
from tests.http.test_main_job import ended
from tests.http.test_problems import is_problem

SET = {"per_class": 2, "seed": 7, "classes": ["snakes", "pliers"]}


def test_a_collection_fills_on_its_own(http: httpx.Client, collection: str) -> None:
    asked = http.post(f"{collection}/synthetic", json=SET)
    assert (asked.status_code, asked.json()["kind"]) == (202, "synthesise")
    task = ended(http, asked.json()["id"])
    assert asked.headers["location"] == f"/v1/tasks/{task['id']}"
    assert (task["state"], task["result"]) == ("succeeded", {"shapes": 4, "created": 4})
    end = time.monotonic() + 60
    while http.get(collection).json()["counts"]["states"].get("indexed") != 4:
        assert time.monotonic() < end
        time.sleep(0.1)
    found = http.get(f"{collection}/shapes").json()["items"]
    # One of each class first.
    assert [shape["name"] for shape in found] == ["snakes-00", "pliers-00", "snakes-01", "pliers-01"]
    assert {(shape["label"], *shape["tags"], shape["metadata"]["seed"]) for shape in found} == {
        ("snakes", "synthetic", 7), ("pliers", "synthetic", 7),
    }  # fmt: skip
    again = ended(http, http.post(f"{collection}/synthetic", json=SET).json()["id"])
    assert again["result"] == {"shapes": 4, "created": 0}
    assert http.get(f"{collection}/shapes").json()["total"] == 4


def test_refusals(api: httpx.Client, shelf: str) -> None:
    is_problem(api.post(f"{shelf}/synthetic", json={"classes": ["unicorns", "snakes"]}), 422, "unknown_name")
    for body in ({"per_class": 0}, {"per_class": 201}, {"classes": ["snakes"]}, {"colour": 1}):
        is_problem(api.post(f"{shelf}/synthetic", json=body), 422, "validation_error")
    is_problem(api.post("/v1/collections/absent/synthetic", json={}), 404, "collection_not_found")
    one = api.post(f"{shelf}/synthetic", json=SET, headers={"Idempotency-Key": "k"}).json()["id"]
    assert api.post(f"{shelf}/synthetic", json=SET, headers={"Idempotency-Key": "k"}).json()["id"] == one


def test_a_quota_ends_it(tmp_path: Path) -> None:
    with whole_service(tmp_path / "home") as served:
        database = served.database()
        with database.write() as conn:
            _, secret = keys.create(conn, "admin", max_shapes=3)
        database.close()
        with served.client(headers={"Authorization": f"Bearer {secret}"}) as client:
            client.post("/v1/collections", json={"name": "small"}).raise_for_status()
            asked = client.post("/v1/collections/small/synthetic", json=SET)
            task = ended(client, asked.json()["id"])
            assert (task["state"], task["error"]["code"]) == ("failed", "quota_exceeded")
            assert client.get("/v1/collections/small/shapes").json()["total"] == 3
