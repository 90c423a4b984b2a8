"""A report as files: the page, the record, and each plot by itself."""

from __future__ import annotations

import json
import re
from collections.abc import Callable

from reebase.pictures import matrix_plot, precision_recall_plot
from reebase.report.lists import by_class
from reebase.report.page import Plots, html
from reebase.report.record import Entry, Report

__all__ = ["files", "page"]

Progress = Callable[[float], None]

_SAFE = re.compile(r"[^A-Za-z0-9_.-]+")


def page(report: Report, *, progress: Progress | None = None) -> str:
    """The whole report as one HTML page. progress: called with the fraction that is done.

    Raises MissingPackage without matplotlib.
    """
    return html(report, _plots(report, progress))


def files(report: Report, *, progress: Progress | None = None) -> dict[str, bytes]:
    """Name -> bytes: index.html, report.json, precision_recall.svg and matrix-NAME.svg for each descriptor.

    Raises MissingPackage without matplotlib.
    """
    plots = _plots(report, progress)
    record = json.dumps(report.to_json(), ensure_ascii=False, allow_nan=False, indent=1)
    named = {"index.html": html(report, plots).encode(), "report.json": f"{record}\n".encode()}
    named["precision_recall.svg"] = plots.precision_recall["light"]
    for name, drawn in plots.matrices.items():
        named[f"matrix-{_SAFE.sub('_', name)}.svg"] = drawn["light"]
    return named


def _plots(report: Report, progress: Progress | None) -> Plots:
    themes = ("light", "dark")
    done, steps = 0, len(themes) * (2 + len(report.entries))

    def step(drawn: bytes) -> bytes:
        nonlocal done
        done += 1
        if progress is not None:
            progress(done / steps)
        return drawn

    curves = {
        entry.name: (entry.evaluation.precision_recall.recall, entry.evaluation.precision_recall.precision)
        for entry in report.entries
    }
    few = len(curves) <= 6
    return Plots(
        {theme: step(precision_recall_plot(curves, width=700 if few else 820, theme=theme)) for theme in themes},
        {
            theme: step(precision_recall_plot(curves, width=400, height=360 if few else 500, theme=theme))
            for theme in themes
        },
        {entry.name: {theme: step(_matrix(entry, theme)) for theme in themes} for entry in report.entries},
    )


def _matrix(entry: Entry, theme: str) -> bytes:
    rows = by_class(entry.evaluation)
    labels = [entry.evaluation.labels[row] for row in rows]
    return matrix_plot(entry.evaluation.matrix[rows][:, rows], labels, format="svg", theme=theme)
