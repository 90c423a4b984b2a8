"""The report's page: sections in the order in which a reader asks."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape

from reebase.report import tables
from reebase.report.lists import Row, rows_of, typical, worst
from reebase.report.record import Entry, Report
from reebase.report.style import STYLE

__all__ = ["Plots", "html"]

Drawn = Mapping[str, bytes]
"""The same plot as SVG for each theme, light and dark."""


@dataclass(frozen=True)
class Plots:
    """precision_recall: of all entries; narrow: the same for a phone. matrices: of each entry by name."""

    precision_recall: Drawn
    narrow: Drawn
    matrices: Mapping[str, Drawn]


_SECTIONS = (
    ("overall", "How well"),
    ("curves", "Precision and recall"),
    ("costs", "What it costs"),
    ("classes", "By class"),
    ("matrix", "Dissimilarities"),
    ("lists", "What is retrieved"),
    ("left-out", "Left out"),
    ("method", "How it was measured"),
)


def html(report: Report, plots: Plots) -> str:
    """The page as text; everything that it shows is inside it."""
    bodies = {
        "overall": tables.overall(report),
        "curves": _curves(report, plots),
        "costs": tables.costs(report),
        "classes": tables.classes(report),
        "matrix": _matrices(report, plots.matrices),
        "lists": _lists(report),
        "left-out": tables.left_out(report),
        "method": _METHOD,
    }
    shown = [(key, title) for key, title in _SECTIONS if bodies[key]]
    links = "".join(f'<li><a href="#{key}">{title}</a></li>' for key, title in shown)
    sections = "".join(
        f'<section aria-labelledby="{key}"><h2 id="{key}">{title}</h2>{bodies[key]}</section>' for key, title in shown
    )
    facts = "".join(f"<dt>{escape(name)}</dt><dd>{escape(value)}</dd>" for name, value in report.facts.items())
    first = report.entries[0].evaluation
    told = f"{len(first.queries)} queries in {len(first.per_class)} classes, leave-one-out."
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none';img-src data:;"
        "style-src 'unsafe-inline'\">"
        f"<title>Retrieval: {escape(report.title)}</title><style>{STYLE}</style></head><body>"
        f'<header><h1>Retrieval: {escape(report.title)}</h1><p class="soft">{told}</p><dl>{facts}</dl>'
        f'<nav aria-label="Sections"><ul>{links}</ul></nav></header>'
        f"{_pool(report)}<main>{sections}</main>"
        "<footer><p>Made by Reebase. All numbers of this page are in report.json.</p></footer></body></html>\n"
    )


def _curves(report: Report, plots: Plots) -> str:
    alt = "Precision over recall of " + ", ".join(entry.name for entry in report.entries)
    alone = len(report.entries) == 1
    return (
        "<p>Interpolated precision at each recall, averaged over the queries (Kacem, Figure 4.15). "
        f"{'The line' if alone else 'The higher a line'} "
        f"{'would lie at 1 if all of the class came first.' if alone else 'the better; 1 is all of the class first.'}"
        f"</p>{_figure(plots.precision_recall, alt, narrow=plots.narrow)}"
        f"<details><summary>The same in numbers</summary>{tables.eleven_points(report)}</details>"
    )


def _matrices(report: Report, matrices: Mapping[str, Drawn]) -> str:
    parts = [
        "<p>Dark is alike. Rows and columns are sorted by class, so a good descriptor shows dark squares along the "
        "diagonal and light ones elsewhere. Below each, some of its numbers, two shapes a class where there are enough "
        "(Kacem, Table 4.1); row is the query.</p>"
    ]
    for number, entry in enumerate(report.entries):
        alt = f"Matrix of dissimilarities by {entry.name}"
        body = _figure(matrices[entry.name], alt, "square") + tables.sample(report, entry)
        parts.append(_folded(_named(entry), body, opened=number == 0))
    return "".join(parts)


def _lists(report: Report) -> str:
    chosen = typical(report.entries)
    pool = {shape: number for number, shape in enumerate(report.thumbnails)}
    parts = [
        "<p>For one query a class, the one in the middle of its class by average precision, the ten shapes that "
        "come first (Kacem, Table 4.2); then the queries that do worst. ✓ is of the query's class, ✗ is not.</p>"
    ]
    for number, entry in enumerate(report.entries):
        middle = "".join(_list(report, pool, entry, row) for row in rows_of(entry.evaluation, chosen))
        bad = "".join(_list(report, pool, entry, row) for row in worst(entry.evaluation))
        body = (
            f'<h3>One of each class</h3><div class="lists">{middle}</div>'
            f'<h3>Worst queries</h3><div class="lists">{bad}</div>'
        )
        parts.append(_folded(_named(entry), body, opened=number == 0))
    return "".join(parts)


def _list(report: Report, pool: Mapping[str, int], entry: Entry, row: Row) -> str:
    one = entry.evaluation
    lines = [one.labels[row.query], f"AP {row.average_precision:.2f}"]
    shape = one.ids[row.query]
    query = _shape("div", pool.get(shape), "", [_short(report.name_of(shape)), *lines])
    hits = "".join(
        _shape(
            "li", pool.get(one.ids[hit]), "yes" if relevant else "no",
            [f"{rank} {'✓' if relevant else '✗'} {one.labels[hit]}", _short(report.name_of(one.ids[hit])),
             f"{one.matrix[row.query, hit]:.3g}"],
        )
        for rank, (hit, relevant) in enumerate(zip(row.hits, row.relevant, strict=True), start=1)
    )  # fmt: skip
    return f'<div class="list">{query}<ol class="hits">{hits}</ol></div>'


def _short(name: str) -> str:
    """A file's name without its folders: a tile has no room for them."""
    return name.rsplit("/", 1)[-1]


def _shape(tag: str, thumbnail: int | None, kind: str, lines: list[str]) -> str:
    """A shape in a list: its thumbnail by its number in the pool, and lines of which the first stands out."""
    drawn = '<i class="none"></i>'
    if thumbnail is not None:
        drawn = f'<svg viewBox="0 0 96 96" aria-hidden="true"><use href="#t{thumbnail}"/></svg>'
    words = [f'title="{escape(line, quote=True)}">{escape(line)}' for line in lines]
    rest = "".join(f"<span {line}</span>" for line in words[1:])
    return f'<{tag} class="shape {kind}">{drawn}<b {words[0]}</b>{rest}</{tag}>'


def _pool(report: Report) -> str:
    """Every thumbnail once; the lists refer to it."""
    if not report.thumbnails:
        return ""
    images = "".join(
        f'<image id="t{number}" width="96" height="96" href="data:image/png;base64,{_base64(data)}"/>'
        for number, data in enumerate(report.thumbnails.values())
    )
    return f'<svg class="pool" aria-hidden="true" focusable="false"><defs>{images}</defs></svg>'


def _figure(drawn: Drawn, alt: str, kind: str = "", narrow: Drawn | None = None) -> str:
    """The plot that suits the reader's theme and, where there is one for it, the narrow window."""
    dark, slim = "(prefers-color-scheme:dark)", "(max-width:46rem)"
    sources = [(dark, drawn["dark"])]
    if narrow is not None:
        sources = [(f"{slim} and {dark}", narrow["dark"]), (slim, narrow["light"]), *sources]
    shown = "".join(f'<source media="{media}" srcset="{_svg(data)}">' for media, data in sources)
    words = escape(alt, quote=True)
    return (
        f'<figure class="{kind}"><picture>{shown}<img src="{_svg(drawn["light"])}" alt="{words}"></picture></figure>'
    )


def _svg(data: bytes) -> str:
    return f"data:image/svg+xml;base64,{_base64(data)}"


def _named(entry: Entry) -> str:
    measure = "" if entry.measure is None else f"By {escape(entry.measure)}. "
    return f"{escape(entry.name)}<small>{measure}{escape(entry.summary)}</small>"


def _folded(summary: str, body: str, *, opened: bool) -> str:
    return f"<details{' open' if opened else ''}><summary>{summary}</summary>{body}</details>"


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


_METHOD = """<p>Every shape with a label is a query against all others; it never retrieves itself, and equal
dissimilarities are ranked by name. Shapes alone in their class are no queries, but stay in the lists. With R shapes of
the query's class among the others:</p><dl>
<dt>NN</dt><dd>share of queries whose nearest shape is of their class</dd>
<dt>FT, ST</dt><dd>first and second tier: share of the R that is among the first R, and 2R</dd>
<dt>E</dt><dd>E-measure of the first 32: 2 / (1 / precision + 1 / recall)</dd>
<dt>DCG</dt><dd>discounted cumulative gain over that of a perfect list</dd>
<dt>MAP</dt><dd>mean over queries of the average precision</dd>
<dt>interval</dt><dd>the middle 95 % of what queries drawn with replacement give; within each class for the mean over
classes. Of a class of a few shapes it is too narrow</dd></dl>
<p class="soft">Measures after Shilane, Min, Kazhdan and Funkhouser, "The Princeton Shape Benchmark", 2004.</p>"""
