"""The client without a socket: what it repeats, what it gives up, how it says so."""

from __future__ import annotations

import itertools
import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

import reebase.client
from reebase.client import (
    Client,
    RequestBroken,
    ServiceError,
    ServiceUnreachable,
    TaskFailed,
    UnexpectedReply,
    WaitTimeout,
)
from reebase.client import transport as internals
from reebase.errors import ParameterError, ReebaseError

Handler = Callable[[httpx.Request], httpx.Response]
NOW = "2026-11-22T08:00:00.000Z"
COLLECTION: dict[str, Any] = {
    "name": "zoo", "description": "", "profile": {}, "profile_key": "k", "created_at": NOW, "updated_at": NOW,
    "counts": {"shapes": 3, "states": {"indexed": 3}, "endpoints": {"4": 3}}, "of a later version": 1,
}  # fmt: skip
TASK: dict[str, Any] = {
    "id": "t1", "kind": "describe", "state": "queued", "progress": {"stage": None, "fraction": 0.0},
    "collection": "zoo", "shape": "s1", "error": None, "result": None, "attempt": 0, "crashes": 0,
    "cancel_requested": False, "created_at": NOW, "started_at": None, "finished_at": None,
}  # fmt: skip
SHAPE: dict[str, Any] = {
    "id": "s1", "collection": "zoo", "name": "a", "label": None, "tags": ["x"], "metadata": {}, "state": "queued",
    "sha256": "0", "bytes": 3, "format": "off", "filename": None, "endpoint_count": None, "flags": [], "task": "t1",
    "error": None, "created_at": NOW, "updated_at": NOW,
}  # fmt: skip


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(internals, "_FIRST_PAUSE", 0.002)
    monkeypatch.setattr(internals, "_LONGEST_PAUSE", 0.01)
    monkeypatch.delenv("REEBASE_API_KEY", raising=False)


class Recorder:
    """Answers with one of ``replies`` after the other, the last one again and again; an exception is raised."""

    def __init__(self, *replies: httpx.Response | Exception) -> None:
        self.requests: list[httpx.Request] = []
        self.bodies: list[bytes] = []
        self._replies = itertools.chain(replies, itertools.repeat(replies[-1]))

    def __call__(self, request: httpx.Request) -> httpx.Response:
        self.requests.append(request)
        self.bodies.append(request.read())
        reply = next(self._replies)
        if isinstance(reply, Exception):
            raise reply
        return reply


def client_of(handler: Handler, **options: Any) -> Client:
    return Client("http://service:8000", transport=httpx.MockTransport(handler), **{"patience": 5.0, **options})


def problem(status: int, code: str, **headers: str) -> httpx.Response:
    return httpx.Response(status, json={"code": code, "detail": f"because {code}"}, headers=headers)


BROKEN = httpx.ReadError("reset")
LOST = httpx.RemoteProtocolError("gone")
REFUSED = httpx.ConnectError("refused")


@pytest.mark.parametrize("trouble", [BROKEN, LOST, REFUSED, httpx.ReadTimeout("late"), httpx.Response(503),
                                     httpx.Response(502), httpx.Response(504), problem(429, "rate_limited")])
def test_reads_are_repeated_until_they_succeed(trouble: httpx.Response | Exception) -> None:
    handler = Recorder(trouble, trouble, httpx.Response(200, json=COLLECTION))
    found = client_of(handler).collection("zoo")
    assert len(handler.requests) == 3
    assert found.counts.endpoints == {4: 3}
    assert found.created_at.utcoffset() is not None


def test_a_creating_post_is_repeated_under_one_key() -> None:
    handler = Recorder(BROKEN, problem(409, "idempotency_in_progress"), httpx.Response(201, json=COLLECTION))
    client_of(handler).create_collection("zoo")
    keys = {request.headers["Idempotency-Key"] for request in handler.requests}
    assert (len(handler.requests), len(keys)) == (3, 1)


def test_two_calls_have_two_keys() -> None:
    handler = Recorder(httpx.Response(201, json=COLLECTION))
    client = client_of(handler)
    client.create_collection("a")
    client.create_collection("b")
    assert len({request.headers["Idempotency-Key"] for request in handler.requests}) == 2


@pytest.mark.parametrize("trouble", [BROKEN, LOST, httpx.ReadTimeout("late"), httpx.Response(502), httpx.Response(504)])
def test_a_post_that_may_have_been_done_is_not_repeated(trouble: httpx.Response | Exception) -> None:
    handler = Recorder(trouble, httpx.Response(200, json=TASK))
    with pytest.raises(ReebaseError):
        client_of(handler).cancel("t1")
    assert len(handler.requests) == 1


@pytest.mark.parametrize("trouble", [REFUSED, httpx.ConnectTimeout("late"), httpx.Response(503),
                                     problem(429, "rate_limited", **{"Retry-After": "0"})])
def test_a_post_that_was_surely_not_done_is_repeated(trouble: httpx.Response | Exception) -> None:
    handler = Recorder(trouble, httpx.Response(200, json=TASK))
    assert client_of(handler).cancel("t1").id == "t1"
    assert len(handler.requests) == 2


def test_a_delete_whose_answer_was_lost_is_done() -> None:
    handler = Recorder(BROKEN, problem(404, "shape_not_found"))
    client_of(handler).delete_shape("zoo", "s1")
    with pytest.raises(ServiceError, match="shape_not_found"):
        client_of(Recorder(problem(404, "shape_not_found"))).delete_shape("zoo", "s1")


def test_patience_ends_and_says_where_nobody_answered() -> None:
    handler = Recorder(REFUSED)
    begun = time.monotonic()
    with pytest.raises(ServiceUnreachable, match=r"http://service:8000 .*refused.*running"):
        client_of(handler, patience=0.05).collection("zoo")
    assert len(handler.requests) > 2
    assert time.monotonic() - begun < 2


def test_without_patience_there_is_one_try() -> None:
    for trouble in (REFUSED, problem(429, "rate_limited", **{"Retry-After": "30"})):
        handler = Recorder(trouble)
        with pytest.raises(ReebaseError):
            client_of(handler, patience=0).limits()
        assert len(handler.requests) == 1


def test_the_time_that_the_service_asks_for_is_waited() -> None:
    handler = Recorder(problem(429, "rate_limited", **{"Retry-After": "0.2"}), httpx.Response(200, json=COLLECTION))
    begun = time.monotonic()
    client_of(handler, patience=0.05).collection("zoo")
    assert 0.2 <= time.monotonic() - begun < 2


def test_a_closed_client_does_not_go_on_trying() -> None:
    client = client_of(Recorder(REFUSED), patience=60)

    def refuse(_: httpx.Request) -> httpx.Response:
        client.close()
        raise REFUSED

    client._http._http._transport = httpx.MockTransport(refuse)
    begun = time.monotonic()
    with pytest.raises(ServiceUnreachable):
        client.collection("zoo")
    assert time.monotonic() - begun < 2
    with pytest.raises(ServiceUnreachable, match="closed"):
        client.collection("zoo")


def test_a_file_is_sent_whole_at_each_attempt(tmp_path: Path) -> None:
    path = tmp_path / "a.off"
    path.write_bytes(b"OFF of some bytes")
    handler = Recorder(BROKEN, httpx.Response(202, json={"shape": SHAPE, "task": TASK}))
    upload = client_of(handler).upload("zoo", path, label="ants", tags=["x", "y"], metadata={"n": 1})
    assert [b"OFF of some bytes" in body for body in handler.bodies] == [True, True]
    for part in (b'filename="a.off"', b"ants", b'{"n": 1}'):
        assert part in handler.bodies[1]
    assert upload.created
    assert upload.shape.tags == ("x",)
    assert upload.task is not None


def test_a_file_that_shrinks_while_it_is_sent_is_no_lost_service() -> None:
    handler = Recorder(httpx.LocalProtocolError("Too little data for declared Content-Length"))
    with pytest.raises(RequestBroken):
        client_of(handler).upload("zoo", b"x")
    assert len(handler.requests) == 1


def test_a_missing_file_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        client_of(Recorder(REFUSED)).upload("zoo", tmp_path / "absent.off")


def test_a_tag_with_a_comma_would_become_two() -> None:
    with pytest.raises(ParameterError, match="comma"):
        client_of(Recorder(REFUSED)).upload("zoo", b"x", tags=["a,b"])


def test_a_problem_becomes_an_error_with_its_code_and_values() -> None:
    errors = [{"detail": "k: must be positive", "code": "out_of_range", "pointer": "/k"}]
    reply = httpx.Response(422, json={"code": "invalid_request", "detail": "no", "status": 422, "errors": errors})
    with pytest.raises(ServiceError) as caught:
        client_of(Recorder(reply)).query("zoo", shape="s", k=0)
    refusal = caught.value
    assert (refusal.status, refusal.code, refusal.message, refusal.errors) == (422, "invalid_request", "no", errors)


@pytest.mark.parametrize("reply", [httpx.Response(500, text="<html>"), httpx.Response(418, json=[1]),
                                   httpx.Response(404, json={"message": "another service"})])
def test_an_error_that_is_no_problem_document_names_its_status(reply: httpx.Response) -> None:
    with pytest.raises(ServiceError, match=str(reply.status_code)) as caught:
        client_of(Recorder(reply)).collection("zoo")
    assert caught.value.code == f"http_{reply.status_code}"


def test_a_redirect_names_where_to() -> None:
    with pytest.raises(ServiceError, match="https://there"):
        client_of(Recorder(httpx.Response(301, headers={"location": "https://there"}))).collection("zoo")


@pytest.mark.parametrize("reply", [httpx.Response(200, text="<html>It works!"), httpx.Response(200, json=[]),
                                   httpx.Response(200, json={"name": "zoo"}),
                                   httpx.Response(200, json={**COLLECTION, "counts": None})])
def test_something_else_that_answers_is_said_to_be_something_else(reply: httpx.Response) -> None:
    with pytest.raises(UnexpectedReply):
        client_of(Recorder(reply)).collection("zoo")


def test_pages_are_followed_to_the_end() -> None:
    def pages(request: httpx.Request) -> httpx.Response:
        cursor = int(request.url.params.get("cursor", 0))
        assert request.url.params["state"] == "indexed"
        assert request.url.params.get_list("tag") == ["a", "b"]
        items = [{**SHAPE, "id": f"{cursor}-{n}"} for n in range(2)]
        return httpx.Response(200, json={"items": items, "next": str(cursor + 1) if cursor < 2 else None})

    found = client_of(pages).shapes("zoo", state="indexed", tags=["a", "b"])
    assert isinstance(found, Iterator)
    assert [shape.id for shape in found] == ["0-0", "0-1", "1-0", "1-1", "2-0", "2-1"]


def test_names_are_one_segment_of_the_path() -> None:
    handler = Recorder(httpx.Response(200, json=SHAPE))
    client_of(handler).shape("a/../b?c#d", "ü %")
    assert handler.requests[0].url.raw_path == b"/v1/collections/a%2F..%2Fb%3Fc%23d/shapes/%C3%BC%20%25"
    for name in ("", ".", ".."):
        with pytest.raises(ParameterError):
            client_of(handler).delete_collection(name)


@pytest.mark.parametrize("url", ["127.0.0.1:8000", "localhost", "ftp://host", "http://", ""])
def test_an_address_that_cannot_be_one_is_refused(url: str) -> None:
    with pytest.raises(ParameterError, match="address"):
        Client(url)


def test_keys_are_sent_and_those_that_cannot_be_any_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    handler = Recorder(httpx.Response(200, json=COLLECTION))
    monkeypatch.setenv("REEBASE_API_KEY", "rb_of_the_environment\n")
    client_of(handler).collection("zoo")
    client_of(handler, api_key="rb_given").collection("zoo")
    sent = [request.headers["authorization"] for request in handler.requests]
    assert sent == ["Bearer rb_of_the_environment", "Bearer rb_given"]
    with pytest.raises(ParameterError, match="key"):
        Client(api_key="rb_a\nrb_b")


def test_a_proxy_of_the_environment_is_not_asked_for_loopback(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HTTP_PROXY", "http://proxy:3128")
    assert not Client("http://127.0.0.1:8000")._http._http._mounts
    assert not Client("http://localhost:8000")._http._http._mounts
    assert Client("http://service:8000")._http._http._mounts


def test_waiting_ends_with_the_task() -> None:
    succeeded = httpx.Response(200, json={**TASK, "state": "succeeded"})
    handler = Recorder(httpx.Response(200, json=TASK), succeeded)
    assert client_of(handler).wait("t1").state == "succeeded"
    assert all(float(request.url.params["wait"]) <= 20 for request in handler.requests)


def test_waiting_for_a_task_that_fails_says_why() -> None:
    failed = {**TASK, "state": "failed", "error": {"code": "no_faces", "detail": "The file holds no faces."}}
    with pytest.raises(TaskFailed, match=r"no faces.*\[no_faces\]") as caught:
        client_of(Recorder(httpx.Response(200, json=failed))).wait("t1")
    assert caught.value.task.error is not None
    with pytest.raises(TaskFailed, match="cancelled"):
        client_of(Recorder(httpx.Response(200, json={**TASK, "state": "cancelled"}))).wait("t1")


def test_waiting_is_given_up_in_time() -> None:
    begun = time.monotonic()
    with pytest.raises(WaitTimeout, match="still queued") as caught:
        client_of(Recorder(httpx.Response(200, json=TASK))).wait("t1", timeout=0.2)
    assert isinstance(caught.value, TimeoutError)
    assert time.monotonic() - begun < 2
    with pytest.raises(ParameterError, match="no task"):
        client_of(Recorder(REFUSED)).wait(None)


def test_a_query_that_takes_longer_ends_with_the_answer_of_its_task() -> None:
    answer = {
        "query": {"endpoint_count": 2}, "considered": 1, "left_out": [], "took_ms": 1.5,
        "buckets": [{"endpoint_count": 2, "shapes": 1}],
        "hits": [{
            "rank": 1, "dissimilarity": 0.5, "graph_dissimilarity": 0.75, "endpoint_count": 2,
            "pairs": [{"query": 0, "hit": 1, "distance": 0.25}],
            "unmatched_query": [{"endpoint": 1, "charge": 0.5}], "unmatched_hit": [], "note": None,
            "parts": [
                {"descriptor": "hks", "measure": "l1", "dissimilarity": 9.0, "share": 0.25, "matched": None},
                {"descriptor": "extended", "measure": "matching", "dissimilarity": 1.0, "share": 0.75, "matched": {
                    "pairs": [{"query": 2, "hit": 0, "distance": 1.0}], "unmatched_query": [], "unmatched_hit": [],
                    "note": "squares", "positions": [[1.0, 2.0, 3.0]],
                }},
            ],
            "shape": {name: SHAPE[name] for name in
                      ("id", "name", "label", "tags", "metadata", "filename", "format", "sha256")},
        }],
    }  # fmt: skip
    done = httpx.Response(200, json={**TASK, "kind": "query", "state": "succeeded", "result": answer})
    handler = Recorder(httpx.Response(202, json={"task": TASK}), done)
    found = client_of(handler).query("zoo", source=b"OFF", tolerance=None, tags=["a"], metadata={"n": 1}, rerank=False)
    assert b'name="tolerance"\r\n\r\nnull' in handler.bodies[0]
    assert b'name="rerank"\r\n\r\nfalse' in handler.bodies[0]
    assert b'name="descriptor"' not in handler.bodies[0]
    assert "Idempotency-Key" in handler.requests[0].headers
    assert found.buckets == {2: 1}
    assert (found.hits[0].pairs[0].distance, found.hits[0].unmatched_query[0].charge) == (0.25, 0.5)
    assert [part.matched is None for part in found.hits[0].parts] == [True, False]
    assert found.hits[0].parts[1].matched.positions == ((1.0, 2.0, 3.0),)
    assert found.hits[0].parts[1].matched.pairs[0].query == 2


def test_what_a_query_does_not_say_is_left_to_the_service() -> None:
    handler = Recorder(problem(404, "shape_not_found"))
    for asked in ({}, {"tolerance": None}, {"descriptor": "srg", "tolerance": 3}):
        with pytest.raises(ServiceError):
            client_of(handler).query("zoo", shape="s", **asked)
        assert json.loads(handler.bodies[-1]) == {"shape": "s", "k": 10, **asked}


def test_a_query_needs_one_of_two() -> None:
    client = client_of(Recorder(REFUSED))
    with pytest.raises(ParameterError, match="either"):
        client.query("zoo")
    with pytest.raises(ParameterError, match="either"):
        client.query("zoo", shape="s", source=b"x")


def test_a_batch_has_answers_and_refusals_in_their_order() -> None:
    refusal = {"status": 404, "code": "shape_not_found", "detail": "There is no such shape."}
    answer = {"query": {}, "hits": [], "considered": 0, "buckets": [], "took_ms": 0.1}
    results = [{"answer": None, "problem": refusal}, {"answer": answer, "problem": None}]
    handler = Recorder(BROKEN, httpx.Response(200, json={"results": results}))
    first, second = client_of(handler).query_batch("zoo", [{"shape": "x"}, {"shape": "y", "k": 3}])
    assert isinstance(first, ServiceError)
    assert first.code == "shape_not_found"
    assert isinstance(second, reebase.client.Answer)
    assert json.loads(handler.bodies[1])["queries"][1] == {"shape": "y", "k": 3}


def test_an_existing_collection_is_taken_as_it_is() -> None:
    handler = Recorder(httpx.Response(200, json=COLLECTION))
    client_of(handler).create_collection("zoo", exist_ok=True)
    assert [request.method for request in handler.requests] == ["GET"]
    # Somebody else makes it between our look and our request.
    absent, exists = problem(404, "collection_not_found"), problem(409, "collection_exists")
    handler = Recorder(absent, exists, httpx.Response(200, json=COLLECTION))
    assert client_of(handler).create_collection("zoo", exist_ok=True).name == "zoo"
    with pytest.raises(ServiceError, match="collection_exists"):
        client_of(Recorder(exists)).create_collection("zoo")


def test_readiness_is_asked_once() -> None:
    handler = Recorder(REFUSED)
    assert not client_of(handler).ready()
    assert len(handler.requests) == 1
    assert not client_of(Recorder(httpx.Response(503))).ready()
    assert client_of(Recorder(httpx.Response(200))).ready()


def test_all_is_what_the_package_has_and_explains() -> None:
    for name in reebase.client.__all__:
        assert getattr(reebase.client, name).__doc__
    public = [name for name in vars(Client) if not name.startswith("_")]
    assert all(getattr(Client, name).__doc__ for name in public)
