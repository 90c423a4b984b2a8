"""The map of a collection: made by a task, current until shapes come or go, by any descriptor."""

from __future__ import annotations

import httpx
import pytest

from tests.http.test_main_job import ended, indexed, uploaded
from tests.http.test_problems import is_problem
from tests.shapes import capsule, torus


@pytest.fixture
def filled(http: httpx.Client, collection: str) -> dict[str, str]:
    """name -> address of four indexed shapes."""
    meshes = {"c2": capsule(length=2.0), "c3": capsule(length=3.0), "c4": capsule(length=4.0), "ring": torus()}
    made = {name: uploaded(http, collection, mesh, name=name, label=name[0]) for name, mesh in meshes.items()}
    for shape in made.values():
        indexed(http, shape)
    return made


def mapped(http: httpx.Client, collection: str, **body: str) -> None:
    asked = http.post(f"{collection}/map", json=body)
    assert asked.status_code == 202, asked.text
    assert ended(http, asked.json()["id"])["state"] == "succeeded"


def test_a_map_is_made_kept_and_made_anew(http: httpx.Client, collection: str, filled: dict[str, str]) -> None:
    before = http.get(f"{collection}/map").json()
    assert (before["state"], before["points"], before["task"]) == ("none", [], None)
    mapped(http, collection)
    found = http.get(f"{collection}/map").json()
    assert (found["state"], found["left_out"], found["task"]) == ("current", 0, None)
    assert {point["name"]: point["label"] for point in found["points"]} == {n: n[0] for n in filled}
    assert max(abs(point[axis]) for point in found["points"] for axis in "xy") == 1.0
    assert 0 <= found["neighbours_kept"] <= 1
    # Nothing changed, nothing is done.
    again = http.post(f"{collection}/map", json={})
    assert (again.status_code, again.json()["state"]) == (200, "succeeded")
    http.patch(filled["ring"], json={"name": "torus"}).raise_for_status()
    renamed = http.get(f"{collection}/map").json()
    assert "torus" in {point["name"] for point in renamed["points"]} and renamed["state"] == "current"
    http.delete(filled["ring"])
    fewer = http.get(f"{collection}/map").json()
    assert (fewer["state"], len(fewer["points"])) == ("outdated", 3)
    # The very set that was mapped is back, though at a later revision.
    http.post(f"{filled['ring']}/restore").raise_for_status()
    assert http.get(f"{collection}/map").json()["state"] == "outdated"
    mapped(http, collection)
    same = http.get(f"{collection}/map").json()
    assert [(p["shape"], p["x"], p["y"]) for p in same["points"]] == [
        (p["shape"], p["x"], p["y"]) for p in found["points"]
    ]  # fmt: skip


def test_maps_by_several_descriptors_stand_side_by_side(
    http: httpx.Client, collection: str, filled: dict[str, str]
) -> None:
    mapped(http, collection, descriptor="srg")
    assert http.get(f"{collection}/map", params={"descriptor": "srg"}).json()["state"] == "current"
    other = http.get(f"{collection}/map", params={"descriptor": "shape_dna"}).json()
    assert (other["state"], other["descriptor"]) == ("none", "shape_dna")
    is_problem(http.get(f"{collection}/map", params={"descriptor": "beauty"}), 422, "unknown_name")
    is_problem(http.post(f"{collection}/map", json={"descriptor": "beauty"}), 422, "unknown_name")


def test_an_empty_collection_has_an_empty_map(http: httpx.Client, collection: str) -> None:
    mapped(http, collection)
    assert http.get(f"{collection}/map").json()["points"] == []


def test_one_that_is_being_made_is_not_made_twice(api: httpx.Client, shelf: str) -> None:
    first = api.post(f"{shelf}/map", json={})
    second = api.post(f"{shelf}/map", json={})
    assert (first.status_code, second.status_code) == (202, 200)
    assert first.json()["id"] == second.json()["id"]
    waiting = api.get(f"{shelf}/map").json()
    assert (waiting["state"], waiting["task"]["id"]) == ("none", first.json()["id"])
