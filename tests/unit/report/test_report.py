"""The report: what it shows is what was measured, chosen by rule, and the page is whole and safe by itself."""

from __future__ import annotations

import base64
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from reebase.errors import ParameterError
from reebase.evaluation import SCORES, Evaluation, evaluate
from reebase.report import Cost, Entry, Report, files, page, sample_of, typical, worst
from reebase.report.lists import shown_in

LABELS = [label for label in ("ants", "bears", "crabs") for _ in range(4)]
NAMES = [f"{label}/{number}.off" for number, label in enumerate(LABELS)]


def drawn(seed: int = 0, spread: float = 0.6) -> Evaluation:
    """Shapes on a line, classes overlapping."""
    places = np.arange(12) // 4 + spread * np.random.default_rng(seed).standard_normal(12)
    return evaluate(np.abs(places[:, None] - places[None]), LABELS, NAMES, bootstrap=50)


@pytest.fixture(scope="module")
def report() -> Report:
    entries = (
        Entry("srg", "matching", drawn(0), "Endpoints.", Cost(1.25, 400)),
        Entry("fused, re-ranked", None, drawn(1, 0.1)),
    )
    return Report(
        "<animals> & co", entries, {"Denoising": "none"}, {"pipeline": 30.0},
        {"bad<b>.stl": ("malformed_file", "No facets.")}, thumbnails={NAMES[0]: b"\x89PNG"},
    )  # fmt: skip


class Elements(HTMLParser):
    """Every start tag with its attributes, every id and every link within the page; fails on tags left open."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in {"meta", "img", "source"}:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def all(self, *names: str) -> list[dict[str, str | None]]:
        return [attributes for tag, attributes in self.tags if tag in names]


def test_the_page_is_well_formed_loads_nothing_and_runs_nothing(report: Report) -> None:
    text = page(report)
    found = Elements(text)
    assert not found.all("script", "iframe", "link", "object")
    for attributes in found.all("img", "source", "image"):
        address = attributes.get("src") or attributes.get("srcset") or attributes.get("href")
        assert address is not None
        assert address.startswith("data:image/")
    assert "<animals>" not in text
    assert "bad<b>" not in text
    targets = {attributes["href"] for attributes in found.all("a", "use")}
    known = {f"#{attributes['id']}" for _, attributes in found.tags if attributes.get("id")}
    assert targets <= known


def test_tables_can_be_followed_without_sight(report: Report) -> None:
    found = Elements(page(report))
    assert len(found.all("caption")) == len(found.all("table")) > 5
    assert all(head.get("scope") in {"col", "row"} for head in found.all("th"))
    assert all(image.get("alt") for image in found.all("img"))
    assert all(region.get("aria-label") for region in found.all("div") if region.get("role") == "region")


def test_the_numbers_of_the_page_are_those_of_the_evaluation(report: Report) -> None:
    text = re.sub(r"<[^>]+>", " ", page(report))
    for entry in report.entries:
        for score in SCORES:
            assert f"{entry.evaluation.overall[score]:.3f}" in text
            assert f"{entry.evaluation.class_mean[score]:.3f}" in text
            low, high = entry.evaluation.intervals[score]
            assert f"{low:.2f}–{high:.2f}" in text
    assert "1.2 " in text
    assert "malformed_file" in text


def test_files_are_the_page_the_record_and_each_plot(report: Report) -> None:
    written = files(report)
    assert set(written) == {
        "index.html", "report.json", "precision_recall.svg", "matrix-srg.svg", "matrix-fused_re-ranked.svg",
    }  # fmt: skip
    record = json.loads(written["report.json"])
    assert record["descriptors"]["srg"]["overall"] == dict(report.entries[0].evaluation.overall)
    assert record["descriptors"]["srg"]["cost"] == {"milliseconds": 1.25, "bytes": 400}
    assert record["descriptors"]["fused, re-ranked"]["cost"] is None
    assert record["failed"] == {"bad<b>.stl": {"code": "malformed_file", "detail": "No facets."}}
    assert b"<svg" in written["precision_recall.svg"]
    assert base64.b64encode(written["matrix-srg.svg"]) in written["index.html"]


def test_the_typical_query_is_in_the_middle_of_its_class() -> None:
    entry = Entry("srg", "matching", drawn(3))
    chosen = typical([entry])
    assert [shape.split("/")[0] for shape in chosen] == ["ants", "bears", "crabs"]
    precision = dict(zip(NAMES, entry.evaluation.scores["map"], strict=True))
    for shape in chosen:
        own = [precision[name] for name in NAMES if name.split("/")[0] == shape.split("/")[0]]
        assert sum(value < precision[shape] for value in own) <= 2
        assert sum(value > precision[shape] for value in own) <= 2


def test_the_worst_queries_come_worst_first_with_what_they_retrieve() -> None:
    found = drawn(4)
    rows = worst(found, 12)
    assert [row.average_precision for row in rows] == sorted(found.scores["map"])
    for row in rows:
        distances = found.matrix[row.query, list(row.hits)]
        assert (np.diff(distances) >= 0).all()
        assert row.query not in row.hits
        assert len(row.hits) == 10
        assert row.relevant == tuple(LABELS[hit] == LABELS[row.query] for hit in row.hits)


def test_every_shape_that_is_shown_is_named_for_a_thumbnail() -> None:
    entries = [Entry("a", None, drawn(5)), Entry("b", None, drawn(6))]
    shown = set(shown_in(entries))
    for entry in entries:
        for row in worst(entry.evaluation):
            assert {entry.evaluation.ids[at] for at in (row.query, *row.hits)} <= shown
    assert set(typical(entries)) <= shown


def test_the_printed_part_of_the_matrix_has_likes_and_strangers() -> None:
    rows = sample_of(drawn())
    labels = [LABELS[row] for row in rows]
    assert len(rows) <= 10
    assert all(labels.count(label) >= 2 for label in labels)
    assert len(set(labels)) == 3


def test_entries_need_names_of_their_own() -> None:
    entry = Entry("a", None, drawn())
    with pytest.raises(ParameterError, match="more than once"):
        Report("x", (entry, entry))
    with pytest.raises(ParameterError, match="at least one"):
        Report("x", ())
