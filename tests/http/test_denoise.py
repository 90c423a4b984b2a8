"""A mesh in, a mesh out: what the library does, over HTTP."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import httpx
import numpy as np
import pytest

from reebase.client import Client, ServiceError
from reebase.denoise import add_noise, apply_choice, choose, denoise, measure_errors
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read, read_scalars
from reebase.mesh.write import to_bytes
from store import sweep
from store.settings import Settings
from tests.http.serving import Served
from tests.http.test_access import Make, guarded, keyed
from tests.http.test_main_job import ended
from tests.http.test_problems import is_problem
from tests.http.test_uploads import kept
from tests.shapes import icosphere, torus

__all__ = ["guarded", "keyed"]

TRUTH = torus(nu=32, nv=16)
NOISY = add_noise(TRUTH, 0.2, seed=1)


def sent(mesh: Mesh, truth: Mesh | None = None, format: str = "ply") -> dict[str, Any]:
    """A form with a mesh and perhaps its truth."""
    files = {"file": (f"a.{format}", to_bytes(mesh, format))}
    if truth is not None:
        files["truth"] = ("truth.ply", to_bytes(truth, "ply"))
    return {"files": files}


def test_a_mesh_in_and_a_mesh_out(http: httpx.Client) -> None:
    form = {"method": "taubin", "iterations": 3, "parameters": '{"step": 0.4}', "boundary": "fixed", "wait": 60}
    reply = http.post("/v1/denoise", **sent(NOISY), data=form)
    assert reply.status_code == 200, reply.text
    found = reply.json()
    wanted = denoise(NOISY, "taubin", 3, boundary="fixed", step=0.4)
    mesh, scalars = read_scalars(http.get(found["mesh"]).content)
    assert np.array_equal(mesh.vertices, wanted.vertices) and np.array_equal(mesh.faces, wanted.faces)
    ways = np.linalg.norm(wanted.vertices - NOISY.vertices, axis=1)
    np.testing.assert_allclose(scalars["displacement"], ways, rtol=1e-12)
    assert found["displacement"] == pytest.approx({"mean": ways.mean(), "largest": ways.max()})
    assert (found["method"], found["iterations"], found["parameters"]) == ("taubin", 3, {"step": 0.4})
    assert found["choice"] is None and found["errors"] is None
    assert http.get(f"/v1/denoise/{found['task']}").json() == found
    for format in ("glb", "obj", "stl", "off"):
        data = http.get(found["mesh"], params={"format": format}).content
        assert len(read(data, format).faces) == len(TRUTH.faces)


def test_with_a_truth_the_errors_come_too(http: httpx.Client) -> None:
    found = http.post("/v1/denoise", **sent(NOISY, TRUTH), data={"wait": 60}).json()
    choice = choose(NOISY)
    said = found["choice"]
    assert (said["surface"], said["reason"]) == (choice.surface, choice.reason)
    for one, part in zip(said["parts"], choice.parts, strict=True):
        assert one == {**asdict(part), "share": pytest.approx(part.share, abs=1e-9)}
    for stage, mesh in (("before", NOISY), ("after", apply_choice(NOISY, choice))):
        wanted = asdict(measure_errors(TRUTH, mesh))
        assert wanted.pop("edge_angle") is found["errors"][stage].pop("edge_angle") is None
        assert found["errors"][stage] == pytest.approx(wanted, rel=1e-6)
    assert found["errors"]["after"]["mean_angle"] < found["errors"]["before"]["mean_angle"]


def test_a_mesh_without_noise_is_left_and_no_iteration_is_said(http: httpx.Client) -> None:
    found = http.post("/v1/denoise", **sent(TRUTH), data={"wait": 60}).json()
    assert (found["choice"]["surface"], found["choice"]["parts"]) == ("clean", [])
    assert (found["iterations"], found["displacement"]) == (0, {"mean": 0.0, "largest": 0.0})


def test_the_order_of_the_two_files_does_not_matter(http: httpx.Client) -> None:
    one = sent(NOISY, TRUTH)["files"]
    turned = {name: one[name] for name in ("truth", "file")}
    form = {"method": "mean", "wait": 60}
    replies = [http.post("/v1/denoise", files=files, data=form).json() for files in (one, turned)]
    assert replies[0]["errors"] == replies[1]["errors"]
    assert replies[0]["errors"]["after"]


def test_bytes_alone_and_triangles_of_an_stl(http: httpx.Client) -> None:
    raw = http.post("/v1/denoise", params={"method": "laplacian", "wait": 60}, content=to_bytes(NOISY, "stl")).json()
    assert (raw["vertices"], raw["faces"]) == (len(NOISY.vertices), len(NOISY.faces))
    assert raw["displacement"]["mean"] > 0


def test_what_takes_longer_is_a_task(http: httpx.Client) -> None:
    reply = http.post("/v1/denoise", **sent(NOISY), data={"wait": 0})
    task = reply.json()["task"]
    assert (reply.status_code, task["kind"], reply.headers["location"]) == (202, "denoise", f"/v1/tasks/{task['id']}")
    done = ended(http, task["id"])
    assert done["state"] == "succeeded" and done["result"]["method"] == "auto"
    assert http.get(f"/v1/denoise/{task['id']}/mesh").status_code == 200


def test_the_same_key_is_the_same_answer(http: httpx.Client) -> None:
    headers = {"Idempotency-Key": "denoise-once"}
    first, again = (http.post("/v1/denoise", **sent(NOISY), data={"wait": 60}, headers=headers) for _ in range(2))
    assert first.json() == again.json()
    assert again.headers["idempotency-replayed"] == "true"
    is_problem(http.post("/v1/denoise", **sent(TRUTH), headers=headers), 409, "idempotency_conflict")


def test_meshes_that_cannot_be_denoised(http: httpx.Client) -> None:
    is_problem(http.post("/v1/denoise", **sent(NOISY, icosphere(2))), 422, "invalid_parameter")
    is_problem(http.post("/v1/denoise", content=b"OFF\n3 1 0\n0 0 0\n1 0 0\n"), 422, "truncated_file")


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "unknown method": ({"method": "best"}, "unknown_name"),
    "unknown parameter": ({"method": "mean", "parameters": '{"stride": 1}'}, "invalid_parameter"),
    "parameter out of range": ({"method": "laplacian", "parameters": '{"step": 2}'}, "invalid_parameter"),
    "parameters no object": ({"parameters": "[1]"}, "validation_error"),
    "parameters no JSON": ({"parameters": "{"}, "validation_error"),
    "no iteration": ({"iterations": 0}, "validation_error"),
    "too many iterations": ({"iterations": 1001}, "validation_error"),
    "unknown boundary": ({"boundary": "loose"}, "validation_error"),
    "unknown field": ({"strength": 1}, "validation_error"),
    "endless wait": ({"wait": 61}, "validation_error"),
}


@pytest.mark.parametrize(("fields", "code"), REFUSED.values(), ids=REFUSED)
def test_what_is_refused_at_once(api: httpx.Client, alone: Served, fields: dict[str, Any], code: str) -> None:
    before = kept(alone)
    is_problem(api.post("/v1/denoise", **sent(NOISY), data=fields), 422, code)
    is_problem(api.post("/v1/denoise", content=to_bytes(NOISY, "ply"), params=fields), 422, code)
    assert kept(alone) == before


def test_files_that_are_refused_at_once(api: httpx.Client, alone: Served) -> None:
    before = kept(alone)
    large = b"ply\n" + b"x" * 200_001
    is_problem(api.post("/v1/denoise", files={"file": ("a.ply", large)}), 413, "too_many_bytes")
    good = ("a.ply", to_bytes(NOISY, "ply"))
    is_problem(api.post("/v1/denoise", files={"file": good, "truth": ("t.ply", large)}), 413, "too_many_bytes")
    is_problem(api.post("/v1/denoise", files={"file": good, "truth": ("t.ply", b"")}), 422, "empty_file")
    is_problem(api.post("/v1/denoise", files={"file": good, "truth": ("t", b"\x00" * 50)}), 415, "unknown_format")
    is_problem(api.post("/v1/denoise", files={"truth": good}), 422, "missing_file")
    is_problem(api.post("/v1/denoise", files=[("file", good), ("truth", good), ("truth", good)]), 400,
               "malformed_multipart")  # fmt: skip
    assert kept(alone) == before


def test_a_mesh_that_is_not_there_yet(api: httpx.Client) -> None:
    task = api.post("/v1/denoise", **sent(NOISY), data={"wait": 0}).json()["task"]["id"]
    is_problem(api.get(f"/v1/denoise/{task}/mesh"), 404, "result_not_found")
    is_problem(api.get(f"/v1/denoise/{task}"), 404, "result_not_found")
    assert api.post(f"/v1/tasks/{task}/cancel").json()["state"] == "cancelled"
    is_problem(api.get(f"/v1/denoise/{task}/mesh"), 404, "result_not_found")


def test_tasks_of_other_kinds_have_no_mesh(http: httpx.Client, collection: str) -> None:
    task = http.post(f"{collection}/shapes", **sent(NOISY)).json()["task"]["id"]
    is_problem(http.get(f"/v1/denoise/{task}/mesh"), 404, "task_not_found")


def test_the_input_goes_and_the_result_stays_until_its_task_goes(service: Served, http: httpx.Client) -> None:
    noisy = add_noise(TRUTH, 0.1, seed=9)
    found = http.post("/v1/denoise", **sent(noisy, TRUTH), data={"method": "mean", "wait": 60}).json()
    # A sweep without grace takes what a task of another test is about to name.
    for state in ("queued", "running"):
        for task in http.get("/v1/tasks", params={"state": state, "limit": 200}).json()["items"]:
            ended(http, task["id"])
    database, blobs = service.database(), service.blobs()
    never = Settings(home=service.home, sweep_grace_seconds=0)
    sweep.sweep(database, blobs, never)
    etag = http.get(found["mesh"]).headers["etag"]
    with database.read() as conn:
        named = sweep.all_referenced(conn)
    assert any(etag.strip('"').startswith(sha256) for sha256 in named)
    sweep.sweep(database, blobs, never.model_copy(update={"keep_query_seconds": 0}))
    is_problem(http.get(found["mesh"]), 404, "task_not_found")
    with database.read() as conn:
        assert set(blobs.all()) <= sweep.all_referenced(conn)
    database.close()


def test_who_may(keyed: Make) -> None:
    admin = keyed("admin")
    admin.post("/v1/collections", json={"name": "shut"}).raise_for_status()
    is_problem(keyed("read", "shut").post("/v1/denoise", **sent(NOISY)), 403, "forbidden_scope")
    reader = keyed("read")
    task = reader.post("/v1/denoise", **sent(NOISY), data={"wait": 0}).json()["task"]["id"]
    assert reader.post(f"/v1/tasks/{task}/cancel").json()["state"] == "cancelled"


def test_the_client(service: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    with Client(service.url) as client:
        found = client.denoise(NOISY, truth=TRUTH)
        assert found.choice is not None and found.before is not None and found.after is not None
        assert found.choice.parts[0].method == choose(NOISY).parts[0].method
        assert found.after.mean_angle < found.before.mean_angle
        wanted = denoise(NOISY, "auto")
        assert client.denoised(found).vertices == pytest.approx(wanted.vertices, abs=1e-9)
        monkeypatch.setattr(client, "_poll", 0.01)  # the answer is then a task
        waited = client.denoise(to_bytes(NOISY, "off"), "mean", 2, boundary="free", format="off")
        assert waited.before is None and waited.choice is None
        assert read(client.denoised_bytes(waited.task, format="obj"), "obj").faces.shape == TRUTH.faces.shape
        with pytest.raises(ServiceError, check=lambda refusal: refusal.code == "unknown_name"):
            client.denoise(NOISY, "best")
