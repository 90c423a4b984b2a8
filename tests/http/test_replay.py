"""Sending twice and reading again: Idempotency-Key, ETag, cursors, and downloads by their names."""

from __future__ import annotations

import hashlib
import io
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from reebase.mesh.write import to_bytes
from service.conditional import matches
from service.downloads import attachment
from store import evaluations, results, tasks
from store.settings import Settings
from tests.http.serving import Served, api_alone
from tests.http.test_problems import is_problem
from tests.http.test_uploads import different
from tests.shapes import icosphere
from tests.unit.store.descriptions import description

KEY = {"Idempotency-Key": "once"}


def test_a_repeated_request_gets_the_first_answer(api: httpx.Client, shelf: str) -> None:
    body = {"collection": shelf.rsplit("/", maxsplit=1)[-1], "bootstrap": 5}
    first = api.post("/v1/evaluations", json=body, headers=KEY)
    second = api.post("/v1/evaluations", json=dict(reversed(body.items())), headers=KEY)
    assert first.status_code == second.status_code == 202
    assert second.content == first.content
    assert second.headers["location"] == first.headers["location"]
    assert "idempotency-replayed" not in first.headers
    assert second.headers["idempotency-replayed"] == "true"
    is_problem(api.post("/v1/evaluations", json={**body, "bootstrap": 6}, headers=KEY), 409, "idempotency_conflict")
    other = api.post("/v1/evaluations", json=body, headers={"Idempotency-Key": "other"})
    assert other.json()["id"] != first.json()["id"]


def test_making_a_collection_twice_with_one_key(api: httpx.Client) -> None:
    made = [api.post("/v1/collections", json={"name": "twice"}, headers=KEY) for _ in range(2)]
    assert [reply.status_code for reply in made] == [201, 201]
    assert made[0].content == made[1].content


def test_a_repeated_upload(api: httpx.Client, shelf: str) -> None:
    form: dict[str, Any] = {"files": {"file": ("a.ply", different(21))}, "data": {"label": "a"}}
    first, second = (api.post(f"{shelf}/shapes", headers=KEY, **form) for _ in range(2))
    assert first.status_code == second.status_code == 202
    assert first.content == second.content
    reply = api.post(f"{shelf}/shapes", headers=KEY, files=form["files"], data={"label": "b"})
    is_problem(reply, 409, "idempotency_conflict")


def test_a_repeated_query_by_mesh_is_one_task(api: httpx.Client, shelf: str) -> None:
    path = f"{shelf}/query?wait=0"
    first, second = (api.post(path, content=different(22), headers=KEY) for _ in range(2))
    assert first.status_code == second.status_code == 202
    assert first.json()["task"]["id"] == second.json()["task"]["id"]
    assert second.headers["idempotency-replayed"] == "true"


def test_the_mesh_of_a_query_is_kept_only_while_its_task_lives(
    alone: Served, api: httpx.Client, shelf: str
) -> None:
    path, mesh, blobs = f"{shelf}/query?wait=0", different(24), alone.blobs()
    sha256 = hashlib.sha256(mesh).hexdigest()
    task = api.post(path, content=mesh, headers=KEY).json()["task"]["id"]
    assert blobs.exists(sha256)
    other = different(25)
    is_problem(api.post(path, content=other, headers=KEY), 409, "idempotency_conflict")
    assert not blobs.exists(hashlib.sha256(other).hexdigest())
    api.post(f"/v1/tasks/{task}/cancel").raise_for_status()
    assert not blobs.exists(sha256)
    is_problem(api.post(path, content=mesh, headers=KEY), 409, "task_cancelled")
    assert not blobs.exists(sha256)


def test_a_refused_request_leaves_its_key_free(api: httpx.Client) -> None:
    headers = {"Idempotency-Key": "refused"}
    is_problem(api.post("/v1/evaluations", json={"collection": "later"}, headers=headers), 404,
               "collection_not_found")  # fmt: skip
    api.post("/v1/collections", json={"name": "later"}).raise_for_status()
    assert api.post("/v1/evaluations", json={"collection": "later"}, headers=headers).status_code == 202


@pytest.mark.parametrize("key", ["", "x" * 256, "a b"])
def test_keys_that_are_not_allowed(api: httpx.Client, key: str) -> None:
    reply = api.post("/v1/collections", json={"name": "never"}, headers={"Idempotency-Key": key})
    is_problem(reply, 422, "validation_error")


@pytest.mark.parametrize(
    "path", ["/v1/collections", "/v1/limits", "{shelf}", "{shelf}/shapes", "{shape}", "{shape}/original", "/v1/tasks"]
)
def test_reads_have_tags(api: httpx.Client, shelf: str, path: str) -> None:
    shape = api.post(f"{shelf}/shapes", content=different(23)).headers["location"]
    path = path.format(shelf=shelf, shape=shape)
    first = api.get(path)
    again = api.get(path, headers={"If-None-Match": f'"x", {first.headers["etag"]}'})
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["etag"] == first.headers["etag"]
    assert api.get(path, headers={"If-None-Match": '"x"'}).status_code == 200


def test_a_tag_changes_with_what_it_names(api: httpx.Client, shelf: str) -> None:
    before = api.get(shelf).headers["etag"]
    api.patch(shelf, json={"description": "other"}).raise_for_status()
    assert api.get(shelf, headers={"If-None-Match": before}).status_code == 200


@pytest.mark.parametrize(
    ("header", "hit"),
    [(None, False), ('"a"', True), ('W/"a"', True), ('"b", "a"', True), ("*", True), ('"b"', False), ("a", False)],
)
def test_matches(header: str | None, hit: bool) -> None:
    assert matches(header, '"a"') is hit


@pytest.mark.parametrize(
    ("filename", "header"),
    [
        ("ball.ply", 'attachment; filename="ball.ply"'),
        ("Kügelchen.ply", "attachment; filename=\"K_gelchen.ply\"; filename*=UTF-8''K%C3%BCgelchen.ply"),
        ('a"; x="\r\nX: y', "attachment; filename=\"a__ x____X_ y\"; filename*=UTF-8''a%22%3B%20x%3D%22%0D%0AX%3A%20y"),
        ("...", "attachment; filename=\"shape\"; filename*=UTF-8''..."),
    ],
)  # fmt: skip
def test_names_of_downloads(filename: str, header: str) -> None:
    assert attachment(filename) == header


def test_the_original_bytes(api: httpx.Client, shelf: str) -> None:
    data = different(24)
    reply = api.post(f"{shelf}/shapes", files={"file": ("Kügelchen.ply", data)})
    found = api.get(reply.headers["location"] + "/original")
    assert found.content == data
    assert found.headers["content-type"] == "application/octet-stream"
    assert "filename*=UTF-8''K%C3%BCgelchen.ply" in found.headers["content-disposition"]
    assert "sandbox" in found.headers["content-security-policy"]


def test_pages(api: httpx.Client, shelf: str) -> None:
    made = [api.post(f"{shelf}/shapes", content=different(i)).json()["shape"]["id"] for i in range(30, 35)]
    found: list[str] = []
    cursor: dict[str, str] = {}
    while True:
        page = api.get(f"{shelf}/shapes", params={"limit": 2, **cursor}).json()
        found += [shape["id"] for shape in page["items"]]
        if page["next"] is None:
            break
        assert len(page["items"]) == 2
        cursor = {"cursor": page["next"]}
    assert found == made


def test_filters(api: httpx.Client, shelf: str) -> None:
    for number, (label, tags) in enumerate([("a", "x,y"), ("a", "x"), ("b", "x,y"), (None, "")]):
        data = {"tags": tags} | ({"label": label} if label else {})
        api.post(f"{shelf}/shapes", files={"file": different(40 + number)}, data=data).raise_for_status()

    def count(**asked: Any) -> int:
        return len(api.get(f"{shelf}/shapes", params=asked).json()["items"])

    assert [count(), count(label="a"), count(tag="x"), count(tag=["x", "y"])] == [4, 2, 3, 2]
    assert [count(label="a", tag="y"), count(state="queued"), count(state="indexed")] == [1, 4, 0]
    is_problem(api.get(f"{shelf}/shapes", params={"state": "asleep"}), 422, "validation_error")


def test_changing_a_shape(api: httpx.Client, shelf: str) -> None:
    path = api.post(f"{shelf}/shapes", content=different(50), params={"label": "a"}).headers["location"]
    changed = api.patch(path, json={"name": "b", "label": None, "tags": ["y", "x"], "metadata": {"n": 1.5}}).json()
    assert (changed["name"], changed["label"], changed["metadata"]) == ("b", None, {"n": 1.5})
    assert changed["tags"] == ["x", "y"]
    assert api.patch(path, json={"name": "c"}).json()["tags"] == ["x", "y"]
    for body in ({}, {"name": None}, {"state": "indexed"}, {"tags": ["\n"]}, {"label": "x" * 201}):
        is_problem(api.patch(path, json=body), 422, "validation_error")


def test_head_is_get_without_the_body(api: httpx.Client, shelf: str) -> None:
    shape = api.post(f"{shelf}/shapes", content=different(60)).headers["location"]
    for path in (shelf, shape, f"{shape}/original", "/", "/readyz"):
        whole, head = api.get(path), api.head(path)
        assert (head.status_code, head.content) == (200, b"")
        for name in ("content-length", "content-type", "etag"):
            assert head.headers.get(name) == whole.headers.get(name), (path, name)
    assert api.head(f"{shelf}/absent").status_code == 404


def test_what_is_unchanged_is_not_even_read(tmp_path: Path) -> None:
    """A client that has a mesh, a field or a matrix gets 304 although the blob behind it is gone."""
    ball = to_bytes(icosphere(1), "ply", scalars={"phi2": np.arange(42.0)})
    with api_alone(tmp_path) as served, served.client() as client:
        client.post("/v1/collections", json={"name": "c"}).raise_for_status()
        shape = client.post("/v1/collections/c/shapes", content=ball).headers["location"]
        evaluation = client.post("/v1/evaluations", json={"collection": "c"}).headers["location"]
        database, blobs = served.database(), served.blobs()
        queue = tasks.DatabaseQueue(database, Settings(home=served.home))
        put, matrix = blobs.put_if_absent(ball), io.BytesIO()
        np.save(matrix, np.array([[0.0, 0.25], [0.25, 0.0]]))
        rows = blobs.put_if_absent(matrix.getvalue())
        first, second = queue.claim("w"), queue.claim("w")
        assert first is not None and second is not None
        with database.write() as conn:
            described = description(np.ones((2, 3)))
            results.store_description(conn, first, described, cleaned_sha256=put, denoised_sha256=put)
            items = [{"id": "é", "name": "a", "label": "x"}, {"id": "b", "name": "b", "label": "x"}]
            evaluations.complete(conn, second, {}, items=items, matrix_sha256=rows)
        found = client.get(f"{evaluation}/matrix").json()
        assert (found["items"], found["matrix"]) == (items, [[0.0, 0.25], [0.25, 0.0]])
        assert client.get(f"{shape}/field").json()["values"] == list(range(42))
        paths = [f"{shape}/mesh", f"{shape}/mesh?format=obj", f"{shape}/field", f"{evaluation}/matrix"]
        tags = [client.get(path).headers["etag"] for path in paths]
        assert len(set(tags)) == len(paths)
        for sha256 in (put, rows):
            assert blobs.delete(sha256)
        for path, tag in zip(paths, tags, strict=True):
            assert client.get(path, headers={"If-None-Match": tag}).status_code == 304
            is_problem(client.get(path), 500, "blob_not_found")
        database.close()


def test_deleting(api: httpx.Client, alone: Served, shelf: str) -> None:
    path = api.post(f"{shelf}/shapes", content=different(51)).headers["location"]
    task = api.get(path).json()["task"]
    assert api.delete(path).status_code == 204
    is_problem(api.get(path), 404, "shape_not_found")
    assert api.get(f"/v1/tasks/{task}").json()["state"] == "cancelled"
    api.post(f"{shelf}/shapes", content=different(51)).raise_for_status()
    assert api.delete(shelf).status_code == 204
    is_problem(api.get(shelf), 404, "collection_not_found")


def test_times_are_utc(api: httpx.Client, shelf: str) -> None:
    stamp = api.get(shelf).json()["created_at"]
    assert stamp.endswith("Z")
    assert abs((datetime.now(UTC) - datetime.fromisoformat(stamp)).total_seconds()) < 60


def test_pages_for_people(api: httpx.Client) -> None:
    page = api.get("/").text
    assert "<script>" not in page and "style=" not in page and "onclick" not in page
    for path in ("/page/main.js", "/page/style/page.css", "/page/icon.svg"):
        assert path in page
        assert api.get(path).status_code == 200
    reference = api.get("/docs").text
    assert "uploadShape" in reference and "too_many_bytes" in reference
    for text in (page, reference):
        assert "//cdn" not in text and "https://" not in text


def test_ready_before_any_worker(tmp_path: Path) -> None:
    with api_alone(tmp_path) as served, served.client() as client:
        ready = client.get("/readyz").json()
    assert (ready["status"], ready["worker"], ready["worker_seen_at"]) == ("ready", "not seen yet", None)


def test_operators(api: httpx.Client, shelf: str) -> None:
    api.post(f"{shelf}/shapes", content=different(52)).raise_for_status()
    ready = api.get("/readyz").json()
    assert ready["worker"] == ("not seen yet" if ready["worker_seen_at"] is None else "seen")
    assert ready["status"] == "ready" and ready["queued"] >= 1
    text = api.get("/metrics").text
    assert 'reebase_requests_total{method="POST",route="/v1/collections/{collection}/shapes",status="202"}' in text
    assert 'reebase_tasks{kind="describe",state="queued"}' in text
    assert "reebase_queue_depth" in text
    assert shelf not in text
