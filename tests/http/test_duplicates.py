"""Near-duplicates over HTTP: what was done to a copy is told, and nothing is changed."""

from __future__ import annotations

import httpx
import numpy as np
import pytest

from reebase.client import Client
from reebase.duplicates import Shape, find_duplicates
from reebase.mesh import Mesh, clean
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
    is_problem(http.get(path, params={"confidence": "sure"}), 422, "validation_error")
    is_problem(http.get(path, params={"limit": 0}), 422, "validation_error")
    is_problem(http.get("/v1/collections/absent/duplicates"), 404, "collection_not_found")


def test_of_no_shapes(http: httpx.Client, collection: str) -> None:
    task = http.post(f"{collection}/duplicates").json()["id"]
    assert ended(http, task)["state"] == "succeeded"
    found = http.get(f"{collection}/duplicates").json()
    assert (found["state"], found["compared"], found["findings"]) == ("current", 0, [])
