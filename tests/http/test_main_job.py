"""The main job through a running API and its worker: upload, describe, look, query, evaluate, delete."""

from __future__ import annotations

import hashlib
import itertools
import time
from typing import Any

import httpx
import numpy as np
import pytest

from reebase.mesh.geometry import face_areas
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read, read_scalars
from reebase.mesh.write import to_bytes
from tests.http.test_problems import is_problem
from tests.shapes import capsule, cylinder, icosphere, joined, moved, torus

ENDED = {"succeeded", "failed", "cancelled"}


def ended(http: httpx.Client, task: str, seconds: float = 120.0) -> dict[str, Any]:
    """The task once it has ended."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        found: dict[str, Any] = http.get(f"/v1/tasks/{task}", params={"wait": 20}).json()
        if found["state"] in ENDED:
            return found
    raise AssertionError(f"The task has not ended: {found}")


def uploaded(http: httpx.Client, path: str, mesh: Mesh, format: str = "ply", **fields: Any) -> str:
    """The address of a shape that is queued."""
    reply = http.post(f"{path}/shapes", files={"file": (f"a.{format}", to_bytes(mesh, format))}, data=fields)
    assert reply.status_code == 202, reply.text
    return reply.headers["location"]


def indexed(http: httpx.Client, shape: str) -> dict[str, Any]:
    """The shape once it is indexed."""
    task = ended(http, http.get(shape).json()["task"])
    assert task["state"] == "succeeded", task
    found: dict[str, Any] = http.get(shape).json()
    assert found["state"] == "indexed"
    return found


@pytest.fixture(scope="module")
def zoo(http: httpx.Client) -> dict[str, str]:
    """A collection of capsules of several lengths; name -> address, "" -> the collection."""
    path = "/v1/collections/zoo"
    http.post("/v1/collections", json={"name": "zoo", "profile": {"bands": 32}}).raise_for_status()
    shapes = {"": path}
    for number, length in enumerate([2.0, 3.0, 4.0, 5.0]):
        mesh = moved(capsule(length=length), (number, 0, 0), seed=number)
        shapes[f"capsule-{length:g}"] = uploaded(
            http, path, mesh, name=f"capsule-{length:g}", label="long" if length > 3 else "short",
            tags="capsule,even" if length % 2 == 0 else "capsule", metadata=f'{{"length": {length:g}}}',
        )  # fmt: skip
    for address in list(shapes.values())[1:]:
        indexed(http, address)
    return shapes


def test_what_is_learnt_of_a_shape(http: httpx.Client, zoo: dict[str, str]) -> None:
    shape = zoo["capsule-4"]
    found = http.get(shape).json()
    assert found["endpoint_count"] == 2
    skeleton = http.get(f"{shape}/skeleton").json()
    features = http.get(f"{shape}/features").json()
    assert len(skeleton["endpoints"]) == features["endpoint_count"] == 2
    assert [one["omega"] for one in skeleton["endpoints"]] == features["features"]
    assert len(skeleton["edges"]) - len(skeleton["nodes"]) + 1 == skeleton["cycles"] == 0
    cleaned = read(http.get(f"{shape}/mesh", params={"stage": "cleaned"}).content)
    denoised, scalars = read_scalars(http.get(f"{shape}/mesh").content)
    assert np.array_equal(cleaned.faces, denoised.faces)
    assert sum(node["area"] for node in skeleton["nodes"]) == pytest.approx(
        face_areas(denoised).sum(), rel=1e-9
    )
    values = http.get(f"{shape}/field").json()["values"]
    assert values == scalars["phi2"].tolist()
    assert min(values) < 0 < max(values)
    health = http.get(f"{shape}/health").json()
    assert health["report"]["closed"] and health["report"]["genus"] == 0
    assert set(health["seconds"]) >= {"clean", "skeleton"}
    original = http.get(f"{shape}/original").content
    assert hashlib.sha256(original).hexdigest() == found["sha256"]
    for format in ("glb", "obj", "stl", "off"):
        reply = http.get(f"{shape}/mesh", params={"format": format})
        assert len(read(reply.content, format).faces) == len(denoised.faces)
    counts = http.get(zoo[""]).json()["counts"]
    assert counts == {"shapes": 4, "states": {"indexed": 4}, "endpoints": {"2": 4}}


def check_answer(answer: dict[str, Any]) -> None:
    """What every answer must be, whatever was asked."""
    hits = answer["hits"]
    assert [hit["rank"] for hit in hits] == list(range(1, len(hits) + 1))
    order = [(hit["dissimilarity"], hit["shape"]["id"]) for hit in hits]
    assert order == sorted(order)
    for hit in hits:
        assert sum(part["share"] for part in hit["parts"]) == pytest.approx(1.0)
        if answer["query"]["measure"] in ("matching", None):
            parts = [pair["distance"] for pair in hit["pairs"]]
            parts += [one["charge"] for one in hit["unmatched_query"] + hit["unmatched_hit"]]
            assert sum(parts) == pytest.approx(hit["graph_dissimilarity"], abs=1e-12)
            used = [p["query"] for p in hit["pairs"]] + [u["endpoint"] for u in hit["unmatched_query"]]
            assert sorted(used) == list(range(answer["query"]["endpoint_count"]))
    assert answer["considered"] == sum(bucket["shapes"] for bucket in answer["buckets"])


def test_a_query_by_shape(http: httpx.Client, zoo: dict[str, str]) -> None:
    shape = zoo["capsule-4"].rsplit("/", 1)[-1]
    answer = http.post(f"{zoo['']}/query", json={"shape": shape}).json()
    check_answer(answer)
    assert answer["query"]["shape"] == shape
    names = [hit["shape"]["name"] for hit in answer["hits"]]
    assert len(names) == 3 and "capsule-4" not in names
    assert names[-1] == "capsule-2"


def test_a_query_by_mesh(http: httpx.Client, zoo: dict[str, str]) -> None:
    turned = moved(capsule(length=4.0), (9, 9, 9), scale=2.0, seed=5)
    reply = http.post(
        f"{zoo['']}/query", files={"file": ("q.obj", to_bytes(turned, "obj"))}, data={"k": 2, "tolerance": "null"}
    )
    assert reply.status_code == 200
    answer = reply.json()
    check_answer(answer)
    assert answer["query"]["shape"] is None and answer["query"]["tolerance"] is None
    assert answer["hits"][0]["shape"]["name"] == "capsule-4"
    assert answer["hits"][0]["graph_dissimilarity"] < 0.01
    # It is not kept.
    assert http.get(zoo[""]).json()["counts"]["shapes"] == 4
    raw = http.post(f"{zoo['']}/query", content=to_bytes(turned, "obj"), params={"k": 2, "tolerance": "null"})
    assert raw.json()["hits"] == answer["hits"]


def test_an_answer_says_what_is_unusual_about_the_query(http: httpx.Client, zoo: dict[str, str]) -> None:
    open_one = to_bytes(joined(cylinder(), moved(icosphere(1), (9, 0, 0), scale=0.1)), "ply")
    flags = http.post(f"{zoo['']}/query", content=open_one).json()["query"]["flags"]
    assert {"open_surface", "several_components"} <= set(flags)
    shape = http.get(zoo["capsule-4"]).json()
    answer = http.post(f"{zoo['']}/query", json={"shape": shape["id"]}).json()
    assert answer["query"]["flags"] == shape["flags"]


def test_a_query_that_is_not_waited_for(http: httpx.Client, zoo: dict[str, str]) -> None:
    reply = http.post(f"{zoo['']}/query?wait=0", content=to_bytes(torus(), "ply"))
    assert reply.status_code == 202
    task = ended(http, reply.json()["task"]["id"])
    assert reply.headers["location"] == f"/v1/tasks/{task['id']}"
    assert task["state"] == "succeeded" and task["collection"] == "zoo"
    check_answer(task["result"])


@pytest.mark.parametrize("measure", ["matching", "matching_mean", "greedy", "literal"])
def test_measures(http: httpx.Client, zoo: dict[str, str], measure: str) -> None:
    shape = zoo["capsule-4"].rsplit("/", 1)[-1]
    answer = http.post(f"{zoo['']}/query", json={"shape": shape, "measure": measure}).json()
    check_answer(answer)
    assert len(answer["hits"]) == 3


@pytest.mark.parametrize(
    ("asked", "names"),
    [
        ({"label": "short"}, {"capsule-2", "capsule-3"}),
        ({"tags": ["even"]}, {"capsule-2"}),
        ({"metadata": {"length": 5}}, {"capsule-5"}),
        ({"label": "short", "tags": ["even"]}, {"capsule-2"}),
        ({"label": "none"}, set()),
        ({"k": 1}, {"capsule-5"}),
        ({"max_dissimilarity": 0.0}, set()),
    ],
)
def test_filters(http: httpx.Client, zoo: dict[str, str], asked: dict[str, Any], names: set[str]) -> None:
    shape = zoo["capsule-4"].rsplit("/", 1)[-1]
    answer = http.post(f"{zoo['']}/query", json={"shape": shape, **asked}).json()
    check_answer(answer)
    found = {hit["shape"]["name"] for hit in answer["hits"]}
    assert found == names or ("k" in asked and len(found) == 1)


def test_a_batch(http: httpx.Client, zoo: dict[str, str]) -> None:
    ids = [address.rsplit("/", 1)[-1] for name, address in zoo.items() if name]
    queries = [{"shape": ids[0]}, {"shape": "absent"}, {"shape": ids[1], "measure": "best"},
               {"shape": ids[1], "k": 1001}, {"shape": ids[2], "k": 1}]  # fmt: skip
    results = http.post(f"{zoo['']}/queries", json={"queries": queries}).json()["results"]
    problems = [one["problem"] and one["problem"]["code"] for one in results]
    assert problems == [None, "shape_not_found", "unknown_name", "validation_error", None]
    assert results[3]["problem"]["errors"][0]["pointer"] == "/queries/3/k"
    check_answer(results[0]["answer"])
    alone = http.post(f"{zoo['']}/query", json=queries[0]).json()
    assert results[0]["answer"]["hits"] == alone["hits"]
    is_problem(http.post(f"{zoo['']}/queries", json={"queries": queries[:1] * 101}), 422, "validation_error")
    assert http.get("/v1/limits").json()["max_batch_hits"] == 5000
    hungry = [{"shape": "absent", "k": 1000}]
    too_hungry = http.post(f"{zoo['']}/queries", json={"queries": [*hungry * 5, queries[-1]]})
    is_problem(too_hungry, 422, "validation_error")
    assert "5001 hits" in too_hungry.json()["detail"] and "5000" in too_hungry.json()["detail"]
    assert http.post(f"{zoo['']}/queries", json={"queries": hungry * 5}).status_code == 200


WRONG = {
    "k of 0": ({"k": 0}, "validation_error"),
    "k of a thousand millions": ({"k": 10**9}, "validation_error"),
    "k of a half": ({"k": 0.5}, "validation_error"),
    "negative tolerance": ({"tolerance": -1}, "validation_error"),
    "negative distance": ({"max_dissimilarity": -1}, "validation_error"),
    "unknown measure": ({"measure": "best"}, "unknown_name"),
    "another member": ({"kk": 1}, "validation_error"),
    "long label": ({"label": "x" * 100_000}, "validation_error"),
}


@pytest.mark.parametrize(("asked", "code"), WRONG.values(), ids=WRONG)
def test_queries_that_are_not_allowed(
    http: httpx.Client, zoo: dict[str, str], asked: dict[str, Any], code: str
) -> None:
    shape = zoo["capsule-4"].rsplit("/", 1)[-1]
    by_shape = http.post(f"{zoo['']}/query", json={"shape": shape, **asked})
    by_mesh = http.post(f"{zoo['']}/query", files={"file": to_bytes(torus(), "ply")}, data=asked)
    for reply in (by_shape, by_mesh):
        value = is_problem(reply, 422, code)
        if asked.get("k") == 10**9:
            assert "1000" in value["detail"]
        if "measure" in asked:
            assert value["details"]["choices"] == ["greedy", "literal", "matching", "matching_mean"]


@pytest.mark.parametrize("wait", ["-1", "61", "x", "nan"])
def test_waits_that_are_not_allowed(http: httpx.Client, zoo: dict[str, str], wait: str) -> None:
    reply = http.post(f"{zoo['']}/query?wait={wait}", content=to_bytes(torus(), "ply"))
    is_problem(reply, 422, "validation_error")


def test_a_profile_by_name_and_what_differs_from_it(http: httpx.Client, collection: str) -> None:
    known = {one["name"]: one["profile"] for one in http.get("/v1/profiles").json()["items"]}
    assert known["thesis"]["levels"] == "width"
    body = {"name": "by-name", "profile": {"base": "thesis", "bands": 32}}
    made = http.post("/v1/collections", json=body).json()
    assert made["profile"] == {**known["thesis"], "bands": 32}
    changed = http.patch("/v1/collections/by-name", json={"profile": {"base": "default"}}).json()
    assert changed["profile"] == known["default"] == http.get(collection).json()["profile"]
    is_problem(http.patch("/v1/collections/by-name", json={"profile": {"base": "ghost"}}), 422, "unknown_name")


def test_another_profile_describes_all_again(http: httpx.Client, collection: str) -> None:
    shape = uploaded(http, collection, capsule(length=6.0))
    first = indexed(http, shape)
    before = http.get(f"{shape}/features").json()["profile_key"]
    changed = http.patch(collection, json={"profile": {"bands": 16}}).json()
    assert changed["profile"]["bands"] == 16 and changed["profile_key"] != before
    again = indexed(http, shape)
    assert again["task"] != first["task"]
    assert http.get(f"{shape}/features").json()["profile_key"] == changed["profile_key"]


def test_shapes_for_which_the_method_is_not_defined(http: httpx.Client, collection: str) -> None:
    whole = indexed(http, uploaded(http, collection, icosphere(2)))
    assert "near_degenerate_eigenvalues" in whole["flags"]
    ring = indexed(http, uploaded(http, collection, torus()))
    assert ring["endpoint_count"] is not None
    asked = http.post(f"{collection}/query", json={"shape": ring["id"], "tolerance": None})
    assert asked.status_code == 200


def test_a_deleted_shape_is_found_no_more(http: httpx.Client, collection: str) -> None:
    kept, gone = (uploaded(http, collection, capsule(length=length)) for length in (3.5, 4.5))
    shape = indexed(http, kept)["id"]
    indexed(http, gone)
    assert len(http.post(f"{collection}/query", json={"shape": shape}).json()["hits"]) == 1
    assert http.delete(gone).status_code == 204
    answer = http.post(f"{collection}/query", json={"shape": shape}).json()
    assert (answer["hits"], answer["considered"]) == ([], 0)


def test_cancel_and_retry(http: httpx.Client, collection: str) -> None:
    shapes = [uploaded(http, collection, icosphere(4, radius=radius)) for radius in (1.0, 2.0, 3.0)]
    last = http.get(shapes[-1]).json()["task"]
    assert http.post(f"/v1/tasks/{last}/cancel").json()["state"] == "cancelled"
    assert http.get(shapes[-1]).json()["state"] == "cancelled"
    is_problem(http.post(f"/v1/tasks/{last}/cancel"), 409, "task_not_cancellable")
    assert http.post(f"/v1/tasks/{last}/retry").json()["state"] == "queued"
    assert ended(http, last)["state"] == "succeeded"
    is_problem(http.post(f"/v1/tasks/{last}/retry"), 409, "task_not_retryable")
    for shape in shapes:
        indexed(http, shape)


def evaluated(http: httpx.Client, request: dict[str, Any]) -> dict[str, Any]:
    reply = http.post("/v1/evaluations", json=request)
    assert reply.status_code == 202, reply.text
    assert reply.headers["location"] == f"/v1/evaluations/{reply.json()['id']}"
    task = ended(http, reply.json()["task"]["id"], 240.0)
    assert task["state"] == "succeeded", task
    found: dict[str, Any] = http.get(reply.headers["location"]).json()
    assert found["task"]["state"] == "succeeded"
    matrix = http.get(found["matrix"]).json()
    D = np.array(matrix["matrix"])
    assert D.shape == (len(matrix["items"]),) * 2
    assert np.allclose(D, D.T) and np.all(np.diag(D) == 0)
    assert 0 <= found["report"]["overall"]["nn"] <= 1
    assert set(found["report"]["overall"]) >= {"nn", "first_tier", "second_tier", "e_measure", "dcg", "map"}
    assert found["id"] in {one["id"] for one in http.get("/v1/evaluations").json()["items"]}
    assert http.delete(reply.headers["location"]).status_code == 204
    is_problem(http.get(reply.headers["location"]), 404, "evaluation_not_found")
    return found


def test_an_evaluation_of_a_collection(http: httpx.Client, zoo: dict[str, str]) -> None:
    found = evaluated(http, {"collection": "zoo", "bootstrap": 20, "descriptor": "srg"})
    assert set(found["report"]["per_class"]) == {"long", "short"}


def test_an_evaluation_of_the_synthetic_set(http: httpx.Client) -> None:
    synthetic = {"per_class": 2, "seed": 1, "classes": ["snakes", "spiders"]}
    found = evaluated(http, {"synthetic": synthetic, "bootstrap": 20, "descriptor": "srg", "profile": {"bands": 32}})
    assert found["request"]["synthetic"]["seed"] == 1
    assert set(found["report"]["per_class"]) == {"snakes", "spiders"}


def test_evaluations_that_are_not_allowed(http: httpx.Client) -> None:
    for request, code in (
        ({}, "validation_error"),
        ({"collection": "zoo", "synthetic": {}}, "validation_error"),
        ({"collection": "zoo", "profile": {}}, "validation_error"),
        ({"synthetic": {"per_class": 1}}, "validation_error"),
        ({"synthetic": {}, "measure": "best"}, "unknown_name"),
        ({"synthetic": {}, "descriptor": "best"}, "unknown_name"),
        ({"synthetic": {"classes": ["ants", "cats"]}}, "unknown_name"),
    ):
        is_problem(http.post("/v1/evaluations", json=request), 422, code)
    is_problem(http.post("/v1/evaluations", json={"collection": "absent"}), 404, "collection_not_found")


def test_many_uploads_at_once_are_all_described(http: httpx.Client, collection: str) -> None:
    shapes = [uploaded(http, collection, capsule(length=length)) for length in np.linspace(2, 3, 8)]
    for shape in shapes:
        indexed(http, shape)
    listed = http.get(f"{collection}/shapes").json()["items"]
    assert [f"{collection}/shapes/{one['id']}" for one in listed] == shapes
    assert len({one["sha256"] for one in listed}) == 8
    pairs = itertools.pairwise(one["created_at"] for one in listed)
    assert all(first <= second for first, second in pairs)
