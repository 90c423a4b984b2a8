"""Evaluations as pictures, and where they went wrong."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree as ET

import httpx
import numpy as np
import pytest

from reebase.evaluation import evaluate
from reebase.evaluation.mistakes import confusion
from reebase.pictures.confusion import confusion_plot
from service.plots import Plots, blocks
from tests.http.test_main_job import ended, indexed, uploaded
from tests.http.test_problems import is_problem
from tests.shapes import capsule

LABELS = ["b", "a", "b", "a", "a", "c"]


def evaluated(http: httpx.Client, **asked: Any) -> dict[str, Any]:
    reply = http.post("/v1/evaluations", json={"bootstrap": 2, **asked})
    assert reply.status_code == 202, reply.text
    assert ended(http, reply.json()["task"]["id"])["state"] == "succeeded"
    found: dict[str, Any] = http.get(f"/v1/evaluations/{reply.json()['id']}").json()
    return found


@pytest.fixture(scope="module")
def evaluation(http: httpx.Client) -> str:
    """The address of an evaluation of four labelled shapes."""
    path = "/v1/collections/plotted"
    http.post("/v1/collections", json={"name": "plotted"}).raise_for_status()
    made = [
        uploaded(http, path, capsule(length=length), name=f"s{length:g}", label="long" if length > 3 else "short")
        for length in (2.0, 2.1, 5.0, 5.2)
    ]
    for shape in made:
        indexed(http, shape)
    return f"/v1/evaluations/{evaluated(http, collection='plotted', measure='matching')['id']}"


@pytest.mark.parametrize("plot", ["precision_recall", "matrix", "confusion"])
def test_plots_are_svg_in_either_theme_and_are_kept(http: httpx.Client, evaluation: str, plot: str) -> None:
    path = f"{evaluation}/plots/{plot}.svg"
    replies = {theme: http.get(path, params={"theme": theme}) for theme in ("light", "dark")}
    for reply in replies.values():
        assert (reply.status_code, reply.headers["content-type"]) == (200, "image/svg+xml")
        root = ET.fromstring(reply.content)  # noqa: S314 - our own
        assert root.tag.endswith("svg")
        # Nothing in it acts or comes from elsewhere.
        assert not re.search(rb"<script|onload|href=.http", reply.content)
    assert replies["light"].content != replies["dark"].content
    etag = replies["dark"].headers["etag"]
    again = http.get(f"{evaluation}/plots/{plot}.svg", params={"theme": "dark"}, headers={"If-None-Match": etag})
    assert again.status_code == 304
    assert http.get(f"{evaluation}/plots/{plot}.svg").content == replies["light"].content


def test_several_on_one_plot(http: httpx.Client, evaluation: str) -> None:
    first = evaluation.rpartition("/")[2]
    second = evaluated(http, collection="plotted", measure="greedy")["id"]
    svg = http.get("/v1/plots/precision_recall.svg", params={"evaluation": [first, second]}).text
    assert "greedy" in svg and "matching" in svg
    is_problem(http.get("/v1/plots/precision_recall.svg"), 422, "validation_error")
    is_problem(
        http.get("/v1/plots/precision_recall.svg", params={"evaluation": ["x"]}), 404, "evaluation_not_found"
    )
    is_problem(
        http.get("/v1/plots/precision_recall.svg", params={"evaluation": [first] * 13}), 422, "validation_error"
    )


def test_mistakes_are_those_of_the_matrix(http: httpx.Client, evaluation: str) -> None:
    matrix = http.get(f"{evaluation}/matrix").json()
    labels = [item["label"] for item in matrix["items"]]
    names = [item["name"] for item in matrix["items"]]
    own = evaluate(np.array(matrix["matrix"]), labels, [item["id"] for item in matrix["items"]], bootstrap=0)
    table = http.get(f"{evaluation}/confusion").json()
    assert table == {"labels": ["long", "short"], "counts": confusion(own).counts.tolist()}
    assert sum(map(sum, table["counts"])) == 4
    worst = http.get(f"{evaluation}/worst", params={"limit": 2}).json()["items"]
    assert len(worst) == 2
    assert worst[0]["average_precision"] == pytest.approx(min(own.scores["map"]))
    for query in worst:
        row = names.index(query["name"])
        assert [hit["name"] for hit in query["hits"]] == [names[hit] for hit in own.ranked(row)]
        assert [hit["relevant"] for hit in query["hits"]] == [hit["label"] == query["label"] for hit in query["hits"]]
        distances = [hit["dissimilarity"] for hit in query["hits"]]
        assert distances == sorted(distances)
        assert http.get(f"/v1/collections/plotted/shapes/{query['shape']}").json()["name"] == query["name"]


def test_shapes_of_the_synthetic_set_have_no_address(http: httpx.Client) -> None:
    made = evaluated(http, synthetic={"per_class": 2, "classes": ["snakes", "pliers"]})
    worst = http.get(f"/v1/evaluations/{made['id']}/worst").json()["items"]
    assert {query["shape"] for query in worst} == {None}
    assert {query["label"] for query in worst} == {"snakes", "pliers"}


def test_before_it_succeeded_there_is_nothing_to_draw(api: httpx.Client, shelf: str) -> None:
    waiting = api.post("/v1/evaluations", json={"collection": shelf.rpartition("/")[2]}).json()["id"]
    for what in ("plots/matrix.svg", "confusion", "worst"):
        refused = is_problem(api.get(f"/v1/evaluations/{waiting}/{what}"), 404, "result_not_found")
        assert refused["details"]["state"] == "queued"


def test_plots_that_nobody_draws(http: httpx.Client, evaluation: str) -> None:
    is_problem(http.get(f"{evaluation}/plots/pie.svg"), 422, "unknown_name")
    is_problem(http.get(f"{evaluation}/plots/matrix.svg", params={"theme": "pink"}), 422, "validation_error")
    is_problem(http.get(f"{evaluation}/worst", params={"limit": 0}), 422, "validation_error")


def test_confusion_counts_nearest_neighbours() -> None:
    # a's nearest are a and b, b's nearest is a, c is alone and no query.
    D = np.array([
        [0, 1, 2, 9, 9, 9],
        [5, 0, 6, 1, 2, 9],
        [3, 1, 0, 9, 9, 9],
        [1, 2, 9, 0, 3, 9],
        [9, 9, 9, 1, 0, 9],
        [1, 1, 1, 1, 1, 0],
    ], dtype=float)  # fmt: skip
    found = confusion(evaluate(D, LABELS, bootstrap=0))
    assert found.labels == ("a", "b", "c")
    assert found.counts.tolist() == [[2, 1, 0], [2, 0, 0], [0, 0, 0]]


def test_blocks_are_the_sorted_matrix_or_means_of_it() -> None:
    D = np.random.default_rng(1).random((6, 6))
    whole, names = blocks(iter(D), LABELS)
    order = [1, 3, 4, 0, 2, 5]
    assert whole == pytest.approx(D[np.ix_(order, order)])
    assert names == [LABELS[at] for at in order]
    merged, names = blocks(iter(D), LABELS, most=3)
    pairs = whole.reshape(3, 2, 3, 2).mean(axis=(1, 3))
    assert merged == pytest.approx(pairs)
    assert names == ["a", "a", "b"]


def test_plots_are_drawn_once_and_the_oldest_is_forgotten() -> None:
    drawn: list[str] = []

    def draw(name: str) -> bytes:
        drawn.append(name)
        return name.encode()

    plots = Plots(most=2)
    for name in ("a", "a", "b", "a", "c", "a", "b"):
        assert plots.get(name, lambda name=name: draw(name)) == name.encode()  # type: ignore[misc]
    assert drawn == ["a", "b", "c", "b"]


def test_a_confusion_of_another_form_is_refused() -> None:
    from reebase.errors import ParameterError

    with pytest.raises(ParameterError, match="square"):
        confusion_plot(np.zeros((2, 3), int), ["a", "b"])
    many = [f"class {number}" for number in range(30)]
    assert confusion_plot(np.eye(30, dtype=int), many, theme="dark").startswith(b"<?xml")
