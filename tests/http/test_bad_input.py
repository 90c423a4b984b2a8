"""Files that are not meshes: each is refused, or fails its task alone with a reason; the store stays consistent."""

from __future__ import annotations

import io
import json
import struct
import zipfile
from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import pytest

from reebase.mesh.write import to_bytes
from store import sweep
from tests.http.serving import Served
from tests.http.test_main_job import ended, indexed, uploaded
from tests.http.test_problems import is_problem
from tests.shapes import capsule, icosphere

BALL = to_bytes(icosphere(1), "ply")


def ply(vertices: str, faces: str, counts: tuple[int, int]) -> bytes:
    """An ASCII PLY with these rows, announcing these counts."""
    return (
        f"ply\nformat ascii 1.0\nelement vertex {counts[0]}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {counts[1]}\nproperty list uchar int vertex_indices\nend_header\n"
        f"{vertices}{faces}"
    ).encode()


def zip_bomb() -> bytes:
    """A 3MF of a few hundred kilobytes whose model expands to 700 MB."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        archive.writestr("[Content_Types].xml", "<Types/>")
        with archive.open("3D/3dmodel.model", "w", force_zip64=True) as model:
            model.write(b"<model>")
            for _ in range(700):
                model.write(b" " * 2**20)
            model.write(b"</model>")
    return file.getvalue()


def gltf_elsewhere() -> bytes:
    """A glTF whose buffer lies in another file."""
    return json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"uri": "file:///etc/passwd", "byteLength": 36}],
    }).encode()  # fmt: skip


NAN = np.array([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]], dtype="<f4").tobytes()
HEAD = b"ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\n"
TAIL = b"property float z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n"
TRIANGLE = b"\x03" + struct.pack("<3i", 0, 1, 2)

FAIL: dict[str, tuple[str, bytes, set[str]]] = {
    "text named .stl": ("a.stl", b"this is not a mesh\n" * 20, {"malformed_file", "truncated_file", "no_faces"}),
    "truncated": ("a.ply", BALL[:-40], {"truncated_file"}),
    "lying header": ("a.ply", ply("0 0 0\n1 0 0\n0 1 0\n", "3 0 1 2\n", (3, 9)), {"truncated_file"}),
    "NaN": ("a.ply", HEAD % 3 + TAIL % 1 + NAN + TRIANGLE, {"non_finite_vertices"}),
    "infinity": ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 inf 0\nf 1 2 3\n", {"non_finite_vertices", "malformed_file"}),
    "zero faces": ("a.ply", ply("0 0 0\n1 0 0\n0 1 0\n", "", (3, 0)), {"no_faces"}),
    "all vertices equal": ("a.ply", ply("1 1 1\n" * 3, "3 0 1 2\n", (3, 1)), {"degenerate_mesh"}),
    "ten million faces in 200 bytes": (
        "a.ply", (HEAD % 3 + TAIL % 10_000_000 + b"\x00" * 36)[:200], {"truncated_file"},
    ),
    "ten million faces in a short STL": (
        "a.stl", b"\x00" * 80 + struct.pack("<I", 10_000_000) + b"\x00" * 100, {"truncated_file"},
    ),
    "index out of range": ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", {"face_index_out_of_range"}),
    "zip bomb": ("a.3mf", zip_bomb(), {"expands_too_much"}),
    "a zip of something else": ("a.3mf", b"PK\x03\x04" + b"\x00" * 60, {"malformed_file", "truncated_file"}),
    "external reference": ("a.gltf", gltf_elsewhere(), {"external_reference"}),
}  # fmt: skip


@pytest.fixture(scope="module")
def pen(http: httpx.Client) -> str:
    """A collection for what is broken."""
    http.post("/v1/collections", json={"name": "pen"}).raise_for_status()
    return "/v1/collections/pen"


@pytest.fixture(scope="module", autouse=True)
def consistent(service: Served, http: httpx.Client, pen: str) -> Iterator[None]:
    """After all of it: nothing half written, no task alive, every row's blob there, and the worker works on."""
    yield
    indexed(http, uploaded(http, pen, capsule(length=9.0)))
    assert service.unfinished() == []
    database, blobs = service.database(), service.blobs()
    with database.read() as conn:
        named = sweep.all_referenced(conn)
        assert conn.exec_driver_sql("PRAGMA integrity_check").scalar() == "ok"
        assert conn.exec_driver_sql("PRAGMA foreign_key_check").all() == []
    database.close()
    assert all(blobs.exists(sha256) for sha256 in named)
    states = http.get(pen).json()["counts"]["states"]
    assert set(states) <= {"indexed", "failed"}
    for state in ("queued", "running"):
        assert http.get("/v1/tasks", params={"state": state}).json()["items"] == []


@pytest.mark.parametrize(("name", "data", "codes"), FAIL.values(), ids=FAIL)
def test_a_file_that_is_no_mesh_fails_alone(
    http: httpx.Client, pen: str, name: str, data: bytes, codes: set[str]
) -> None:
    reply = http.post(f"{pen}/shapes", files={"file": (name, data)})
    assert reply.status_code == 202, reply.text
    task = ended(http, reply.json()["task"]["id"])
    assert (task["state"], task["crashes"]) == ("failed", 0), task
    assert task["error"]["code"] in codes, task
    shape = http.get(reply.headers["location"]).json()
    assert shape["state"] == "failed" and shape["error"] == task["error"]
    for part in ("skeleton", "features", "health", "field", "mesh"):
        value = is_problem(http.get(f"{reply.headers['location']}/{part}"), 404, "result_not_found")
        assert task["error"]["detail"] in value["detail"]
        assert (value["details"]["state"], value["details"]["task"]) == ("failed", task["id"])
        assert value["details"]["error"]["code"] == task["error"]["code"]
    assert http.get(f"{reply.headers['location']}/original").content == data
    # The same file as a query: the same reason, as the answer.
    asked = http.post(f"{pen}/query", files={"file": (name, data)})
    value = is_problem(asked, 422, task["error"]["code"])
    assert value["detail"] == task["error"]["detail"]


def test_one_triangle_is_indexed(http: httpx.Client, pen: str) -> None:
    data = ply("0 0 0\n1 0 0\n0 1 0\n", "3 0 1 2\n", (3, 1))
    reply = http.post(f"{pen}/shapes", files={"file": ("a.ply", data)})
    task = ended(http, reply.json()["task"]["id"])
    # A surface, if a small one: described with a flag, or refused with a reason, but never a crash.
    assert task["state"] == "succeeded" or task["error"]["code"] in {"degenerate_mesh", "computation_failed"}
    assert task["crashes"] == 0
    if task["state"] == "succeeded":
        assert "open_surface" in http.get(reply.headers["location"]).json()["flags"]


REFUSED: dict[str, tuple[dict[str, Any], int, str]] = {
    "empty file": ({"files": {"file": ("a.ply", b"")}}, 422, "empty_file"),
    "unknown format": ({"files": {"file": ("a.doc", b"\xd0\xcf\x11\xe0" * 99)}}, 415, "unknown_format"),
    "no multipart": (
        {"content": BALL, "headers": {"Content-Type": "multipart/form-data"}}, 400, "malformed_multipart",
    ),
    "long label": (
        {"files": {"file": ("a.ply", BALL)}, "data": {"label": "x" * 100_000}}, 422, "validation_error",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("request_", "status", "code"), REFUSED.values(), ids=REFUSED)
def test_what_is_refused_at_once(
    http: httpx.Client, pen: str, request_: dict[str, Any], status: int, code: str
) -> None:
    before = http.get(pen).json()["counts"]
    is_problem(http.post(f"{pen}/shapes", **request_), status, code)
    is_problem(http.post(f"{pen}/query", **request_), status, code)
    assert http.get(pen).json()["counts"] == before


def test_a_failed_shape_can_be_tried_again(http: httpx.Client, pen: str) -> None:
    reply = http.post(f"{pen}/shapes", files={"file": ("again.ply", BALL[:-30])})
    task = ended(http, reply.json()["task"]["id"])
    assert http.post(f"/v1/tasks/{task['id']}/retry").json()["state"] == "queued"
    again = ended(http, task["id"])
    assert again["state"] == "failed" and again["error"] == task["error"]
    assert again["attempt"] == task["attempt"] + 1
