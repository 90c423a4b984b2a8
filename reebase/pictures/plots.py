"""Plots of an evaluation: precision over recall, and the matrix of dissimilarities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError
from reebase.pictures.canvas import Theme, blank, encoded, theme_named

__all__ = ["matrix_plot", "precision_recall_plot"]

_MOST_INSIDE = 6
_LEGEND = 180
_WIDE = 560
"""Curves that are named inside the plot; pixels for the names beside it where there are more, and from which width on
there is room beside it and not below."""

_CROWD = 0.9
"""Share of the values in a tenth of their range from which on colours stand for ranks."""

_DASHES: tuple[Any, ...] = ("-", (0, (6, 2)), (0, (2, 1.5)), (0, (6, 2, 1.5, 2)))

Curve = tuple[Sequence[float] | npt.NDArray[np.float64], Sequence[float] | npt.NDArray[np.float64]]


def precision_recall_plot(
    curves: Mapping[str, Curve], *, title: str | None = None, format: str = "svg", width: int = 640,
    height: int = 480, theme: str = "light",
) -> bytes:  # fmt: skip
    """Precision over recall, one line for each named (recall, precision), as SVG or PNG.

    Lines differ in colour and in dashes. More than six are named beside or below the plot.
    Raises ParameterError, UnknownName, MissingPackage.
    """
    if not curves:
        raise ParameterError("The plot needs at least one curve; found none.", parameter="curves")
    for name, (recall, precision) in curves.items():
        if len(recall) != len(precision) or not len(recall):
            raise ParameterError(
                f"Curve {name!r} has {len(recall)} recalls and {len(precision)} precisions; "
                "there must be as many of both, and at least one.",
                parameter="curves",
            )  # fmt: skip
    colours = theme_named(theme)
    figure = blank(width, height, colours.ground)
    top = 0.9 if title else 0.96
    many = len(curves) > _MOST_INSIDE
    beside = _LEGEND if many and width >= _WIDE else 0
    below = 18 * -(-len(curves) // 2) + 12 if many and not beside else 0
    axes = figure.add_axes((
        64 / width, (56 + below) / height, 1 - (88 + beside) / width, top - (56 + below) / height,
    ))  # fmt: skip
    axes.set_facecolor(colours.ground)
    for number, (name, (recall, precision)) in enumerate(curves.items()):
        axes.plot(
            np.asarray(recall), np.asarray(precision), color=colours.curves[number % len(colours.curves)],
            linestyle=_DASHES[number % len(_DASHES)], linewidth=2, marker="o" if len(recall) <= 21 else None,
            markersize=3.5, label=name, clip_on=False,
        )  # fmt: skip
    axes.set_xlim(0, 1)
    axes.set_ylim(0, 1.005)
    axes.set_xlabel("recall", color=colours.ink)
    axes.set_ylabel("precision", color=colours.ink)
    _plain(axes, colours)
    axes.grid(color=colours.grid, linewidth=0.8)
    axes.set_axisbelow(True)
    where: dict[str, Any] = {"loc": "lower left"}
    if beside:
        where = {"loc": "upper left", "bbox_to_anchor": (1.02, 1.0)}
    elif below:
        where = {"loc": "upper center", "bbox_to_anchor": (0.5, -50 / (height * top - 56 - below)), "ncols": 2}
    axes.legend(
        facecolor=colours.ground, edgecolor="none", framealpha=0.85, fontsize=9, labelcolor=colours.ink,
        handlelength=3.4, borderaxespad=0.4, **where,
    )  # fmt: skip
    if title:
        axes.set_title(
            title, loc="left", fontsize=12, color=colours.ink, fontweight="bold", pad=12, parse_math=False
        )  # fmt: skip
    return encoded(figure, format)


def matrix_plot(
    values: npt.NDArray[np.float64], labels: Sequence[str], *, title: str | None = None,
    format: str = "png", size: int = 720, theme: str = "light", ranks: bool | None = None,
) -> bytes:  # fmt: skip
    """The matrix of dissimilarities (n, n), dark where shapes are alike, a line between classes.

    labels: class of each row, (n,); sort rows by class first. ranks: colours stand for the rank of a value among
    all, in [0, 1], instead of for the value; by default where most values lie so close together that they would
    all have one colour. Raises ParameterError, UnknownName, MissingPackage.
    """
    matrix = np.asarray(values, dtype=np.float64)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.size:
        raise ParameterError(
            f"values must be a square matrix; found shape {matrix.shape}.", parameter="values"
        )  # fmt: skip
    if len(labels) != len(matrix):
        raise ParameterError(
            f"{len(matrix)} rows need as many labels; found {len(labels)}.", parameter="labels"
        )  # fmt: skip
    colours = theme_named(theme)
    high_up = 0.13 if title else 0.06
    height = round(size * (0.87 + high_up))
    figure = blank(size, height, colours.ground)
    left, side = 0.155, 0.73
    bottom, tall = 0.14 * size / height, side * size / height
    axes = figure.add_axes((left, bottom, side, tall))
    finite = matrix[np.isfinite(matrix)]
    high = float(np.quantile(finite, 0.98)) if finite.size else 1.0
    if ranks is None:
        ranks = _crowded(finite, high)
    if ranks:
        matrix, high = _ranked(matrix), 1.0
    image = axes.imshow(
        np.ma.masked_invalid(matrix), cmap="viridis", vmin=0, vmax=high or 1.0, interpolation="nearest"
    )  # fmt: skip
    starts = [row for row in range(len(labels)) if row == 0 or labels[row] != labels[row - 1]]
    stops = [*starts[1:], len(labels)]
    for start in starts[1:]:
        axes.axhline(start - 0.5, color="white", linewidth=0.8)
        axes.axvline(start - 0.5, color="white", linewidth=0.8)
    middles = [(start + stop - 1) / 2 for start, stop in zip(starts, stops, strict=True)]
    names = [labels[start] for start in starts]
    axes.set_xticks(middles, names, rotation=45, ha="right", rotation_mode="anchor", parse_math=False)
    axes.set_yticks(middles, names, parse_math=False)
    _plain(axes, colours)
    axes.tick_params(length=0, labelsize=8.5)
    beside = figure.add_axes((left + side + 0.025, bottom, 0.018, tall))
    bar = figure.colorbar(image, cax=beside, extend="neither" if ranks else "max")
    bar.outline.set_visible(False)
    bar.ax.tick_params(labelsize=8, colors=colours.soft, length=0)
    if ranks:
        bar.set_ticks([0, 0.5, 1], labels=["0", "½", "1"])
        bar.set_label("rank of the dissimilarity", fontsize=9, color=colours.ink)
    else:
        bar.ax.set_title("D", fontsize=10, color=colours.ink, pad=14)
    if title:
        figure.text(
            left, bottom + tall + 0.03, title, fontsize=12, color=colours.ink, fontweight="bold", parse_math=False
        )  # fmt: skip
    return encoded(figure, format)


def _crowded(values: npt.NDArray[np.float64], high: float) -> bool:
    """Whether two twentieths of the range from 0 to ``high`` hold nine tenths of the values."""
    counts, _ = np.histogram(values, bins=20, range=(0.0, high)) if high > 0 else (np.zeros(20, dtype=int), None)
    return bool(np.sort(counts)[-2:].sum() >= _CROWD * len(values) > 0)


def _ranked(matrix: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The rank of each finite value among all of them, from 0 to 1, equal values at their middle; else NaN."""
    ranked = np.full(matrix.shape, np.nan)
    finite = np.isfinite(matrix)
    _, place, counts = np.unique(matrix[finite], return_inverse=True, return_counts=True)
    if len(counts):
        middles = np.cumsum(counts) - (counts + 1) / 2
        spread = middles - middles[0]
        ranked[finite] = (spread / (spread[-1] or 1.0))[place]
    return ranked


def _plain(axes: Any, colours: Theme) -> None:
    for side in axes.spines.values():
        side.set_visible(False)
    axes.tick_params(colors=colours.soft, labelsize=9, length=0)
