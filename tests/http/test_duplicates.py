"""Near-duplicates over HTTP: what was done to a copy is told, and nothing is changed."""

from __future__ import annotations

import httpx
import numpy as np
import pytest
from sqlalchemy import select, update

from reebase.client import Client, Duplicate
from reebase.duplicates import Shape, find_duplicates
from reebase.mesh import Mesh, clean
from store.tables import task as table
from tests.http.serving import Served
from tests.http.test_main_job import ended, indexed, uploaded
from tests.http.test_problems import is_problem
from tests.shapes import capsule, joined, moved, torus


def bent(mesh: Mesh) -> Mesh:
    """Without any symmetry, so that its mirror image is another shape."""
    x, y, z = mesh.vertices.T
    return Mesh(np.stack([x * (1 + 0.3 * z) + 0.2 * z**2, y * (1.2 - 0.1 * x), z + 0.1 * x * y], axis=1), mesh.faces)


ONE = bent(capsule(length=3.0))
MESHES = {
    "one": ONE,
    "inches": Mesh(ONE.vertices / 25.4, ONE.faces),
    "mirrored": Mesh(ONE.vertices * [-1, 1, 1], ONE.faces[:, ::-1]),
    "twice": joined(ONE, moved(ONE, (9.0, 0.0, 0.0))),
    "another": torus(1.0, 0.3),
}


@pytest.fixture(scope="module")
def copies(http: httpx.Client) -> dict[str, str]:
    """name -> id, "" -> the collection's path."""
    path = "/v1/collections/copies"
    http.post("/v1/collections", json={"name": "copies", "profile": {"bands": 16}}).raise_for_status()
    addresses = {name: uploaded(http, path, mesh, name=name) for name, mesh in MESHES.items()}
    return {"": path, **{name: indexed(http, address)["id"] for name, address in addresses.items()}}


def test_copies_are_found_and_what_was_done_is_told(http: httpx.Client, copies: dict[str, str]) -> None:
    path = f"{copies['']}/duplicates"
    before = http.get(path).json()
    assert (before["state"], before["findings"], before["task"]) == ("none", [], None)
    reply = http.post(path)
    assert reply.status_code == 202
    task = reply.json()["id"]
    assert reply.headers["location"] == f"/v1/tasks/{task}"
    assert ended(http, task)["state"] == "succeeded"
    found = http.get(path).json()
    assert (found["state"], found["compared"], found["left_out"]) == ("current", len(MESHES), 0)
    told = {(one["first"]["name"], one["second"]["name"]): one for one in found["findings"]}
    expected = find_duplicates([Shape.of(name, clean(mesh)[0]) for name, mesh in MESHES.items()])
    assert {frozenset(pair) for pair in told} == {frozenset((one.first, one.second)) for one in expected}
    assert {frozenset(pair): set(one["classes"]) for pair, one in told.items()} == {
        frozenset((one.first, one.second)): set(one.classes) for one in expected
    }
    inches = next(one for pair, one in told.items() if set(pair) == {"one", "inches"})
    assert inches["units"] == "inches and millimetres" and inches["confidence"] == "certain"
    assert inches["evidence"]["same_faces"] == 1.0 and "25.4" in inches["words"]
    assert {one["first"]["id"] for one in found["findings"]} <= set(copies.values())
    assert found["pairs"] >= found["total"] == len(expected)
    assert found["pairs_left_out"] == 0
    for one in found["findings"]:
        assert one["first"]["name"] in one["words"] and one["first"]["id"] not in one["words"]
    again = http.post(path)
    assert (again.status_code, again.json()["id"]) == (200, task)


def test_findings_can_be_narrowed_and_follow_deletions(
    http: httpx.Client, service: Served, copies: dict[str, str]
) -> None:
    path = f"{copies['']}/duplicates"
    with Client(service.url) as client:
        client.wait(client.find_duplicates("copies"))
        every = client.duplicates("copies")
        assert every.state == "current" and every.total == len(every.findings) > 2
        own = client.duplicates("copies", shape=copies["inches"])
        assert own.findings
        assert all(copies["inches"] in (one.first, one.second) for one in own.findings)
        assert client.duplicates("copies", shape=copies["another"]).findings == ()
        assert len(client.duplicates("copies", limit=1).findings) == 1
        assert all(one.confidence == "certain" for one in client.duplicates("copies", confidence="certain").findings)
        client.delete_shape("copies", copies["inches"])
        after = client.duplicates("copies")
        assert after.state == "outdated"
        assert after.total == every.total - own.total
        http.post(f"{copies['']}/bulk/restore", json={"shapes": [copies["inches"]]}).raise_for_status()
        assert client.duplicates("copies").total == every.total
        (between,) = _between(client, copies["one"], copies["mirrored"])
        client.update_shape("copies", copies["mirrored"], name="one")
        (again,) = _between(client, copies["one"], copies["mirrored"])
        client.update_shape("copies", copies["mirrored"], name="mirrored")
        assert {again.first_name, again.second_name} == {"one"}
        assert "mirrored and" not in again.words and "and mirrored" not in again.words
        assert f"one ({again.first}) and one ({again.second}) are one shape" in again.words
        assert again.evidence == between.evidence
    is_problem(http.get(path, params={"confidence": "sure"}), 422, "validation_error")
    is_problem(http.get(path, params={"limit": 0}), 422, "validation_error")
    is_problem(http.get("/v1/collections/absent/duplicates"), 404, "collection_not_found")


def _between(client: Client, one: str, other: str) -> list[Duplicate]:
    return [found for found in client.duplicates("copies").findings if {found.first, found.second} == {one, other}]


def test_the_total_counts_findings_of_which_only_that_is_kept(
    http: httpx.Client, service: Served, copies: dict[str, str]
) -> None:
    path = f"{copies['']}/duplicates"
    with Client(service.url) as client:
        task = client.wait(client.find_duplicates("copies")).id
    every = http.get(path).json()
    database = service.database()
    try:
        with database.write() as conn:
            kept = conn.execute(select(table.c.result).where(table.c.id == task)).scalar_one()
            weaker = [{name: one[name] for name in ("first", "second", "confidence")} for one in kept["findings"][1:]]
            cut = {**kept, "findings": kept["findings"][:1], "weaker": weaker}
            conn.execute(update(table).where(table.c.id == task).values(result=cut))
    finally:
        database.close()
    found = http.get(path).json()
    assert (found["total"], found["findings"]) == (every["total"], every["findings"][:1])
    one = every["findings"][1]["first"]["id"]
    of_one = [each for each in every["findings"] if one in (each["first"]["id"], each["second"]["id"])]
    assert http.get(path, params={"shape": one}).json()["total"] == len(of_one)


def test_of_no_shapes(http: httpx.Client, collection: str) -> None:
    task = http.post(f"{collection}/duplicates").json()["id"]
    assert ended(http, task)["state"] == "succeeded"
    found = http.get(f"{collection}/duplicates").json()
    assert (found["state"], found["compared"], found["findings"]) == ("current", 0, [])
