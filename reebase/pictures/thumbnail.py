"""A small picture of a mesh, for lists of many: drawn in milliseconds, a few kilobytes, without matplotlib.

``thumbnail(mesh, size=192, view=None) -> bytes``: PNG with a transparent ground, which reads on light and dark pages.
"""

from __future__ import annotations

import zlib

import numpy as np
import numpy.typing as npt

from reebase.mesh.mesh import Mesh
from reebase.pictures.thumbnail_kernels import lit
from reebase.pictures.view import View, placed

__all__ = ["MOST_BYTES", "thumbnail"]

MOST_BYTES = 10_000
"""What a thumbnail of up to 256 pixels takes at most: one that would take more has fewer shades."""

_SKIN = np.array([0.70, 0.76, 0.84])
_DARKEST, _RANGE = 0.30, 0.80  # no shade falls back into a dark page
_FINER = 2  # each pixel is the mean of so many squared
_SHADES = 64  # of a pixel that is covered whole


def thumbnail(mesh: Mesh, size: int = 192, view: View | str | None = None) -> bytes:
    """The surface from its principal view in a square of ``size`` pixels, as PNG with few colours.

    Raises NoFaces, UnknownName.
    """
    fine = lit(placed(mesh, mesh.vertices, size * _FINER, view), mesh.faces, size * _FINER)
    blocks = fine.reshape(size, _FINER, size, _FINER)
    covered = np.isfinite(blocks).sum(axis=(1, 3))
    light = np.nansum(blocks, axis=(1, 3)) / np.maximum(covered, 1)
    shades = _SHADES
    while len(data := _png(covered, light, shades)) > MOST_BYTES and shades > 4:
        shades //= 2
    return data


def _png(covered: npt.NDArray[np.int64], light: npt.NDArray[np.float32], shades: int) -> bytes:
    """Pixels with that many shades; those at the edge, of which a part is covered, have a quarter of them."""
    whole = _FINER * _FINER
    edge = max(shades // 4, 2)
    levels = np.where(covered == whole, shades, edge)
    step = np.minimum((np.clip(light, 0, 1) * levels).astype(np.int64), levels - 1)
    start = np.where(covered == whole, 1 + (whole - 1) * edge, 1 + (covered - 1) * edge)
    indices = np.where(covered == 0, 0, start + step).astype(np.uint8)
    tones = [*[(np.arange(edge) + 0.5) / edge] * (whole - 1), (np.arange(shades) + 0.5) / shades]
    colours = np.clip(np.concatenate([[0.0], *tones])[:, None] * _RANGE + _DARKEST, 0, 1) * _SKIN
    alpha = np.repeat(np.arange(whole + 1) / whole, [1, *[edge] * (whole - 1), shades])
    rows = np.pad(indices, ((0, 0), (1, 0)))  # each row begins with its filter, which is none
    side = len(indices).to_bytes(4, "big")
    chunks = (
        (b"IHDR", side + side + bytes([8, 3, 0, 0, 0])),
        (b"PLTE", _bytes(colours)),
        (b"tRNS", _bytes(alpha)),
        (b"IDAT", zlib.compress(rows.tobytes(), 6)),
        (b"IEND", b""),
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        len(content).to_bytes(4, "big") + kind + content + zlib.crc32(kind + content).to_bytes(4, "big")
        for kind, content in chunks
    )


def _bytes(shares: npt.NDArray[np.float64]) -> bytes:
    return np.round(shares * 255).astype(np.uint8).tobytes()
