"""SIGKILL to the API between blob and row, and between row and reply: nothing is lost that was answered."""

from __future__ import annotations

import hashlib
import signal

import httpx
import pytest
from sqlalchemy import func, select

from store import tables
from tests.crash.house import mesh_bytes, wait_until


def upload(client, data):
    return client.post("/v1/collections/animals/shapes", content=data, headers={"Content-Type": "model/ply"})


def count(house, table):
    with house.database.read() as conn:
        return conn.execute(select(func.count()).select_from(table)).scalar_one()


def killed_while_uploading(house, point, data):
    service, client = house.start_service(fault=f"{point}=kill")
    with client, pytest.raises(httpx.TransportError):
        upload(client, data)
    assert service.end() == -signal.SIGKILL


def test_killed_between_blob_and_row(house):
    house.collection()
    data = mesh_bytes(0)
    killed_while_uploading(house, "upload.blob_stored", data)
    assert [count(house, table) for table in (tables.shape, tables.task)] == [0, 0]
    sha256 = hashlib.sha256(data).hexdigest()
    assert house.blobs.exists(sha256)
    house.sweep(grace_seconds=3600)
    assert house.blobs.exists(sha256), "within its grace a blob may be about to get its row"
    house.sweep(grace_seconds=0)
    assert not house.blobs.exists(sha256)


def test_killed_between_row_and_reply(house):
    house.collection()
    data = mesh_bytes(0)
    killed_while_uploading(house, "upload.row_committed", data)
    assert [count(house, table) for table in (tables.shape, tables.task)] == [1, 1]
    _, client = house.start_service()
    house.start_worker()
    with client:
        again = upload(client, data)
        assert again.status_code == 200
        assert again.json()["shape"]["sha256"] == hashlib.sha256(data).hexdigest()
        location = again.headers["location"]
        wait_until(lambda: client.get(location).json()["state"] == "indexed", what="the shape being indexed")
    assert [count(house, table) for table in (tables.shape, tables.task)] == [1, 1]
    house.check()


def test_killed_under_load_every_202_ends(house):
    house.collection()
    house.start_worker()
    accepted, service, client = {}, None, None
    for number in range(24):
        data = mesh_bytes(number)
        if service is None:
            service, client = house.start_service()
        response = upload(client, data)
        assert response.status_code == 202
        accepted[response.json()["shape"]["id"]] = response.json()["task"]["id"]
        if number in (7, 15):
            client.close()
            service.kill()
            assert service.end() == -signal.SIGKILL
            service = None
    client.close()

    def ended():
        with house.database.read() as conn:
            states = conn.execute(select(tables.shape.c.id, tables.shape.c.state)).all()
        found = {shape: state for shape, state in states if state in ("indexed", "failed")}
        return found.keys() >= accepted.keys() and found

    assert set(wait_until(ended, 90, "the end of all").values()) == {"indexed"}
    assert count(house, tables.shape) == count(house, tables.task) == len(accepted)
    house.check()

