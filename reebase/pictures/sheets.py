"""Single pictures, contact sheets, and the picture of an answer: a query and its hits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError
from reebase.mesh.mesh import Mesh
from reebase.pictures.canvas import FONT, PALETTE, blank, encoded, printable
from reebase.pictures.paint import Mark, paint_skeleton, paint_surface, panel_axes
from reebase.pictures.view import View
from reebase.skeleton.graph import Skeleton

__all__ = ["HitPanel", "Panel", "answer_picture", "contact_sheet", "picture"]

_INK = "#1b2733"
_SOFT = "#5b6770"
_UNMATCHED = "#9aa3ab"
_TITLE = 26
"""Pixels of the strip above a panel that holds a line of text."""


@dataclass(frozen=True, eq=False)
class Panel:
    """One mesh in a sheet.

    scalar: a value per vertex, (m,), NaN allowed. title, subtitle: lines above it.
    view: a View, "principal" (also None) or "upright" (+z up).
    """

    mesh: Mesh
    skeleton: Skeleton | None = None
    title: str | None = None
    subtitle: str | None = None
    scalar: npt.NDArray[np.float64] | None = None
    view: View | str | None = None


@dataclass(frozen=True, eq=False)
class HitPanel:
    """A hit: its panel, D, and (endpoint of the query, endpoint of the hit) of each matched pair."""

    panel: Panel
    dissimilarity: float
    pairs: tuple[tuple[int, int], ...] = ()


def picture(
    mesh: Mesh, skeleton: Skeleton | None = None, *, scalar: npt.NDArray[np.float64] | None = None,
    size: int = 512, format: str = "png", title: str | None = None, view: View | str | None = None,
) -> bytes:  # fmt: skip
    """A square picture of the mesh, ``size`` pixels wide, as PNG or SVG.

    The surface is pale under a skeleton. Endpoints carry their number in ``skeleton.endpoints``, as their
    features and a match do; the root is a white square. scalar colours the vertices, (m,).
    Raises ParameterError, UnknownName, NoFaces, MissingPackage.
    """
    panel = Panel(mesh, skeleton, scalar=scalar, view=view)
    _check(size, [panel])
    figure = blank(size, size)
    axes = panel_axes(figure, 0, 0, size)
    _paint(axes, panel, size)
    if title:
        _text(figure, 12, size - 10, title, 11, _INK, size - 24)
    return encoded(figure, format)


def contact_sheet(
    items: Sequence[Panel], columns: int | None = None, *, size: int = 256, format: str = "png",
    title: str | None = None,
) -> bytes:  # fmt: skip
    """Panels in rows of ``columns`` (by default about square), each ``size`` pixels wide, titles above them.

    Raises ParameterError, UnknownName, NoFaces, MissingPackage.
    """
    _check(size, items)
    if not items:
        raise ParameterError("A contact sheet needs at least one panel; found none.", parameter="items")
    across = columns if columns is not None else int(np.ceil(np.sqrt(len(items))))
    if across < 1:
        raise ParameterError(f"columns must be at least 1; found {across}.", parameter="columns")
    across = min(across, len(items))
    down = -(-len(items) // across)
    strip = _TITLE * max((item.title is not None) + (item.subtitle is not None) for item in items)
    head = 44 if title else 0
    height = down * (size + strip) + head
    figure = blank(across * size, height)
    if title:
        _text(figure, 12, height - 14, title, 13, _INK, across * size - 24, bold=True)
    for number, item in enumerate(items):
        left = number % across * size
        top = height - head - number // across * (size + strip)
        axes = panel_axes(figure, left, top - strip - size, size)
        _paint(axes, item, size)
        _titles(figure, left, top, item, size)
    return encoded(figure, format)


def answer_picture(
    query: Panel, hits: Sequence[HitPanel], *, columns: int = 5, size: int = 256, format: str = "png"
) -> bytes:  # fmt: skip
    """The query in the upper left corner, then its hits by rank, each with D.

    An endpoint of a hit has the colour and the number of the query's endpoint that it is matched with;
    unmatched ones are grey. Raises ParameterError, UnknownName, NoFaces, MissingPackage.
    """
    _check(size, [query, *(hit.panel for hit in hits)])
    if columns < 1:
        raise ParameterError(f"columns must be at least 1; found {columns}.", parameter="columns")
    across = min(columns, len(hits) + 1)
    down = -(-(len(hits) + 1) // across)
    strip = 2 * _TITLE
    height = down * (size + strip)
    figure = blank(across * size, height)
    panels: list[tuple[Panel, list[Mark] | None]] = [
        (_retitled(query, query.title or "query", "the query" if query.title else None), None)
    ]
    for rank, hit in enumerate(hits, start=1):
        label = f"{rank}. {hit.panel.title or ''}".rstrip()
        matched = {second: first for first, second in hit.pairs}
        titled = _retitled(hit.panel, label, f"D = {hit.dissimilarity:.4g}")
        panels.append((titled, _marks(hit.panel, matched)))
    for number, (panel, marks) in enumerate(panels):
        left, top = number % across * size, height - number // across * (size + strip)
        axes = panel_axes(figure, left, top - strip - size, size)
        _paint(axes, panel, size, marks)
        _titles(figure, left, top, panel, size)
        if number == 0:
            axes.add_patch(_frame(size))
    return encoded(figure, format)


def _marks(panel: Panel, matched: dict[int, int]) -> list[Mark] | None:
    """Discs of a panel's endpoints: the query's colour and number of the matched, grey for the others."""
    if panel.skeleton is None:
        return None
    return [
        (PALETTE[matched[end] % len(PALETTE)], str(matched[end])) if end in matched else (_UNMATCHED, "·")
        for end in range(len(panel.skeleton.endpoints))
    ]


def _retitled(panel: Panel, title: str, subtitle: str | None) -> Panel:
    return Panel(panel.mesh, panel.skeleton, title, subtitle, panel.scalar, panel.view)


def _frame(size: int) -> Any:
    from matplotlib.patches import FancyBboxPatch

    return FancyBboxPatch(
        (5, 5), size - 10, size - 10, boxstyle="round,pad=0,rounding_size=10", fill=False,
        edgecolor="#0072B2", linewidth=1.6, zorder=0,
    )  # fmt: skip


def _check(size: int, panels: Sequence[Panel]) -> None:
    if not 16 <= size <= 8192:
        raise ParameterError(f"size must be from 16 to 8192 pixels; found {size}.", parameter="size")
    for panel in panels:
        if panel.scalar is not None and np.shape(panel.scalar) != (len(panel.mesh.vertices),):
            raise ParameterError(
                f"scalar must have one value for each of the {len(panel.mesh.vertices)} vertices; "
                f"found shape {np.shape(panel.scalar)}.",
                parameter="scalar",
            )  # fmt: skip


def _paint(axes: Any, panel: Panel, size: int, marks: list[Mark] | None = None) -> None:
    paint_surface(axes, panel.mesh, size, panel.view, panel.scalar, pale=panel.skeleton is not None)
    if panel.skeleton is not None:
        paint_skeleton(axes, panel.mesh, panel.skeleton, size, panel.view, marks)


def _titles(figure: Any, left: float, top: float, panel: Panel, size: int) -> None:
    if panel.title is not None:
        _text(figure, left + 12, top - 10, panel.title, 9.5, _INK, size - 20, bold=True)
    if panel.subtitle is not None:
        down = 30 if panel.title is not None else 10
        _text(figure, left + 12, top - down, panel.subtitle, 9, _SOFT, size - 20)


def _text(
    figure: Any, x: float, y: float, text: str, points: float, colour: str, room: float, bold: bool = False
) -> None:
    width, height = figure.get_size_inches() * figure.dpi
    figure.text(
        x / width, y / height, printable(text, room, points), fontsize=points, color=colour, ha="left", va="top",
        fontfamily=FONT, fontweight="bold" if bold else "normal", parse_math=False,
    )  # fmt: skip
