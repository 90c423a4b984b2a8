"""What is kept of many shapes, as one file on its way into the child."""

from __future__ import annotations

import io
import itertools
from collections.abc import Mapping, Sequence
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

__all__ = ["pack", "unpack"]

_OFFSETS = "@offsets"


def pack(kept: Mapping[str, Sequence[npt.NDArray[Any]]]) -> bytes:
    """For each part its rows, (total, w), and where those of each shape begin, (n + 1,), as npz."""
    file = io.BytesIO()
    arrays: dict[str, npt.NDArray[Any]] = {}
    for part, shapes in kept.items():
        arrays[part] = np.concatenate(shapes) if shapes else np.empty((0, 1))
        arrays[part + _OFFSETS] = np.cumsum([0, *map(len, shapes)])
    np.savez(file, allow_pickle=False, **arrays)
    return file.getvalue()


def unpack(file: BinaryIO) -> dict[str, list[npt.NDArray[Any]]]:
    """The inverse of ``pack``."""
    with np.load(file, allow_pickle=False) as arrays:
        kept = {}
        for part in (name for name in arrays.files if not name.endswith(_OFFSETS)):
            rows, offsets = arrays[part], arrays[part + _OFFSETS]
            kept[part] = [rows[start:end] for start, end in itertools.pairwise(offsets)]
        return kept
