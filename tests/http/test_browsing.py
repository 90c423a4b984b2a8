"""Looking through a collection and changing many shapes at once: order, filters, labels, deletion and its undoing."""

from __future__ import annotations

import itertools
from datetime import UTC, datetime, timedelta
from typing import Any

import httpx
import pytest

from reebase.mesh.write import to_bytes
from tests.http.serving import Served
from tests.http.test_main_job import indexed, uploaded
from tests.http.test_problems import is_problem
from tests.shapes import capsule, moved

_sizes = itertools.count(1)


def put(api: httpx.Client, shelf: str, name: str, label: str | None = None, **fields: Any) -> str:
    """The id of a new shape."""
    mesh = capsule(length=2.0 + next(_sizes) / 64)
    given = {"name": name, **({} if label is None else {"label": label}), **fields}
    return uploaded(api, shelf, mesh, **given).rpartition("/")[2]


@pytest.fixture
def shelved(api: httpx.Client, shelf: str) -> dict[str, str]:
    """name -> id of five shapes that wait."""
    rows = [("delta", "ants"), ("Alpha", None), ("charlie", "Bees"), ("bravo", "ants"), ("echo 100%", None)]
    return {name: put(api, shelf, name, label) for name, label in rows}


def names(api: httpx.Client, shelf: str, **asked: Any) -> list[str]:
    reply = api.get(f"{shelf}/shapes", params=asked)
    assert reply.status_code == 200, reply.text
    return [shape["name"] for shape in reply.json()["items"]]


@pytest.mark.parametrize(
    ("sort", "expected"),
    [
        ("created", ["delta", "Alpha", "charlie", "bravo", "echo 100%"]),
        ("name", ["Alpha", "bravo", "charlie", "delta", "echo 100%"]),
        ("label", ["Alpha", "echo 100%", "delta", "bravo", "charlie"]),
        ("endpoints", ["delta", "Alpha", "charlie", "bravo", "echo 100%"]),
    ],
)
def test_orders_and_their_pages(
    api: httpx.Client, shelf: str, shelved: dict[str, str], sort: str, expected: list[str]
) -> None:
    for order, wanted in ((sort, expected), (f"-{sort}", expected[::-1])):
        assert names(api, shelf, sort=order) == wanted
        walked: list[str] = []
        cursor = None
        for _ in range(3):
            asked = {"sort": order, "limit": 2, **({} if cursor is None else {"cursor": cursor})}
            page = api.get(f"{shelf}/shapes", params=asked).json()
            walked += [shape["name"] for shape in page["items"]]
            assert page["total"] == 5
            cursor = page["next"]
        assert (walked, cursor) == (wanted, None)


def test_a_cursor_belongs_to_its_order(api: httpx.Client, shelf: str, shelved: dict[str, str]) -> None:
    cursor = api.get(f"{shelf}/shapes", params={"sort": "name", "limit": 1}).json()["next"]
    for sort in ("-name", "label", "bytes"):
        refused = api.get(f"{shelf}/shapes", params={"sort": sort, "cursor": cursor})
        is_problem(refused, 400, "invalid_cursor")
    is_problem(api.get(f"{shelf}/shapes", params={"sort": "beauty"}), 422, "validation_error")


def test_filters_by_text_and_by_want_of_a_label(api: httpx.Client, shelf: str, shelved: dict[str, str]) -> None:
    assert names(api, shelf, text="ALPHA") == ["Alpha"]
    assert names(api, shelf, text="bee") == ["charlie"]
    # The signs of SQL's patterns stand for themselves.
    assert names(api, shelf, text="%") == ["echo 100%"]
    assert names(api, shelf, text="_") == []
    assert names(api, shelf, unlabelled=True, sort="name") == ["Alpha", "echo 100%"]
    assert names(api, shelf, label="ants", text="r") == ["bravo"]
    assert api.get(f"{shelf}/shapes", params={"unlabelled": True, "limit": 1}).json()["total"] == 2


def test_labels_and_labelling_many(api: httpx.Client, shelf: str, shelved: dict[str, str]) -> None:
    def labels() -> list[tuple[str | None, int]]:
        return [(row["label"], row["shapes"]) for row in api.get(f"{shelf}/labels").json()["items"]]

    assert labels() == [(None, 2), ("ants", 2), ("Bees", 1)]
    some = [shelved["Alpha"], shelved["charlie"], "absent"]
    assert api.post(f"{shelf}/bulk/label", json={"shapes": some, "label": "wasps"}).json() == {"labelled": 2}
    assert labels() == [("ants", 2), ("wasps", 2), (None, 1)]
    assert api.post(f"{shelf}/bulk/label", json={"shapes": some, "label": None}).json() == {"labelled": 2}
    assert labels() == [(None, 3), ("ants", 2)]
    long = api.post(f"{shelf}/bulk/label", json={"shapes": some, "label": "x" * 201})
    assert is_problem(long, 422, "validation_error")["errors"][0]["pointer"] == "/label"
    for body in ({"shapes": [], "label": "a"}, {"shapes": ["a"] * 1001, "label": "a"}, {"shapes": some}):
        is_problem(api.post(f"{shelf}/bulk/label", json=body), 422, "validation_error")


def test_deleting_many_and_undoing_it(api: httpx.Client, shelf: str, shelved: dict[str, str]) -> None:
    gone = [shelved["delta"], shelved["bravo"]]
    before = {shape: api.get(f"{shelf}/shapes/{shape}").json() for shape in gone}
    deleted = api.post(f"{shelf}/bulk/delete", json={"shapes": [*gone, "absent"]}).json()
    assert sorted(deleted["deleted"]) == sorted(gone)
    left = datetime.fromisoformat(deleted["restorable_until"]) - datetime.now(UTC)
    assert timedelta(hours=23) < left <= timedelta(hours=24)
    assert names(api, shelf, sort="name") == ["Alpha", "charlie", "echo 100%"]
    assert api.get(shelf).json()["counts"]["shapes"] == 3
    for shape in gone:
        is_problem(api.get(f"{shelf}/shapes/{shape}"), 404, "shape_not_found")
        is_problem(api.delete(f"{shelf}/shapes/{shape}"), 404, "shape_not_found")
    assert {api.get(f"/v1/tasks/{shape['task']}").json()["state"] for shape in before.values()} == {"cancelled"}
    restored = api.post(f"{shelf}/bulk/restore", json={"shapes": [*gone, "absent"]}).json()
    assert restored["restored"] == gone
    assert [(one["shape"], one["code"]) for one in restored["refused"]] == [("absent", "shape_not_found")]
    for shape in gone:
        now = api.get(f"{shelf}/shapes/{shape}").json()
        changed = {name for name, value in now.items() if value != before[shape][name]}
        assert changed == {"task", "updated_at"} and now["state"] == "queued"


def test_bytes_that_were_uploaded_again_forbid_restoring(api: httpx.Client, shelf: str) -> None:
    data = to_bytes(capsule(), "ply")
    first = api.post(f"{shelf}/shapes", content=data).json()["shape"]["id"]
    assert api.delete(f"{shelf}/shapes/{first}").status_code == 204
    again = api.post(f"{shelf}/shapes", content=data)
    second = again.json()["shape"]["id"]
    assert (again.status_code, second != first) == (202, True)
    refused = is_problem(api.post(f"{shelf}/shapes/{first}/restore"), 409, "shape_exists")
    assert refused["details"]["shape"] == second
    assert api.post(f"{shelf}/bulk/restore", json={"shapes": [first]}).json()["refused"][0]["code"] == "shape_exists"
    api.delete(f"{shelf}/shapes/{second}")
    assert api.post(f"{shelf}/shapes/{first}/restore").json()["id"] == first
    # A shape that is there is restored already.
    assert api.post(f"{shelf}/shapes/{first}/restore").status_code == 200


def test_a_collection_does_not_restore_the_shapes_of_another(api: httpx.Client, shelf: str) -> None:
    other = "/v1/collections/elsewhere"
    api.post("/v1/collections", json={"name": "elsewhere"}).raise_for_status()
    shape = put(api, other, "stranger")
    deleted = api.post(f"{shelf}/bulk/delete", json={"shapes": [shape]}).json()
    assert deleted["deleted"] == []
    assert api.post(f"{shelf}/bulk/label", json={"shapes": [shape], "label": "a"}).json() == {"labelled": 0}
    assert api.get(f"{other}/shapes/{shape}").status_code == 200
    api.delete(f"{other}/shapes/{shape}")
    is_problem(api.post(f"{shelf}/shapes/{shape}/restore"), 404, "shape_not_found")


def test_a_deleted_shape_is_no_hit_until_it_is_restored(http: httpx.Client, collection: str) -> None:
    meshes = [moved(capsule(length=length), seed=1) for length in (2.0, 2.1, 2.2)]
    one, two, three = (uploaded(http, collection, mesh, label="a") for mesh in meshes)
    for shape in (one, two, three):
        indexed(http, shape)

    def hits() -> set[str]:
        asked = {"shape": one.rpartition("/")[2], "k": 10}
        return {hit["shape"]["id"] for hit in http.post(f"{collection}/query", json=asked).json()["hits"]}

    gone = two.rpartition("/")[2]
    assert gone in hits()
    http.delete(two)
    assert gone not in hits() and len(hits()) == 1
    is_problem(http.post(f"{collection}/query", json={"shape": gone}), 404, "shape_not_found")
    restored = http.post(f"{two}/restore").json()
    assert (restored["state"], restored["endpoint_count"]) == ("indexed", 2)
    assert gone in hits()


def test_what_was_deleted_is_swept_away_in_the_end(alone: Served, api: httpx.Client, shelf: str) -> None:
    from store import sweep
    from store.settings import Settings

    shape = put(api, shelf, "old")
    sha256 = api.get(f"{shelf}/shapes/{shape}").json()["sha256"]
    api.delete(f"{shelf}/shapes/{shape}")
    eager = Settings(home=alone.home, sweep_grace_seconds=0.0)
    database, blobs = alone.database(), alone.blobs()
    sweep.sweep(database, blobs, eager)
    assert blobs.exists(sha256)
    swept = sweep.sweep(database, blobs, eager.model_copy(update={"keep_deleted_seconds": -1.0}))
    assert swept.shapes >= 1 and not blobs.exists(sha256)
    database.close()
    is_problem(api.post(f"{shelf}/shapes/{shape}/restore"), 404, "shape_not_found")
