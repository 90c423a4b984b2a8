"""Uploads on their way in: what is accepted, what is refused, and that a refusal leaves nothing behind."""

from __future__ import annotations

import hashlib
import itertools
import json
import socket
import time
from collections.abc import Iterator
from typing import Any

import httpx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reebase.mesh.write import to_bytes
from service.errors import MalformedMultipart
from service.multipart import Form
from store import tasks
from tests.http.serving import Served
from tests.http.test_problems import is_problem
from tests.shapes import icosphere, moved

PLY = to_bytes(icosphere(1), "ply")
SHA256 = hashlib.sha256(PLY).hexdigest()


def different(number: int) -> bytes:
    """A mesh of its own for each number."""
    return to_bytes(moved(icosphere(1), (number, 0, 0)), "ply")


def kept(alone: Served) -> tuple[set[str], list[str], int]:
    """Blobs, half-written files and tasks."""
    database = alone.database()
    try:
        with database.read() as conn:
            count = len(tasks.list_page(conn, limit=500).items)
    finally:
        database.close()
    return set(alone.blobs().all()), alone.unfinished(), count


@pytest.fixture
def leaves_nothing(alone: Served, shelf: str) -> Iterator[None]:
    """Fails when a test stores anything."""
    before = kept(alone)
    yield
    end = time.monotonic() + 5
    while alone.unfinished() and time.monotonic() < end:
        time.sleep(0.02)  # a broken connection is noticed in a moment
    assert kept(alone) == before


def test_multipart(api: httpx.Client, alone: Served, shelf: str) -> None:
    reply = api.post(
        f"{shelf}/shapes", files={"file": ("ball.ply", PLY)},
        data={"name": "a ball", "label": "balls", "tags": ["round", "small, smooth"],
              "metadata": json.dumps({"radius": 1, "parts": ["shell"]})},
    )  # fmt: skip
    assert reply.status_code == 202
    shape, task = reply.json()["shape"], reply.json()["task"]
    assert reply.headers["location"] == f"{shelf}/shapes/{shape['id']}"
    assert (shape["name"], shape["label"], shape["state"]) == ("a ball", "balls", "queued")
    assert shape["tags"] == ["round", "small", "smooth"]
    assert shape["metadata"] == {"radius": 1, "parts": ["shell"]}
    assert (shape["sha256"], shape["bytes"], shape["format"]) == (SHA256, len(PLY), "ply")
    assert shape["filename"] == "ball.ply"
    assert (task["kind"], task["state"], task["shape"]) == ("describe", "queued", shape["id"])
    assert alone.blobs().get(SHA256) == PLY
    assert api.get(reply.headers["location"]).json() == shape


def test_raw(api: httpx.Client, shelf: str) -> None:
    asked = {"name": "a ball", "label": "balls", "tags": ["round", "small"], "metadata": '{"radius": 1}'}
    shape = api.post(f"{shelf}/shapes", content=PLY, params=asked).json()["shape"]
    assert (shape["name"], shape["label"], shape["tags"]) == ("a ball", "balls", ["round", "small"])
    assert (shape["metadata"], shape["sha256"], shape["filename"]) == ({"radius": 1}, SHA256, None)


def test_a_raw_body_is_named_by_its_headers(api: httpx.Client, shelf: str) -> None:
    headers = {"Content-Disposition": 'attachment; filename="../x/ball.ply"', "Content-Type": "model/ply"}
    shape = api.post(f"{shelf}/shapes", content=PLY, headers=headers).json()["shape"]
    assert (shape["filename"], shape["name"], shape["format"]) == ("ball.ply", "ball.ply", "ply")


def test_the_same_bytes_are_the_same_shape(api: httpx.Client, alone: Served, shelf: str) -> None:
    first = api.post(f"{shelf}/shapes", files={"file": ("a.ply", PLY)}, data={"label": "one"})
    before = kept(alone)
    second = api.post(f"{shelf}/shapes", content=PLY, params={"label": "two"})
    assert (first.status_code, second.status_code) == (202, 200)
    assert second.json()["shape"] == first.json()["shape"]
    assert second.headers["location"] == first.headers["location"]
    assert kept(alone) == before


@pytest.mark.parametrize("format", ["ply", "obj", "off", "stl", "glb"])
def test_formats_are_told_from_content(api: httpx.Client, shelf: str, format: str) -> None:
    data = to_bytes(icosphere(1), format)
    assert api.post(f"{shelf}/shapes", content=data).json()["shape"]["format"] == format


def test_a_large_binary_stl_without_a_name(api: httpx.Client, shelf: str) -> None:
    # More than the bytes that are looked at first: its size tells what it is.
    data = to_bytes(icosphere(3), "stl")
    assert len(data) > 64_000
    chunks = (data[i : i + 7000] for i in range(0, len(data), 7000))
    assert api.post(f"{shelf}/shapes", content=chunks).json()["shape"]["format"] == "stl"


@pytest.mark.parametrize("size", [0, 1, 99_999])
def test_empty_and_unknown_files(api: httpx.Client, shelf: str, leaves_nothing: None, size: int) -> None:
    code = ("unknown_format", 415) if size else ("empty_file", 422)
    for body in ({"content": b"\x00" * size}, {"files": {"file": ("a.xyz", b"\x00" * size)}}):
        is_problem(api.post(f"{shelf}/shapes", **body), code[1], code[0])


def test_a_format_that_is_not_read(api: httpx.Client, shelf: str, leaves_nothing: None) -> None:
    value = is_problem(
        api.post(f"{shelf}/shapes", content=PLY, params={"format": "step"}), 415, "unknown_format"
    )
    assert "PLY" in value["detail"]


TOO_MUCH: dict[str, tuple[dict[str, Any], str]] = {
    "long label": ({"label": "x" * 100_000}, "label"),
    "long name": ({"name": "x" * 201}, "name"),
    "long tag": ({"tags": "x" * 65}, "tags"),
    "many tags": ({"tags": ",".join(map(str, range(33)))}, "tags"),
    "large metadata": ({"metadata": json.dumps({"a": "x" * 20_000})}, "metadata"),
    "metadata of words": ({"metadata": "red"}, "metadata"),
    "metadata of NaN": ({"metadata": '{"a": NaN}'}, "metadata"),
    "metadata as a list": ({"metadata": "[1]"}, "metadata"),
    "deep metadata": ({"metadata": '{"a": ' + "[" * 32 + "]" * 32 + "}"}, "metadata"),
    "very deep metadata": ({"metadata": '{"a": ' + "[" * 600 + "]" * 600 + "}"}, "metadata"),
    "many members": ({"metadata": json.dumps(dict.fromkeys(map(str, range(257)), 1))}, "metadata"),
    "null character": ({"name": "a\x00b"}, "name"),
    "line break": ({"label": "a\nb"}, "label"),
    "blank name": ({"name": "  "}, "name"),
    "another field": ({"colour": "red"}, "colour"),
    "label twice": ({"label": ["a", "b"]}, "label"),
}


@pytest.mark.parametrize(("fields", "parameter"), TOO_MUCH.values(), ids=TOO_MUCH)
def test_fields_that_are_not_allowed(
    api: httpx.Client, shelf: str, leaves_nothing: None, fields: dict[str, Any], parameter: str
) -> None:
    reply = api.post(f"{shelf}/shapes", files={"file": ("a.ply", PLY)}, data=fields)
    value = is_problem(reply, 422, "validation_error")
    assert [error["parameter"].split(".")[0] for error in value["errors"]] == [parameter]


def test_a_label_that_reads_null(api: httpx.Client, shelf: str) -> None:
    reply = api.post(f"{shelf}/shapes", content=PLY, params={"label": "null", "name": "null"})
    shape = reply.json()["shape"]
    assert (shape["label"], shape["name"]) == ("null", "null")


def test_a_limit_is_said(api: httpx.Client, shelf: str) -> None:
    reply = api.post(f"{shelf}/shapes", content=PLY, params={"label": "x" * 201})
    assert "at most 200" in is_problem(reply, 422, "validation_error")["detail"]


BOUNDARY = "frontier"
PART = b'--frontier\r\nContent-Disposition: form-data; name="file"; filename="a.ply"\r\n\r\n'

MULTIPART: dict[str, tuple[str, bytes, int, str]] = {
    "no boundary": ("multipart/form-data", b"x", 400, "malformed_multipart"),
    "another boundary": ("multipart/form-data; boundary=other", PART, 400, "malformed_multipart"),
    "no end": ("", PART + PLY, 400, "malformed_multipart"),
    "no body": ("", b"", 400, "malformed_multipart"),
    "no disposition": ("", b"--frontier\r\n\r\nx\r\n--frontier--\r\n", 400, "malformed_multipart"),
    "another disposition": (
        "", b'--frontier\r\nContent-Disposition: file; name="file"\r\n\r\nx\r\n--frontier--\r\n', 400,
        "malformed_multipart",
    ),
    "two files": ("", PART + PLY + b"\r\n" + PART + PLY + b"\r\n--frontier--\r\n", 400, "malformed_multipart"),
    "endless header": ("", b"--frontier\r\nX: " + b"x" * 20_000, 400, "malformed_multipart"),
    "many parts": (
        "", b'--frontier\r\nContent-Disposition: form-data; name="tags"\r\n\r\na\r\n' * 200, 400,
        "malformed_multipart",
    ),
    "a field that is not UTF-8": (
        "", b'--frontier\r\nContent-Disposition: form-data; name="label"\r\n\r\n\xff\r\n--frontier--\r\n', 400,
        "malformed_multipart",
    ),
    "no file": (
        "", b'--frontier\r\nContent-Disposition: form-data; name="label"\r\n\r\nx\r\n--frontier--\r\n', 422,
        "missing_file",
    ),
    "an empty file": ("", PART + b"\r\n--frontier--\r\n", 422, "empty_file"),
    "mixed": ("multipart/mixed; boundary=frontier", PART + PLY, 415, "unsupported_media_type"),
}  # fmt: skip


@pytest.mark.parametrize(("kind", "body", "status", "code"), MULTIPART.values(), ids=MULTIPART)
def test_wrong_multipart(
    api: httpx.Client, shelf: str, leaves_nothing: None, kind: str, body: bytes, status: int, code: str
) -> None:
    headers = {"Content-Type": kind or f"multipart/form-data; boundary={BOUNDARY}"}
    is_problem(api.post(f"{shelf}/shapes", content=body, headers=headers), status, code)


@pytest.mark.parametrize("multipart", [False, True])
def test_a_body_over_the_limit(
    api: httpx.Client, shelf: str, leaves_nothing: None, multipart: bool
) -> None:
    large = PLY + b"\x00" * 300_000
    body: dict[str, Any] = {"files": {"file": ("a.ply", large)}} if multipart else {"content": large}
    value = is_problem(api.post(f"{shelf}/shapes", **body), 413, "too_many_bytes")
    assert value["details"]["limit"] == 200_000
    chunks = (large[i : i + 10_000] for i in range(0, len(large), 10_000))
    is_problem(api.post(f"{shelf}/shapes", content=chunks), 413, "too_many_bytes")


def raw_request(alone: Served, head: str, kind: str = "model/ply") -> socket.socket:
    """A connection on which a request has begun."""
    address = httpx.URL(alone.url)
    connection = socket.create_connection((address.host, address.port or 80), timeout=10)
    connection.sendall(f"{head}\r\nHost: 127.0.0.1\r\nContent-Type: {kind}\r\n".encode())
    return connection


def test_a_declared_length_over_the_limit_is_refused_at_once(
    alone: Served, shelf: str, leaves_nothing: None
) -> None:
    with raw_request(alone, f"POST {shelf}/shapes HTTP/1.1") as connection:
        connection.sendall(b"Content-Length: 99999999999\r\nExpect: 100-continue\r\n\r\n")
        assert connection.recv(4096).startswith(b"HTTP/1.1 413 ")


def test_reading_stops_when_a_stream_is_over_the_limit(
    alone: Served, shelf: str, leaves_nothing: None
) -> None:
    with raw_request(alone, f"POST {shelf}/shapes HTTP/1.1") as connection:
        connection.sendall(b"Transfer-Encoding: chunked\r\n\r\n")
        piece = b"10000\r\n" + PLY.ljust(0x10000, b"\x00") + b"\r\n"
        for _ in range(16):
            connection.sendall(piece)  # never ends
        assert connection.recv(4096).startswith(b"HTTP/1.1 413 ")


@pytest.mark.parametrize("where", ["before", "behind"])
def test_bytes_around_the_parts_of_a_form_count_too(
    api: httpx.Client, shelf: str, leaves_nothing: None, where: str
) -> None:
    nothing = (b"\r\n" * 0x8000 for _ in range(50))
    form = iter([PART + PLY + b"\r\n--frontier--\r\n"])
    pieces = itertools.chain(nothing, form) if where == "before" else itertools.chain(form, nothing)
    headers = {"Content-Type": f"multipart/form-data; boundary={BOUNDARY}"}
    is_problem(api.post(f"{shelf}/shapes", content=pieces, headers=headers), 413, "too_many_bytes")


@pytest.mark.parametrize("kind", ["model/ply", "application/json"])
def test_a_client_that_stops_sending(
    alone: Served, shelf: str, leaves_nothing: None, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.setattr("service.bodies.IDLE_SECONDS", 0.2)
    with raw_request(alone, f"POST {shelf}/query HTTP/1.1", kind) as connection:
        connection.sendall(b"Content-Length: 20000\r\n\r\n" + b"{" * 10)
        assert connection.recv(4096).startswith(b"HTTP/1.1 408 ")


def test_a_client_that_leaves(alone: Served, shelf: str, leaves_nothing: None) -> None:
    with raw_request(alone, f"POST {shelf}/shapes HTTP/1.1") as connection:
        connection.sendall(b"Content-Length: 150000\r\n\r\n" + PLY.ljust(140_000, b"\x00"))


def test_an_unknown_collection_is_refused_before_the_body_is_read(alone: Served) -> None:
    with raw_request(alone, "POST /v1/collections/absent/shapes HTTP/1.1") as connection:
        connection.sendall(b"Content-Length: 150000\r\n\r\n")
        assert connection.recv(4096).startswith(b"HTTP/1.1 404 ")


class _Sink:
    def __init__(self) -> None:
        self.named: str | None = None
        self.data = b""

    def begin(self, filename: str | None, media_type: str | None, part: str = "file") -> None:
        self.named = filename

    def write(self, data: bytes) -> None:
        self.data += data


def _body(data: bytes, label: str) -> bytes:
    request = httpx.Request(
        "POST", "http://x", files={"file": ("ä.ply", data)}, data={"label": label},
        headers={"Content-Type": f"multipart/form-data; boundary={BOUNDARY}"},
    )  # fmt: skip
    return request.read()


@settings(max_examples=60, deadline=None)
@given(
    data=st.binary(max_size=300) | st.sampled_from([b"\r\n--frontie", b"\r\n--frontier\r", b"--frontier--"]),
    label=st.text(max_size=20).filter(lambda text: "\r" not in text and "\n" not in text),
    step=st.integers(1, 64),
)
def test_a_form_is_the_same_however_it_is_cut(data: bytes, label: str, step: int) -> None:
    body = _body(data, label)
    sink = _Sink()
    form = Form(BOUNDARY.encode(), sink)
    for start in range(0, len(body), step):
        form.feed(body[start : start + step])
    form.finish()
    assert (sink.data, sink.named, form.fields) == (data, "ä.ply", {"label": [label]})


@settings(max_examples=60, deadline=None)
@given(cut=st.floats(0, 0.98))
def test_a_form_that_ends_early_is_refused(cut: float) -> None:
    body = _body(b"x" * 50, "a")
    form = Form(BOUNDARY.encode(), _Sink())
    with pytest.raises(MalformedMultipart):
        form.feed(body[: int(cut * (len(body) - 6))])
        form.finish()


@pytest.mark.parametrize("route", ["shapes", "query"])
def test_a_blob_that_was_swept_before_its_row_gets_no_row(
    api: httpx.Client, alone: Served, shelf: str, leaves_nothing: None, monkeypatch: pytest.MonkeyPatch, route: str
) -> None:
    data = different(8)

    def swept(name: str) -> None:
        if name == "upload.blob_stored":
            assert alone.blobs().delete(hashlib.sha256(data).hexdigest())

    monkeypatch.setattr("store.faults.point", swept)
    reply = api.post(f"{shelf}/{route}", content=data)
    is_problem(reply, 503, "store_busy")
    assert "retry-after" in reply.headers


def test_a_crash_between_blob_and_row_can_be_tried_again(
    api: httpx.Client, alone: Served, shelf: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = different(7)

    def crash(name: str) -> None:
        raise RuntimeError(name)

    with monkeypatch.context() as broken:
        broken.setattr("store.faults.point", crash)
        is_problem(api.post(f"{shelf}/shapes", content=data), 500, "internal_error")
    assert alone.blobs().exists(hashlib.sha256(data).hexdigest())
    assert api.get(f"{shelf}/shapes").json()["items"] == []
    assert api.post(f"{shelf}/shapes", content=data).status_code == 202
