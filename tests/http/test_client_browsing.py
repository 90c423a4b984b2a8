"""What the client has for looking through collections, and for what pages draw, against the real service."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from reebase.client import Client, ServiceError
from reebase.mesh.read import read
from tests.http.serving import Served
from tests.shapes import capsule


@pytest.fixture(scope="module")
def client(service: Served) -> Iterator[Client]:
    with Client(service.url, patience=2.0) as opened:
        yield opened


@pytest.fixture(scope="module")
def shelf(client: Client) -> dict[str, str]:
    """name -> id of three described shapes in the collection ``browsed``."""
    client.create_collection("browsed", profile={"bands": 32})
    uploads = [
        client.upload("browsed", capsule(length, nu=12, along=16), name=f"{name} capsule", label="capsules")
        for name, length in (("middle", 3.0), ("short", 2.0), ("long", 4.0))
    ]
    for upload in uploads:
        client.wait(upload.task, timeout=60)
    return {upload.shape.name.split()[0]: upload.shape.id for upload in uploads}


def test_lists(client: Client, shelf: dict[str, str]) -> None:
    names = [shape.name for shape in client.shapes("browsed", sort="-name")]
    assert names == ["short capsule", "middle capsule", "long capsule"]
    assert [shape.id for shape in client.shapes("browsed", text="LONG")] == [shelf["long"]]
    assert client.labels("browsed") == {"capsules": 3}
    assert client.label_shapes("browsed", [shelf["long"]], None) == 1
    assert client.labels("browsed") == {"capsules": 2, None: 1}
    assert client.label_shapes("browsed", list(shelf.values()), "capsules") == 3


def test_undoing_a_deletion(client: Client, shelf: dict[str, str]) -> None:
    client.delete_shape("browsed", shelf["long"])
    with pytest.raises(ServiceError, match="There is no shape"):
        client.shape("browsed", shelf["long"])
    assert client.restore_shape("browsed", shelf["long"]).state == "indexed"
    both = (shelf["long"], shelf["short"])
    assert set(client.delete_shapes("browsed", [*both, "absent"])) == set(both)
    assert client.restore_shapes("browsed", both) == both


def test_what_is_drawn(client: Client, shelf: dict[str, str]) -> None:
    shape = shelf["middle"]
    mesh = client.mesh("browsed", shape)
    assert client.thumbnail("browsed", shape).startswith(b"\x89PNG")
    assert len(read(client.display_mesh("browsed", shape)).faces) == len(mesh.faces)
    scalar = client.scalar("browsed", shape, "phi2")
    assert scalar == pytest.approx(client.field("browsed", shape), rel=1e-5, abs=1e-6)
    assert (client.scalar("browsed", shape, "displacement") >= 0).all()


def test_a_map_and_a_plot(client: Client, shelf: dict[str, str]) -> None:
    assert client.map("browsed") == {}
    client.wait(client.make_map("browsed"), timeout=60)
    found = client.map("browsed")
    assert set(found) == set(shelf.values())
    assert np.abs(list(found.values())).max() == 1.0
    evaluation = client.start_evaluation(collection="browsed", bootstrap=0)
    client.wait(evaluation.task, timeout=60)
    assert client.plot(evaluation.id, "matrix", theme="dark").startswith(b"<?xml")


def test_the_synthetic_set(client: Client) -> None:
    client.create_collection("made", profile={"bands": 32})
    task = client.add_synthetic("made", per_class=2, seed=3)
    assert task.kind == "synthesise"
    client.delete_collection("made")
    assert client.task(task.id).state == "cancelled"
