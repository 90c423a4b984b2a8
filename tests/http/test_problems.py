"""The contract of errors, stated once and proven on every route.

Every answer of 400 and above is application/problem+json with type, title, status, code, detail, instance and
request_id; the status in it is that of the answer; the code is one of the documented ones; nothing of the inside
(paths, tracebacks, SQL) leaks.
"""

from __future__ import annotations

import json
import re
from typing import Any

import httpx
import pytest

from reebase.errors import ReebaseError
from service import problems
from service.app import create_app
from service.routes import collections as collection_routes
from service.settings import ServiceSettings

CODES = {code: status for code, status, _ in problems.catalogue()}
MEMBERS = {"type", "title", "status", "code", "detail", "instance", "request_id"}


def is_problem(reply: httpx.Response, status: int, code: str) -> dict[str, Any]:
    """Assert the contract on an answer; returns the document."""
    assert reply.headers["content-type"] == "application/problem+json", reply.text
    value: dict[str, Any] = reply.json()
    assert value.keys() >= MEMBERS
    assert value.keys() <= MEMBERS | {"errors", "details"}
    assert (reply.status_code, value["code"]) == (status, code), value
    assert value["status"] == status
    assert value["type"] == f"/docs#{code}"
    assert value["instance"] == reply.url.path
    assert value["request_id"] == reply.headers["x-request-id"]
    assert value["detail"].strip() and value["title"].strip()
    assert not re.search(r"Traceback|site-packages|sqlalchemy|SELECT ", reply.text)
    assert reply.headers["x-content-type-options"] == "nosniff"
    for error in value.get("errors", ()):
        assert error["detail"] and error["code"]
        assert ("pointer" in error) != ("parameter" in error)
    return value


def operations() -> list[tuple[str, str, dict[str, Any]]]:
    """(method, path, operation) of everything in the OpenAPI document."""
    document = create_app(ServiceSettings()).openapi()
    return [(m.upper(), path, op) for path, item in document["paths"].items() for m, op in item.items()]


OPERATIONS = operations()
ABSENT = [(m, p) for m, p, _ in OPERATIONS if "{" in p]
NAMES = {"collection": "collection_not_found", "task": "task_not_found", "evaluation": "evaluation_not_found"}


def test_codes_are_unique_and_documented() -> None:
    classes = list(problems._classes(ReebaseError))
    assert len({found.code for found in classes}) == len(classes)
    assert all(400 <= status < 600 for status in CODES.values())
    assert all(re.fullmatch(r"[a-z0-9_]+", code) for code in CODES)
    assert all(text for _, _, text in problems.catalogue())


@pytest.mark.parametrize("operation", [op for _, _, op in OPERATIONS], ids=lambda op: op["operationId"])
def test_every_operation_documents_problems(operation: dict[str, Any]) -> None:
    refusals = {status: answer for status, answer in operation["responses"].items() if status >= "4"}
    assert "500" in refusals
    for answer in refusals.values():
        assert answer["content"] == {
            "application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}
        }


@pytest.mark.parametrize(("method", "path"), ABSENT)
def test_what_is_not_there(api: httpx.Client, method: str, path: str) -> None:
    first = re.findall(r"{(\w+)}", path)[0]
    body: dict[str, Any] = {}
    if method in {"POST", "PATCH"}:
        queries = [{"shape": "x"}]
        body = {"json": {"queries": queries} if path.endswith("queries") else {"name": "x", "shape": "x"}}
        if path.endswith(("synthetic", "map")):
            body = {"json": {}}
        if path.endswith("reindex"):
            body = {}
        if "/bulk/" in path:
            body = {"json": {"shapes": ["x"], **({"label": "a"} if path.endswith("label") else {})}}
        if method == "PATCH" and path.endswith("{collection}"):
            body = {"json": {"description": "x"}}
        if method == "PATCH" and path.endswith("{shape}"):
            body = {"json": {"name": "x"}}
    reply = api.request(method, re.sub(r"{\w+}", "absent", path), **body)
    is_problem(reply, 404, NAMES[first])


@pytest.mark.parametrize(("method", "path"), [(m, p) for m, p in ABSENT if "{shape}" in p])
def test_a_shape_that_is_not_there(api: httpx.Client, shelf: str, method: str, path: str) -> None:
    body = {"json": {"name": "x"}} if method == "PATCH" else {}
    path = path.replace("/v1/collections/{collection}", shelf).replace("{shape}", "absent")
    is_problem(api.request(method, path, **body), 404, "shape_not_found")


@pytest.mark.parametrize("path", sorted({path for _, path, _ in OPERATIONS}))
def test_methods_that_a_route_does_not_take(api: httpx.Client, path: str) -> None:
    taken = {m for m, p, _ in OPERATIONS if p == path}
    reply = api.request("PUT", re.sub(r"{\w+}", "x", path))
    is_problem(reply, 405, "method_not_allowed")
    assert set(reply.headers["allow"].split(", ")) == taken


@pytest.mark.parametrize("path", ["/absent", "/v1", "/v1/", "/v1/absent", "/v1/collections/", "/page/../app.py"])
def test_routes_that_are_not_there(api: httpx.Client, path: str) -> None:
    is_problem(api.get(path), 404, "route_not_found")


JSON = {"Content-Type": "application/json"}
DEEP = "[" * 30_000

MALFORMED = {
    "nothing": "", "half": '{"name": "a"', "words": "name=a", "not a number": '{"name": "a", "x": NaN}',
    "infinity": '{"name": Infinity}', "too large a number": '{"name": 1e999}', "deep": DEEP,
    "twice": '{"name": "a", "name": "b"}', "null character": '{"name": "a\\u0000"}',
    "half a pair": '{"name": "\\ud800"}', "long number": '{"name": ' + "9" * 5000 + "}",
}  # fmt: skip


@pytest.mark.parametrize("text", MALFORMED.values(), ids=MALFORMED)
def test_bodies_that_are_not_json(api: httpx.Client, text: str) -> None:
    reply = api.post("/v1/collections", content=text, headers=JSON)
    if text == "":
        is_problem(reply, 422, "validation_error")
    else:
        is_problem(reply, 400, "malformed_json")


def test_json_in_another_encoding(api: httpx.Client) -> None:
    reply = api.post("/v1/collections", content=b'{"name": "\xff"}', headers=JSON)
    is_problem(reply, 400, "malformed_json")


def test_a_json_body_over_the_limit(api: httpx.Client) -> None:
    text = json.dumps({"name": "a", "description": "x" * 60_000})
    is_problem(api.post("/v1/collections", content=text, headers=JSON), 413, "too_many_bytes")
    chunked = (text[i : i + 1000].encode() for i in range(0, len(text), 1000))
    is_problem(api.post("/v1/collections", content=chunked, headers=JSON), 413, "too_many_bytes")


def test_a_compressed_body(api: httpx.Client) -> None:
    reply = api.post("/v1/collections", content=b"x", headers={**JSON, "Content-Encoding": "gzip"})
    is_problem(reply, 415, "unsupported_encoding")


WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "no name": ({}, "/name"),
    "capital letters": ({"name": "Animals"}, "/name"),
    "64 characters": ({"name": "a" * 64}, "/name"),
    "no string": ({"name": 1}, "/name"),
    "another member": ({"name": "a", "colour": "red"}, "/colour"),
    "one band": ({"name": "a", "profile": {"bands": 1}}, "/profile/bands"),
    "threshold of one": ({"name": "a", "profile": {"threshold": 1.0}}, "/profile/threshold"),
    "control character": ({"name": "a", "description": "\u0007"}, "/description"),
}


@pytest.mark.parametrize(("body", "pointer"), WRONG.values(), ids=WRONG)
def test_values_that_are_not_allowed(api: httpx.Client, body: dict[str, Any], pointer: str) -> None:
    value = is_problem(api.post("/v1/collections", json=body), 422, "validation_error")
    assert [error["pointer"] for error in value["errors"]] == [pointer]


WORDS: dict[str, tuple[dict[str, Any], str]] = {
    "name": ({"name": "Animals"}, "name: must be lower-case letters, digits, '.', '_' and '-', at most 63, "
             "beginning with a letter or digit"),
    "another member": ({"name": "a", "colour": "red"},
                       "colour: is not known here; there is name, description, profile"),
    "another parameter": ({"name": "a", "profile": {"bandss": 1}},
                          "profile.bandss: is not known here; there is base, denoise, iterations, field, bands, "
                          "levels, saliency, threshold, area, operator, components, root"),
    "bands": ({"name": "a", "profile": {"bands": 1}}, "profile.bands: must be at least 2"),
    "half a band": ({"name": "a", "profile": {"bands": 2.5}}, "profile.bands: must be a whole number"),
    "a list": ({"name": ["a"]}, "name: must be a text"),
}  # fmt: skip


@pytest.mark.parametrize(("body", "detail"), WORDS.values(), ids=WORDS)
def test_refusals_are_in_our_words(api: httpx.Client, body: dict[str, Any], detail: str) -> None:
    assert is_problem(api.post("/v1/collections", json=body), 422, "validation_error")["detail"] == detail
    nested = {"synthetic": {"per_class": "x", "colour": 1}, "measure": 1}
    value = is_problem(api.post("/v1/evaluations", json=nested), 422, "validation_error")
    assert [error["detail"] for error in value["errors"]] == [
        "synthetic.per_class: must be a whole number",
        "synthetic.colour: is not known here; there is per_class, seed, noise, rotation, scale, tessellation, "
        "vertex_order, classes",
        "measure: must be a text",
    ]


def test_a_body_that_is_no_object(api: httpx.Client) -> None:
    value = is_problem(api.post("/v1/collections", json=[1]), 422, "validation_error")
    assert value["detail"] == "The body must be a JSON object"


def test_all_that_is_wrong_is_said_at_once(api: httpx.Client) -> None:
    body = {"name": "No", "profile": {"denoise": "magic", "field": "eigenfunction:0", "area": "disc", "bands": 1}}
    value = is_problem(api.post("/v1/collections", json=body), 422, "validation_error")
    places = {error["pointer"]: error["code"] for error in value["errors"]}
    assert places.keys() == {"/name", *(f"/profile/{name}" for name in ("denoise", "field", "area", "bands"))}
    assert (places["/profile/denoise"], places["/profile/field"]) == ("unknown_name", "invalid_parameter")
    assert "finite_volume" in next(e["detail"] for e in value["errors"] if e["pointer"] == "/profile/denoise")
    both = {"synthetic": {"classes": ["ants", "cats"]}, "measure": "best", "profile": {"operator": "best"}}
    value = is_problem(api.post("/v1/evaluations", json=both), 422, "validation_error")
    assert [error["pointer"] for error in value["errors"]] == ["/synthetic/classes/1", "/profile/operator", "/measure"]


def test_json_without_its_header(api: httpx.Client, shelf: str) -> None:
    for kind in ("application/x-www-form-urlencoded", "text/plain", ""):
        headers = {"Content-Type": kind} if kind else {}
        for path, text in (("/v1/collections", '{"name": "zoo2"}'), (f"{shelf}/query", ' {"shape": "x"}')):
            reply = api.post(path, content=text, headers=headers)
            value = is_problem(reply, 415, "unsupported_media_type")
            assert "`Content-Type: application/json`" in value["detail"]
    # What is no JSON at all is a mesh that is not known.
    reply = api.post(f"{shelf}/query", content="hello", headers={"Content-Type": "text/plain"})
    is_problem(reply, 415, "unknown_format")


def test_an_unknown_filter_lists_those_that_there_are(api: httpx.Client) -> None:
    body = {"name": "filters", "profile": {"denoise": "magic"}}
    value = is_problem(api.post("/v1/collections", json=body), 422, "unknown_name")
    assert "finite_volume" in value["detail"]
    assert "none" in value["details"]["choices"]


@pytest.mark.parametrize(
    ("query", "parameter"), [("limit=0", "limit"), ("limit=501", "limit"), ("limit=x", "limit")]
)
def test_parameters_that_are_not_allowed(api: httpx.Client, query: str, parameter: str) -> None:
    value = is_problem(api.get(f"/v1/collections?{query}"), 422, "validation_error")
    assert [(e["parameter"], e["location"]) for e in value["errors"]] == [(parameter, "query")]


@pytest.mark.parametrize("path", ["collections", "tasks", "evaluations"])
def test_a_cursor_that_no_page_gave(api: httpx.Client, path: str) -> None:
    is_problem(api.get(f"/v1/{path}?cursor=!"), 400, "invalid_cursor")


def test_a_name_that_is_taken(api: httpx.Client, shelf: str) -> None:
    is_problem(api.post("/v1/collections", json={"name": shelf.rsplit("/", maxsplit=1)[-1]}), 409, "collection_exists")


def test_what_nobody_expected(api: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("/secret/path SELECT password")

    monkeypatch.setattr(collection_routes.collections, "list_page", broken)
    value = is_problem(api.get("/v1/collections"), 500, "internal_error")
    assert "secret" not in json.dumps(value)


def test_a_given_request_id_comes_back(api: httpx.Client) -> None:
    assert api.get("/livez", headers={"X-Request-ID": "abc-1"}).headers["x-request-id"] == "abc-1"
    strange = api.get("/livez", headers={"X-Request-ID": "a b\tc"}).headers["x-request-id"]
    assert re.fullmatch(r"[0-9a-f-]{36}", strange)


def test_a_browser_gets_the_page_where_there_is_nothing_and_a_program_a_problem(api: httpx.Client) -> None:
    browser = {"Accept": "text/html,application/xhtml+xml,*/*;q=0.8"}
    for path in ("/nope", "/tasks/xyz"):
        reply = api.get(path, headers=browser)
        assert (reply.status_code, reply.headers["content-type"]) == (404, "text/html; charset=utf-8")
        assert reply.content == api.get("/").content
        is_problem(api.get(path), 404, "route_not_found")
    for path in ("/v1", "/v1/nope", "/page/nope.js"):
        is_problem(api.get(path, headers=browser), 404, "route_not_found")
