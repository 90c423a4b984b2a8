"""Each method of the client against the real service."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from reebase.client import Answer, Client, ServiceError, Shape, TaskFailed
from reebase.mesh.read import read
from reebase.mesh.write import to_bytes, write
from reebase.pipeline import Profile, describe
from tests.http.serving import Served
from tests.shapes import capsule, torus

PROFILE = {"bands": 32}
_numbers = itertools.count()


@pytest.fixture(scope="module")
def client(service: Served) -> Iterator[Client]:
    with Client(service.url, patience=2.0) as opened:
        yield opened


@pytest.fixture
def empty(client: Client) -> str:
    """A new collection."""
    return client.create_collection(f"client-{next(_numbers)}", profile=PROFILE).name


@pytest.fixture(scope="module")
def zoo(client: Client) -> dict[str, Shape]:
    """Three capsules and a torus in the collection ``menagerie``, described."""
    client.create_collection("menagerie", description="For the client", profile=PROFILE)
    uploads = [
        client.upload(
            "menagerie", capsule(length, nu=12, along=16), name=f"capsule {length:g}", label="capsules",
            tags=["long", "even"] if length > 3 else ["even"], metadata={"length": length},
        )
        for length in (2.0, 4.0, 6.0)
    ]  # fmt: skip
    uploads.append(client.upload("menagerie", torus(nu=24, nv=10), name="torus", label="tori"))
    for upload in uploads:
        client.wait(upload.task, timeout=60)
    return {upload.shape.name: client.shape("menagerie", upload.shape.id) for upload in uploads}


def refused(code: str) -> pytest.RaisesExc[ServiceError]:
    return pytest.raises(ServiceError, check=lambda refusal: refusal.code == code)


def test_collections(client: Client, empty: str) -> None:
    found = client.collection(empty)
    assert (found.description, found.profile["bands"], found.counts.shapes) == ("", 32, 0)
    with refused("collection_exists"):
        client.create_collection(empty)
    assert client.create_collection(empty, exist_ok=True) == found
    changed = client.update_collection(empty, description="New", profile={"bands": 16})
    assert (changed.description, changed.profile["bands"]) == ("New", 16)
    assert changed.updated_at >= found.updated_at
    assert empty in [one.name for one in client.collections()]
    client.delete_collection(empty)
    with refused("collection_not_found"):
        client.collection(empty)
    with refused("validation_error"):
        client.create_collection("No Good Name")


def test_uploads_of_all_kinds_are_one_shape(client: Client, empty: str, tmp_path: Path) -> None:
    mesh = capsule(nu=8, along=8)
    path = tmp_path / "ü, [x] 'y'.ply"
    write(mesh, path)
    first = client.upload(empty, path, label="a", tags=["x", "y"], metadata={"n": 1.5, "é": [1]})
    assert first.created
    assert (first.shape.name, first.shape.filename) == (path.name, path.name)
    assert (first.shape.tags, first.shape.metadata) == (("x", "y"), {"n": 1.5, "é": [1]})
    second, third = client.upload(empty, path.read_bytes()), client.upload(empty, mesh)
    assert not (second.created or third.created)
    assert first.shape.id == second.shape.id == third.shape.id
    assert client.original(empty, first.shape.id) == path.read_bytes()
    with refused("empty_file"):
        client.upload(empty, b"")
    with refused("unknown_format"):
        client.upload(empty, b"\0\1\2\3", format="doc")


def test_shapes_are_found_changed_and_deleted(client: Client, empty: str) -> None:
    ids = [client.upload(empty, capsule(n, nu=6, along=6), name=f"s{n}", label="a").shape.id for n in (2, 3, 4)]
    assert [shape.id for shape in client.shapes(empty)] == ids
    changed = client.update_shape(empty, ids[0], label=None, tags=["x"], metadata={"k": 1}, name="new")
    assert (changed.label, changed.tags, changed.metadata, changed.name) == (None, ("x",), {"k": 1}, "new")
    assert [shape.id for shape in client.shapes(empty, label="a")] == ids[1:]
    assert [shape.id for shape in client.shapes(empty, tags=["x"])] == ids[:1]
    assert [shape.id for shape in client.shapes(empty, sha256=changed.sha256)] == ids[:1]
    client.delete_shape(empty, ids[0])
    with refused("shape_not_found"):
        client.shape(empty, ids[0])
    with refused("shape_not_found"):
        client.delete_shape(empty, ids[0])


def test_long_lists_are_walked_page_by_page(
    client: Client, zoo: dict[str, Shape], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("reebase.client.requests._PAGE", 2)
    assert {shape.name for shape in client.shapes("menagerie")} == set(zoo)
    assert len({task.id for task in client.tasks(collection="menagerie", kind="describe")}) == len(zoo)


def test_what_is_learnt_of_a_shape_is_what_the_library_learns(client: Client, zoo: dict[str, Shape]) -> None:
    # Another process may sum in another order.
    near = partial(pytest.approx, rel=1e-7, abs=1e-9)
    shape = zoo["capsule 4"]
    local = describe(to_bytes(capsule(4.0, nu=12, along=16), "ply"), Profile(bands=32))
    assert (shape.state, shape.settled, shape.endpoint_count) == ("indexed", True, 2)
    assert client.features("menagerie", shape.id) == near(local.features)
    assert client.field("menagerie", shape.id) == near(local.field, nan_ok=True)
    graph = client.skeleton("menagerie", shape.id)
    assert graph.positions == near(local.skeleton.positions)
    assert np.array_equal(graph.edges, local.skeleton.edges)
    assert np.array_equal(graph.endpoints, local.skeleton.endpoints)
    assert graph.root == local.skeleton.root
    assert client.health("menagerie", shape.id).repairs == local.health.repairs
    assert client.mesh("menagerie", shape.id).vertices == near(local.denoised.vertices)
    assert np.array_equal(client.mesh("menagerie", shape.id, stage="cleaned").vertices, local.cleaned.vertices)
    assert len(read(client.mesh_bytes("menagerie", shape.id, format="glb"), "glb").faces) == len(local.cleaned.faces)


def test_results_of_a_shape_that_failed(client: Client, empty: str) -> None:
    upload = client.upload(empty, b"OFF\n3 1 0\n0 0 0\n0 0 0\n0 0 0\n3 0 1 2\n", name="flat.off")
    with pytest.raises(TaskFailed, match="degenerate_mesh"):
        client.wait(upload.task, timeout=60)
    failed = client.shape(empty, upload.shape.id)
    assert failed.state == "failed"
    assert failed.error is not None
    assert failed.error.code == "degenerate_mesh"
    with refused("result_not_found"):
        client.skeleton(empty, failed.id)
    again = client.retry_shape(empty, failed.id)
    with pytest.raises(TaskFailed):
        client.wait(again, timeout=60)
    with refused("task_not_cancellable"):
        client.cancel(again.id)


def test_queries_by_shape_and_by_mesh_agree(client: Client, zoo: dict[str, Shape]) -> None:
    one = zoo["capsule 2"]
    by_shape = client.query("menagerie", shape=one.id, k=5)
    by_mesh = client.query("menagerie", source=client.original("menagerie", one.id), k=5)
    assert by_mesh.hits[0].shape.id == one.id
    assert by_mesh.hits[0].dissimilarity == 0.0
    rest = [(hit.shape.id, hit.dissimilarity) for hit in by_mesh.hits[1:]]
    assert rest == [(hit.shape.id, hit.dissimilarity) for hit in by_shape.hits]
    assert sum(by_mesh.buckets.values()) == by_mesh.considered == len(zoo)
    best = by_shape.hits[0]
    charges = [one.charge for one in best.unmatched_query + best.unmatched_hit]
    assert sum(pair.distance for pair in best.pairs) + sum(charges) == pytest.approx(best.graph_dissimilarity)


def test_queries_with_filters(client: Client, zoo: dict[str, Shape]) -> None:
    one = zoo["torus"]
    for filters, names in (
        ({"tags": ["long", "even"]}, {"capsule 4", "capsule 6"}),
        ({"label": "capsules", "metadata": {"length": 2.0}}, {"capsule 2"}),
        ({"max_dissimilarity": 0.0, "label": "capsules"}, set()),
    ):
        for asked in ({"shape": one.id}, {"source": torus(nu=24, nv=10)}):
            answer = client.query("menagerie", tolerance=None, **asked, **filters)
            assert {hit.shape.name for hit in answer.hits} == names
    with refused("unknown_name"):
        client.query("menagerie", shape=one.id, measure="best")
    with refused("validation_error"):
        client.query("menagerie", source=torus(), k=0)


def test_batches(client: Client, zoo: dict[str, Shape]) -> None:
    known = {"shape": zoo["torus"].id, "k": 2, "tolerance": None, "measure": "greedy"}
    answer, refusal = client.query_batch("menagerie", [known, {"shape": "nobody"}])
    assert isinstance(answer, Answer)
    assert len(answer.hits) == 2
    assert isinstance(refusal, ServiceError)
    assert refusal.code == "shape_not_found"


def test_tasks(client: Client, zoo: dict[str, Shape]) -> None:
    shape = zoo["torus"]
    assert shape.task is not None
    task = client.task(shape.task)
    assert (task.kind, task.state, task.shape, task.collection) == ("describe", "succeeded", shape.id, "menagerie")
    assert task.ended
    assert task.progress.fraction == 1.0
    assert [one.id for one in client.tasks(shape=shape.id, state="succeeded")] == [task.id]
    assert client.wait(task.id) == task
    with refused("task_not_retryable"):
        client.retry(task.id)
    with refused("task_not_found"):
        client.task("nobody")


def test_an_evaluation_from_start_to_end(client: Client, zoo: dict[str, Shape]) -> None:
    started = client.start_evaluation(collection="menagerie", measure="greedy", bootstrap=10)
    with refused("result_not_found"):
        client.matrix(client.start_evaluation(synthetic={"per_class": 2, "classes": ["ants", "crabs"]}).id)
    client.wait(started.task, timeout=60)
    found = client.evaluation(started.id)
    assert found.report is not None
    assert set(found.report["overall"]) == {"nn", "first_tier", "second_tier", "e_measure", "dcg", "map"}
    assert found.request["measure"] == "greedy"
    matrix = client.matrix(found.id)
    assert matrix.values.shape == (4, 4)
    assert {item["label"] for item in matrix.items} == {"capsules", "tori"}
    others = [one for one in client.evaluations() if one.id != found.id]
    assert others[0].task.kind == "evaluate"
    for one in (found, *others):
        client.delete_evaluation(one.id)
    assert not list(client.evaluations())
    with refused("unknown_name"):
        client.start_evaluation(collection="menagerie", descriptor="dna")


def test_what_the_service_says_of_itself(client: Client) -> None:
    assert client.ready()
    assert client.readiness().status == "ready"
    assert client.limits().max_upload_bytes == 256 * 2**20
    formats = client.formats()
    assert {"obj", "off", "ply", "stl", "glb", "3mf"} <= set(formats.read)
    assert "glb" in formats.written
    assert {"none", "finite_volume", "bilateral"} <= {one.name for one in client.filters() if one.description}
    assert client.profiles()["thesis"]["levels"] == "width"
    assert {one.name for one in client.measures()} >= {"matching", "matching_mean", "greedy", "literal"}
