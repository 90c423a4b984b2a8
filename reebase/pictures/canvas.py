"""The one place that touches matplotlib's figures and files."""

from __future__ import annotations

import io
import threading
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from reebase.errors import MissingPackage, unknown_name

__all__ = ["DPI", "FONT", "FORMATS", "PALETTE", "THEMES", "Theme", "blank", "encoded", "printable", "theme_named"]

DPI = 100
"""Pixels per inch of every figure; text and lines are sized in points against it."""

FORMATS = ("png", "svg")

PALETTE = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B8860B", "#56B4E9", "#7B3F9E", "#6B6B6B", "#8C1D40", "#3D5A1F",
)  # fmt: skip
"""Okabe and Ito's colours with the yellow and black replaced by ones that carry white numerals, and two more."""

@dataclass(frozen=True)
class Theme:
    """Colours of a plot: its ground, its words, its lesser words, its lines of help, and its curves."""

    ground: str
    ink: str
    soft: str
    grid: str
    curves: tuple[str, ...]


THEMES = MappingProxyType({
    "light": Theme("white", "#1b2733", "#5b6770", "#e4e8eb", PALETTE),
    "dark": Theme("#151b22", "#e6ebf0", "#9aa7b3", "#2b343e", (
        "#56B4E9", "#FF9D5C", "#2FD19B", "#F0A3D0", "#E6C229", "#9FC9FF", "#C39BE8", "#B8C0C8", "#F07C94", "#A9C66B",
    )),
})  # fmt: skip
"""name -> colours."""

FONT = "DejaVu Sans"
"""Comes with matplotlib, so that a picture looks the same everywhere."""

_SVG = threading.Lock()


def theme_named(name: str) -> Theme:
    """Raises UnknownName."""
    if name not in THEMES:
        raise unknown_name("theme", name, THEMES)
    return THEMES[name]


def blank(width: int, height: int, ground: str = "white") -> Any:
    """An empty figure of that many pixels, that belongs to no window and no global list.

    Raises MissingPackage when matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingPackage(
            "Pictures need matplotlib, which is not installed; run: pip install 'reebase[pictures]'.",
            package="matplotlib", extra="pictures",
        ) from error  # fmt: skip
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor=ground)
    FigureCanvasAgg(figure)
    return figure


def printable(text: str, width: float, points: float) -> str:
    """The text as one line of at most about that many pixels; characters that the font lacks become boxes."""
    from matplotlib.font_manager import findfont, get_font

    font = get_font(findfont(FONT))
    line = "".join(char if font.get_char_index(ord(char)) else "\u25a1" for char in " ".join(text.split()))
    most = max(4, int(width / (0.68 * points * DPI / 72)))
    return line if len(line) <= most else line[: most - 1].rstrip() + "…"


def encoded(figure: Any, format: str) -> bytes:
    """The file's bytes, without dates, versions or random identifiers. Raises UnknownName."""
    if format not in FORMATS:
        raise unknown_name("picture format", format, FORMATS)
    buffer = io.BytesIO()
    if format == "png":
        figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
        return buffer.getvalue()
    import matplotlib

    # The salt of SVG identifiers can be set nowhere but in the global settings; it is put back at once.
    with _SVG, matplotlib.rc_context({"svg.hashsalt": "reebase", "svg.fonttype": "none"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue()
