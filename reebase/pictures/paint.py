"""A mesh and its skeleton painted into one square panel, farthest triangles first."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.mesh.mesh import Mesh
from reebase.pictures.canvas import FONT, PALETTE
from reebase.pictures.view import View, face_shades, placed, view_of
from reebase.skeleton.graph import Skeleton

__all__ = ["Mark", "paint_skeleton", "paint_surface", "panel_axes"]

Array = npt.NDArray[np.float64]

_SKIN = np.array([0.70, 0.76, 0.84])
_GREY = np.array([0.78, 0.78, 0.78])
_INK = "#1b2733"

Mark = tuple[str, str]
"""What an endpoint's disc shows: its colour and its text."""


def panel_axes(figure: Any, left: float, bottom: float, size: int) -> Any:
    """Axes in the pixels of a square panel, whose lower left corner is at (left, bottom) of the figure."""
    width, height = figure.get_size_inches() * figure.dpi
    axes = figure.add_axes((left / width, bottom / height, size / width, size / height))
    axes.set_xlim(0, size)
    axes.set_ylim(0, size)
    axes.axis("off")
    return axes


def paint_surface(
    axes: Any, mesh: Mesh, size: int, view: View | str | None, scalar: Array | None, pale: bool
) -> None:
    """The faces that can be seen, shaded; coloured by a value per vertex where there is one. pale: under a skeleton."""
    from matplotlib.collections import PolyCollection

    seen = placed(mesh, mesh.vertices, size, view_of(mesh, view))
    light, visible = face_shades(seen, mesh.faces)
    order = np.flatnonzero(visible)
    order = order[np.argsort(seen[mesh.faces[order], 2].mean(axis=1), kind="stable")]
    base = np.broadcast_to(_SKIN, (len(order), 3)) if scalar is None else _coloured(scalar, mesh.faces[order])
    shade = (0.38 + 0.72 * light[order])[:, None]
    colours = np.clip(base * shade, 0, 1)
    if pale:
        colours = 1 - 0.62 * (1 - colours)
    corners: Any = seen[mesh.faces[order]][:, :, :2]  # an array is drawn much faster than a sequence
    axes.add_collection(PolyCollection(
        corners, facecolors=colours, edgecolors=colours, linewidths=0.35,
        zorder=1,
    ))  # fmt: skip


def _coloured(scalar: Array, faces: npt.NDArray[np.int32]) -> Array:
    """Colours of faces (n, 3): red-blue around zero for values of both signs, else viridis; NaN is grey."""
    from matplotlib import colormaps

    values = np.asarray(scalar, dtype=np.float64)
    finite = values[np.isfinite(values)]
    colours = np.broadcast_to(_GREY, (len(faces), 3)).copy()
    if not finite.size:
        return colours
    low, high = float(finite.min()), float(finite.max())
    if low < 0 < high:
        low, high, name = min(low, -high), max(high, -low), "RdBu_r"
    else:
        name = "viridis"
    means = values[faces].mean(axis=1)
    known = np.isfinite(means)
    share = (means[known] - low) / (high - low) if high > low else np.full(int(known.sum()), 0.5)
    colours[known] = colormaps[name](share)[:, :3]
    return colours


def paint_skeleton(
    axes: Any, mesh: Mesh, skeleton: Skeleton, size: int, view: View | str | None,
    marks: Sequence[Mark] | None,
) -> None:  # fmt: skip
    """Edges as lines, dotted across gaps; nodes as dots, the root a white square, each endpoint a disc with its number.

    A disc that would hide another is moved aside, with a line to its endpoint.
    """
    from matplotlib.collections import LineCollection

    scale = size / 512 * 0.6 + 0.4
    seen = placed(mesh, skeleton.positions, size, view_of(mesh, view))[:, :2]
    lines = list(seen[skeleton.edges])
    axes.add_collection(LineCollection(lines, colors="white", linewidths=3.0 * scale, zorder=2, alpha=0.8))
    styles = ["dotted" if join else "solid" for join in skeleton.joins]
    axes.add_collection(LineCollection(lines, colors=_INK, linewidths=1.5 * scale, linestyles=styles, zorder=3))
    axes.scatter(seen[:, 0], seen[:, 1], s=(2.4 * scale) ** 2, c=_INK, linewidths=0, zorder=4)
    root = seen[skeleton.root]
    axes.scatter(
        *root, s=(6.5 * scale) ** 2, marker="s", c="white", edgecolors=_INK, linewidths=1.3, zorder=5
    )  # fmt: skip
    if marks is None:
        marks = [(PALETTE[end % len(PALETTE)], str(end)) for end in range(len(skeleton.endpoints))]
    ends = seen[skeleton.endpoints].reshape(-1, 2)
    radius = 8.5 * scale
    discs = _apart(ends, 2.05 * radius, radius, size - radius)
    for end, disc, (colour, text) in zip(ends, discs, marks, strict=True):
        if np.linalg.norm(disc - end) > 1:
            axes.plot(*np.stack([end, disc]).T, color=colour, linewidth=1.2 * scale, zorder=6)
        axes.scatter(*end, s=(5 * scale) ** 2, c=colour, linewidths=0, zorder=6)
        points = 2 * radius * 0.72
        axes.scatter(*disc, s=points**2, c=colour, edgecolors="white", linewidths=1.0 * scale, zorder=7)
        axes.text(
            *disc, text, color="white", fontsize=8.2 * scale if len(text) < 2 else 7.0 * scale,
            fontfamily=FONT, fontweight="bold", ha="center", va="center_baseline", zorder=8,
        )  # fmt: skip


def _apart(points: Array, distance: float, low: float, high: float) -> Array:
    """The points, those nearer than ``distance`` pushed apart, all within [low, high]."""
    moved = points.copy()
    for _ in range(60):
        between = moved[:, None] - moved[None]
        lengths = np.linalg.norm(between, axis=2)
        np.fill_diagonal(lengths, np.inf)
        if not (lengths < distance).any():
            break
        # Coinciding points have no direction to part in: they leave each other by their order.
        rank = np.arange(len(moved))
        fallback = np.stack([rank[:, None] - rank[None], np.zeros_like(lengths)], axis=2)
        direction = np.where((lengths > 1e-9)[..., None], between, fallback)
        direction /= np.maximum(np.linalg.norm(direction, axis=2, keepdims=True), 1e-12)
        push = np.maximum(distance - lengths, 0)
        moved = np.clip(moved + 0.55 * (push[..., None] * direction).sum(axis=1), low, high)
    return moved
