"""The tables of the report, as HTML: numbers with their intervals, headings that a screen reader can follow."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

from reebase.evaluation import SCORES
from reebase.evaluation.intervals import Interval
from reebase.report.lists import sample_of
from reebase.report.record import Entry, Report

__all__ = ["classes", "costs", "eleven_points", "left_out", "overall", "sample"]

SHORT = {"nn": "NN", "first_tier": "FT", "second_tier": "ST", "e_measure": "E", "dcg": "DCG", "map": "MAP"}
"""What the measures are called where there is little room."""


def overall(report: Report) -> str:
    """Every measure of every entry, over queries and over classes, the best of each in bold."""
    parts = []
    for what, mean, bounds in (
        ("Mean over all queries", "overall", "intervals"),
        ("Mean over the classes, each with the same weight", "class_mean", "class_mean_intervals"),
    ):
        means = {entry.name: getattr(entry.evaluation, mean) for entry in report.entries}
        best = {score: _best([row[score] for row in means.values()]) for score in SCORES}
        rows = [
            (
                entry.name,
                [
                    _number(means[entry.name][score], getattr(entry.evaluation, bounds).get(score),
                            round(means[entry.name][score], 3) == best[score])
                    for score in SCORES
                ],
            )
            for entry in report.entries
        ]  # fmt: skip
        parts.append(_table(f"{what}, with 95 % intervals", ["descriptor", *SHORT.values()], rows))
    return "".join(parts)


def eleven_points(report: Report) -> str:
    """Interpolated precision at recall 0, 0.1, ... 1 of every entry."""
    rows = [
        (entry.name, [f"<td>{value:.3f}</td>" for value in entry.evaluation.precision_recall.eleven_point])
        for entry in report.entries
    ]
    recalls = [f"{tenth / 10:.1f}" for tenth in range(11)]
    return _table("Interpolated precision at eleven recalls", ["descriptor", *recalls], rows)


def costs(report: Report) -> str:
    """Time a mesh and bytes a shape of each entry; nothing where they were not measured."""
    measured = [entry for entry in report.entries if entry.cost is not None]
    if not measured:
        return ""
    rows = [
        (entry.name, [f"<td>{entry.cost.milliseconds:.1f}</td><td>{entry.cost.bytes:,.0f}</td>"
                      f'<td class="text">{escape(entry.summary)}</td>'])
        for entry in measured if entry.cost is not None
    ]  # fmt: skip
    shared = ", ".join(f"{escape(name)} {value:.0f} ms" for name, value in report.shared.items())
    told = f"<p>All share, once a mesh: {shared}. The column is what each adds to that.</p>" if shared else ""
    table = _table("Medians over the shapes", ["descriptor", "ms a mesh", "bytes a shape", "what it is"], rows, words=1)
    return told + table


def classes(report: Report) -> str:
    """MAP of each class by each entry, and all measures of each entry in a fold of its own."""
    labels = sorted({label for entry in report.entries for label in entry.evaluation.per_class})
    found = [entry.evaluation.per_class for entry in report.entries]
    rows = [
        (label, [_shaded(per_class[label]["map"]) if label in per_class else "<td></td>" for per_class in found])
        for label in labels
    ]
    parts = [_table("MAP by class", ["class", *(entry.name for entry in report.entries)], rows)]
    for entry in report.entries:
        one = entry.evaluation
        own = [
            (
                f"{label} ({one.counts[label]})",
                [_number(means[score], one.class_intervals.get(label, {}).get(score)) for score in SCORES],
            )
            for label, means in one.per_class.items()
        ]
        table = _table(f"{entry.name}: all measures with 95 % intervals", ["class (shapes)", *SHORT.values()], own)
        parts.append(f"<details><summary>All measures: {escape(entry.name)}</summary>{table}</details>")
    return "".join(parts)


def sample(report: Report, entry: Entry) -> str:
    """Some rows and columns of the matrix of dissimilarities as numbers, to three digits."""
    one = entry.evaluation
    rows = sample_of(one)
    heads, counts = [], dict.fromkeys(one.labels, 0)
    for row in rows:
        counts[one.labels[row]] += 1
        heads.append(f"{one.labels[row]} {counts[one.labels[row]]}")
    part = one.matrix[np.ix_(rows, rows)]
    high = float(part.max()) or 1.0
    body = [
        (head, [*(_shaded(1 - value / high, f"{value:.3g}") for value in values),
                f'<td class="text">{escape(report.name_of(one.ids[row]))}</td>'])
        for row, head, values in zip(rows, heads, part.tolist(), strict=True)
    ]  # fmt: skip
    return _table(f"Some dissimilarities by {entry.name}", ["query", *heads, "name of the query"], body, words=1)


def left_out(report: Report) -> str:
    """Shapes that took no part, each with its reason."""
    rows = [
        (name, [f"<td class=\"text\">{escape(code)}</td><td class=\"text\">{escape(detail)}</td>"])
        for name, (code, detail) in sorted(report.failed.items())
    ]
    return _table("Shapes that took no part", ["shape", "code", "why"], rows, words=2) if rows else ""


def _best(values: Sequence[float]) -> float | None:
    """The greatest as it is shown; None where all are shown the same."""
    shown = {round(value, 3) for value in values}
    return max(shown) if len(shown) > 1 else None


def _number(value: float, interval: Interval | None = None, best: bool = False) -> str:
    shown = f"<strong>{value:.3f}</strong>" if best else f"{value:.3f}"
    beside = "" if interval is None else f"<small>{interval[0]:.2f}–{interval[1]:.2f}</small>"
    return f"<td>{shown}{beside}</td>"


def _shaded(share: float, text: str | None = None) -> str:
    return f'<td class="shade" style="--v:{min(max(share, 0.0), 1.0):.3f}">{text or f"{share:.3f}"}</td>'


def _table(caption: str, heads: Sequence[str], rows: Iterable[tuple[str, Sequence[str]]], words: int = 0) -> str:
    """A table that scrolls sideways by itself, whose first column stays in sight. words: how many last columns hold
    words, not numbers."""
    kinds = ["" for _ in heads[words:]] + [' class="text"'] * words
    head = "".join(f'<th scope="col"{kind}>{escape(name)}</th>' for name, kind in zip(heads, kinds, strict=True))
    body = "".join(f'<tr><th scope="row">{escape(name)}</th>{"".join(cells)}</tr>' for name, cells in rows)
    told = escape(caption, quote=True)
    return (
        f'<div class="wide" role="region" tabindex="0" aria-label="{told}"><table><caption>{told}</caption>'
        f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )
