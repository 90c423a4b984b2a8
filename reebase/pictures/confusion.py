"""Which classes are taken for which, as a heat map with its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError
from reebase.pictures.canvas import blank, encoded, printable, theme_named

__all__ = ["confusion_plot"]

_MOST_NUMBERED = 24  # classes whose cells have room for a number


def confusion_plot(
    counts: npt.NDArray[np.int64], labels: Sequence[str], *, title: str | None = None, format: str = "svg",
    size: int = 640, theme: str = "light",
) -> bytes:  # fmt: skip
    """Row: class of the query. Column: class of its nearest shape. The brightness is the share of the row.

    counts: (c, c). labels: (c,). Raises ParameterError, UnknownName, MissingPackage.
    """
    table = np.asarray(counts, dtype=np.float64)
    if table.ndim != 2 or table.shape != (len(labels), len(labels)) or not table.size:
        raise ParameterError(
            f"counts must be a square matrix with a row for each of the {len(labels)} labels; found {table.shape}.",
            parameter="counts",
        )
    colours = theme_named(theme)
    figure = blank(size, size, colours.ground)
    axes = figure.add_axes((0.2, 0.16, 0.77, 0.77))
    axes.set_facecolor(colours.ground)
    shares = table / np.maximum(table.sum(axis=1, keepdims=True), 1)
    low, high = _ends(theme)
    from matplotlib.colors import LinearSegmentedColormap

    axes.imshow(shares, cmap=LinearSegmentedColormap.from_list("shares", [low, high]), vmin=0, vmax=1)
    names = [printable(label, 120, 8.5) for label in labels]
    places = range(len(labels))
    axes.set_xticks(places, names, rotation=45, ha="right", rotation_mode="anchor", parse_math=False)
    axes.set_yticks(places, names, parse_math=False)
    for side in axes.spines.values():
        side.set_visible(False)
    axes.tick_params(colors=colours.soft, labelsize=8.5 if len(labels) <= 40 else 5, length=0)
    axes.set_ylabel("query", color=colours.ink)
    axes.set_title(
        title or "nearest", loc="left", fontsize=12 if title else 10, color=colours.ink, pad=10, parse_math=False,
        fontweight="bold" if title else "normal",
    )  # fmt: skip
    if len(labels) <= _MOST_NUMBERED:
        _number(axes, table, shares, colours.ink, theme)
    return encoded(figure, format)


def _ends(theme: str) -> tuple[str, str]:
    return ("#f2f5f7", "#0072B2") if theme == "light" else ("#1d252e", "#56B4E9")


def _number(
    axes: Any, table: npt.NDArray[np.float64], shares: npt.NDArray[np.float64], ink: str, theme: str
) -> None:
    on_full = "white" if theme == "light" else "#0b1016"
    for (row, column), number in np.ndenumerate(table):
        if number:
            axes.text(
                column, row, f"{int(number)}", ha="center", va="center", fontsize=8,
                color=on_full if shares[row, column] > 0.5 else ink,
            )  # fmt: skip
