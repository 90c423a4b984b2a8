"""The OpenAPI document is true: requests made from it at random get only answers that it describes."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import httpx
import pytest
import schemathesis
from hypothesis import HealthCheck, settings
from schemathesis.checks import CheckFunction
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from reebase.mesh.write import to_bytes
from service.app import create_app
from service.settings import ServiceSettings
from tests.http.serving import ROOT, Served, api_alone, environment
from tests.http.test_problems import CODES
from tests.shapes import capsule

DOCUMENT = create_app(ServiceSettings()).openapi()
EXAMPLES = int(os.environ.get("REEBASE_FUZZ_EXAMPLES", "20"))
CHECKS: list[CheckFunction] = [
    schemathesis.checks.not_a_server_error, status_code_conformance, content_type_conformance,
    response_schema_conformance, response_headers_conformance,
]  # fmt: skip

schema = schemathesis.openapi.from_dict(DOCUMENT)


@dataclass
class Fuzzed:
    """An API with something in it; ``names`` fill the places of its paths."""

    served: Served
    names: dict[str, str]


@pytest.fixture(scope="module")
def fuzzed(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Fuzzed]:
    """Two indexed shapes and an evaluation, by a worker that is gone: what the fuzzing queues stays queued."""
    home = tmp_path_factory.mktemp("fuzzed")
    with api_alone(home, max_wait_seconds=0.05, max_stream_seconds=0.05) as served, served.client() as client:
        # Not the document's own example, which is fuzzed with, and deleted.
        for name in ("zoo", "changing"):
            client.post("/v1/collections", json={"name": name}).raise_for_status()
        for length in (2.0, 3.0):
            data = to_bytes(capsule(length=length), "ply")
            made = client.post("/v1/collections/zoo/shapes", content=data, params={"label": "a"}).json()
        work = [sys.executable, "-m", "worker", "--once"]
        subprocess.run(work, cwd=ROOT, env=environment(home), check=True, timeout=120)
        evaluation = client.post("/v1/evaluations", json={"collection": "zoo", "bootstrap": 2}).json()
        subprocess.run(work, cwd=ROOT, env=environment(home), check=True, timeout=120)
        assert client.get(f"/v1/tasks/{evaluation['task']['id']}").json()["state"] == "succeeded"
        yield Fuzzed(served, {
            "collection": "zoo", "shape": made["shape"]["id"], "task": made["task"]["id"],
            "evaluation": evaluation["id"],
        })  # fmt: skip


@schema.parametrize()
@settings(
    max_examples=EXAMPLES, derandomize=True, deadline=None, database=None,
    suppress_health_check=list(HealthCheck),
)  # fmt: skip
def test_answers_are_as_described(case: schemathesis.Case, fuzzed: Fuzzed) -> None:
    # Names made up at random are not found, and nothing more; what is there goes deeper. It must stay there.
    if case.method != "DELETE" and isinstance(case.path_parameters, dict):
        case.path_parameters |= {n: v for n, v in fuzzed.names.items() if n in case.path_parameters}
    if case.method == "PATCH" and case.path.endswith("{collection}"):
        case.path_parameters = {"collection": "changing"}  # another profile would take all results away
    if isinstance(case.body, dict) and isinstance(case.body.get("shape"), str):
        case.body["shape"] = fuzzed.names["shape"]
    reply = case.call_and_validate(base_url=fuzzed.served.url, checks=CHECKS, timeout=60)
    if reply.status_code >= 400:
        assert reply.json()["code"] in CODES


@pytest.mark.parametrize("what", ["skeleton", "field", "features", "health", "mesh", "original"])
def test_every_read_was_reached(fuzzed: Fuzzed, what: str) -> None:
    with fuzzed.served.client() as client:
        shape = "/v1/collections/zoo/shapes/" + fuzzed.names["shape"]
        assert client.get(f"{shape}/{what}").status_code == 200


def every(key: str, value: Any) -> Iterator[Any]:
    """What stands under a key anywhere in a JSON value."""
    if isinstance(value, dict):
        for name, inner in value.items():
            if name == key:
                yield inner
            yield from every(key, inner)
    elif isinstance(value, list):
        for inner in value:
            yield from every(key, inner)


def test_the_document_is_complete() -> None:
    names = list(every("operationId", DOCUMENT))
    assert len(set(names)) == len(names) >= 30
    for reference in every("$ref", DOCUMENT):
        *path, name = reference.removeprefix("#/").split("/")
        assert name in DOCUMENT["components"]["schemas"], (path, name)
    for operation in (op for path in DOCUMENT["paths"].values() for op in path.values()):
        assert operation["summary"] and operation["description"]
        assert operation["tags"]


def test_bodies_have_examples() -> None:
    for name in ("NewCollection", "CollectionPatch", "ShapePatch", "QueryBody", "NewEvaluation", "Problem"):
        found = DOCUMENT["components"]["schemas"][name]
        assert "examples" in found or "example" in found, name


def test_examples_are_accepted(fuzzed: Fuzzed) -> None:
    example = DOCUMENT["components"]["schemas"]["NewCollection"]["examples"][0]
    with fuzzed.served.client() as client:
        reply = client.post("/v1/collections", json={**example, "name": "example"})
        assert reply.status_code == httpx.codes.CREATED
