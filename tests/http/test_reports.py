"""Reports: evaluations side by side as a page that stands alone, and as files."""

from __future__ import annotations

import io
import json
import re
import zipfile
from typing import Any

import httpx
import pytest

from store import evaluations
from tests.http.serving import Served
from tests.http.test_access import held
from tests.http.test_main_job import ended, indexed, uploaded
from tests.http.test_plots import evaluated
from tests.http.test_problems import is_problem
from tests.shapes import capsule


@pytest.fixture(scope="module")
def compared(http: httpx.Client) -> list[dict[str, Any]]:
    """Two evaluations of four labelled shapes."""
    path = "/v1/collections/reported"
    http.post("/v1/collections", json={"name": "reported"}).raise_for_status()
    for length in (2.0, 2.1, 5.0, 5.2):
        label = "long & thin" if length > 3 else "short"
        indexed(http, uploaded(http, path, capsule(length=length), name=f"s{length:g}", label=label))
    return [evaluated(http, collection="reported", measure=measure) for measure in ("matching", "greedy")]


def test_a_report_is_a_page_and_files(http: httpx.Client, compared: list[dict[str, Any]]) -> None:
    ids = [one["id"] for one in compared]
    asked = http.post("/v1/reports", json={"evaluations": ids, "title": "Capsules <i>"})
    assert asked.status_code == 202, asked.text
    task = ended(http, asked.json()["id"])
    assert (task["state"], task["kind"], task["result"]) == ("succeeded", "report", {"evaluations": ids})
    assert asked.headers["location"] == f"/v1/reports/{task['id']}"
    page = http.get(asked.headers["location"])
    assert page.headers["content-type"].startswith("text/html")
    assert "script" not in page.headers["content-security-policy"]
    assert "sandbox" in page.headers["content-security-policy"]
    # Names are words, whatever is in them, and nothing is fetched or run.
    assert "Capsules &lt;i&gt;" in page.text and "long &amp; thin" in page.text
    assert not re.search(r"<script|https?://(?!www\.w3\.org)", page.text)
    assert page.text.count("data:image/png") == 4
    again = http.get(asked.headers["location"], headers={"If-None-Match": page.headers["etag"]})
    assert again.status_code == 304
    reply = http.get(f"{asked.headers['location']}/files")
    assert reply.headers["content-disposition"] == 'attachment; filename="report.zip"'
    with zipfile.ZipFile(io.BytesIO(reply.content)) as archive:
        assert archive.read("index.html").decode() == page.text
        record = json.loads(archive.read("report.json"))
        assert {name for name in archive.namelist() if name.endswith(".svg")} >= {"precision_recall.svg"}
    assert list(record["descriptors"]) == ["srg", "srg, greedy"]
    for one, told in zip(compared, record["descriptors"].values(), strict=True):
        assert told["overall"] == one["report"]["overall"]


def test_refusals(http: httpx.Client, compared: list[dict[str, Any]]) -> None:
    first = compared[0]["id"]
    other = evaluated(http, synthetic={"per_class": 2, "classes": ["snakes", "pliers"]})["id"]
    is_problem(http.post("/v1/reports", json={"evaluations": [first, other]}), 422, "invalid_parameter")
    is_problem(http.post("/v1/reports", json={"evaluations": ["absent"]}), 404, "evaluation_not_found")
    for ids in ([], [first] * 17):
        is_problem(http.post("/v1/reports", json={"evaluations": ids}), 422, "validation_error")
    task = compared[0]["task"]["id"]
    is_problem(http.get(f"/v1/reports/{task}"), 404, "task_not_found")


def test_one_that_is_not_finished_is_not_reported(api: httpx.Client, shelf: str) -> None:
    waiting = api.post("/v1/evaluations", json={"collection": shelf.rpartition("/")[2]}).json()["id"]
    is_problem(api.post("/v1/reports", json={"evaluations": [waiting]}), 404, "result_not_found")


def test_labels_that_changed_between_evaluations(api: httpx.Client, alone: Served, shelf: str) -> None:
    database, name = alone.database(), shelf.rpartition("/")[2]
    matrix = alone.blobs().put_if_absent(b"of any three shapes")

    def made(shapes: str, labels: str) -> str:
        asked = api.post("/v1/evaluations", json={"collection": name}).json()
        task = held(database, asked["task"]["id"])
        items = [{"id": id, "name": f"n{id}", "label": label} for id, label in zip(shapes, labels, strict=True)]
        with database.write() as conn:
            evaluations.complete(conn, task, {"map": 0.5}, items=items, matrix_sha256=matrix)
        return str(asked["id"])

    first, same, relabelled, others = made("123", "aab"), made("123", "aab"), made("123", "abb"), made("124", "aab")
    database.close()
    assert api.post("/v1/reports", json={"evaluations": [first, same]}).status_code == 202
    for other, words in ((relabelled, "1 of 3 shapes changed theirs"), (others, "not of the same shapes")):
        refused = api.post("/v1/reports", json={"evaluations": [first, same, other]})
        assert words in is_problem(refused, 422, "invalid_parameter")["detail"]
