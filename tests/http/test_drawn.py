"""What a page draws: thumbnails, display meshes and fields of shapes and of queries."""

from __future__ import annotations

import httpx
import numpy as np
import pytest

from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read, read_scalars
from reebase.mesh.write import to_bytes
from tests.http.test_main_job import ended, indexed, uploaded
from tests.http.test_problems import is_problem
from tests.shapes import capsule, icosphere, moved
from tests.unit.test_drawing import glb

MESH = capsule(length=3.0)
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def shape(http: httpx.Client) -> str:
    """The address of an indexed shape."""
    http.post("/v1/collections", json={"name": "drawn"}).raise_for_status()
    address = uploaded(http, "/v1/collections/drawn", MESH)
    indexed(http, address)
    return address


def test_a_thumbnail_is_small_and_kept(http: httpx.Client, shape: str) -> None:
    reply = http.get(f"{shape}/thumbnail")
    assert (reply.status_code, reply.headers["content-type"]) == (200, "image/png")
    assert reply.content.startswith(PNG) and len(reply.content) <= 10_000
    assert "immutable" not in reply.headers["cache-control"]
    again = http.get(f"{shape}/thumbnail", headers={"If-None-Match": reply.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    named = http.get(http.get(shape).json()["thumbnail"])
    assert (named.content, "immutable" in named.headers["cache-control"]) == (reply.content, True)
    other = http.get(f"{shape}/thumbnail", params={"of": "0" * 64})
    assert "immutable" not in other.headers["cache-control"]


def test_the_display_mesh_lies_on_the_skeleton(http: httpx.Client, shape: str) -> None:
    reply = http.get(f"{shape}/display")
    assert reply.headers["content-type"] == "model/gltf-binary"
    document, arrays = glb(reply.content)
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    denoised, scalars = read_scalars(http.get(f"{shape}/mesh").content)
    offset = document["nodes"][0]["translation"]
    assert arrays[attributes["POSITION"]] + offset == pytest.approx(denoised.vertices, abs=1e-5)
    assert arrays[attributes["_PHI2"]] == pytest.approx(scalars["phi2"], rel=1e-5, abs=1e-6)


def test_fields_are_listed_and_given_as_numbers(http: httpx.Client, shape: str) -> None:
    listed = http.get(f"{shape}/fields").json()["items"]
    assert [field["name"] for field in listed] == ["phi2", "displacement", "displacement_signed"]
    denoised, scalars = read_scalars(http.get(f"{shape}/mesh").content)
    cleaned = read(http.get(f"{shape}/mesh", params={"stage": "cleaned"}).content)
    values = {field["name"]: http.get(f"{shape}/fields/{field['name']}") for field in listed}
    numbers = {name: np.frombuffer(reply.content, "<f4") for name, reply in values.items()}
    assert numbers["phi2"] == pytest.approx(scalars["phi2"], rel=1e-5, abs=1e-6)
    assert numbers["displacement"] == pytest.approx(
        np.linalg.norm(denoised.vertices - cleaned.vertices, axis=1), rel=1e-5, abs=1e-9
    )
    etag = values["displacement"].headers["etag"]
    again = http.get(f"{shape}/fields/displacement", headers={"If-None-Match": etag})
    assert again.status_code == 304
    is_problem(http.get(f"{shape}/fields/colour"), 422, "unknown_name")


def test_the_skeleton_of_extended_ends_where_extended_matches(http: httpx.Client, shape: str) -> None:
    skeleton = http.get(f"{shape}/skeleton", params={"of": "extended"}).json()
    collection = shape.partition("/shapes/")[0]
    asked = http.post(f"{collection}/query", content=to_bytes(MESH, "ply"), params={"descriptor": "extended"})
    matched = asked.json()["hits"][0]["parts"][0]["matched"]
    assert len(skeleton["endpoints"]) == len(matched["positions"]) >= 2
    ends = np.array([skeleton["nodes"][end["node"]]["position"] for end in skeleton["endpoints"]])
    # A node is the centroid of its band, so it lies within the limb, not at the very tip.
    assert np.linalg.norm(ends - matched["positions"], axis=1).max() < 1.0
    distances = np.linalg.norm(ends[:, None] - np.array(matched["positions"])[None], axis=2)
    assert distances.argmin(axis=1).tolist() == list(range(len(ends)))
    is_problem(http.get(f"{shape}/skeleton", params={"of": "ghost"}), 422, "validation_error")


def test_each_part_of_a_shape_has_a_skeleton_of_its_own(http: httpx.Client, collection: str, shape: str) -> None:
    low, high = icosphere(3), icosphere(2)
    apart = Mesh(
        np.concatenate([low.vertices * (1, 1, 3), high.vertices * (2, 1, 1) + (0, 8, 0)]),
        np.concatenate([low.faces, high.faces + len(low.vertices)]),
    )
    both = uploaded(http, collection, apart)
    ended(http, http.get(both).json()["task"])
    whole, parts = http.get(f"{both}/skeleton").json(), http.get(f"{both}/skeletons").json()["items"]
    assert sum(edge["join"] for edge in whole["edges"]) >= 1
    assert [len(part["endpoints"]) for part in parts] == [2, 2]
    # Each by itself ends at its own two tips, the larger first.
    ends = [[part["nodes"][end["node"]]["position"] for end in part["endpoints"]] for part in parts]
    for found, wanted in zip(ends, [[(0, 0, -3), (0, 0, 3)], [(-2, 8, 0), (2, 8, 0)]], strict=True):
        assert np.array(sorted(found)) == pytest.approx(np.array(wanted), abs=0.5)
    assert not any(edge["join"] for part in parts for edge in part["edges"])
    assert all(end["omega"] for part in parts for end in part["endpoints"])
    one = http.get(f"{shape}/skeletons").json()["items"]
    whole = http.get(f"{shape}/skeleton").json()
    assert one == [{name: whole[name] for name in one[0]}]


def test_the_mesh_of_a_query_is_drawn_as_long_as_its_task_is_kept(http: httpx.Client, shape: str) -> None:
    collection = shape.partition("/shapes/")[0]
    mesh = moved(MESH, (1, 2, 3), seed=5)
    asked = http.post(f"{collection}/query", content=to_bytes(mesh, "ply"), params={"wait": 0})
    task = f"/v1/tasks/{ended(http, asked.json()['task']['id'])['id']}"
    assert http.get(f"{task}/thumbnail").content.startswith(PNG)
    document, arrays = glb(http.get(f"{task}/display").content)
    points = arrays[document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    assert len(points) == len(mesh.vertices)
    skeleton = http.get(f"{task}/skeleton").json()
    assert skeleton["shape"] is None and len(skeleton["endpoints"]) == 2
    assert len(http.get(f"{task}/skeleton", params={"of": "extended"}).json()["endpoints"]) >= 2
    nodes = np.array([node["position"] for node in skeleton["nodes"]])
    centre = np.array(document["nodes"][0]["translation"])
    assert (np.abs(nodes - centre) <= np.abs(points).max(axis=0) + 1e-6).all()
    # A task of another kind made nothing of the sort.
    described = http.get(shape).json()["task"]
    for what in ("thumbnail", "display", "skeleton"):
        is_problem(http.get(f"/v1/tasks/{described}/{what}"), 404, "result_not_found")
        is_problem(http.get(f"/v1/tasks/none/{what}"), 404, "task_not_found")


def test_before_it_is_described_there_is_nothing_to_draw(api: httpx.Client, shelf: str) -> None:
    waiting = uploaded(api, shelf, Mesh(MESH.vertices * 2, MESH.faces))
    assert api.get(waiting).json()["thumbnail"] is None
    for what in ("thumbnail", "display", "fields", "fields/phi2"):
        refused = api.get(f"{waiting}/{what}")
        is_problem(refused, 404, "result_not_found")
        assert refused.json()["details"]["state"] == "queued"
        is_problem(api.get(f"{shelf}/shapes/none/{what}"), 404, "shape_not_found")
