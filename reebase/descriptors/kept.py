"""What descriptors keep of one shape, as it is stored: in single precision, with the places of endpoints."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from reebase.descriptors.registry import descriptor_named
from reebase.descriptors.surface import Surface
from reebase.errors import ComputationError, ReebaseError

__all__ = ["Kept", "keep", "load", "save"]

_PLACES = "@places"


class Kept(NamedTuple):
    """values: float32, (k, w); a vector is one row. places: where the rows lie, float32, (k, 3), for endpoints."""

    values: npt.NDArray[np.float32]
    places: npt.NDArray[np.float32] | None = None


def keep(surface: Surface, names: Iterable[str]) -> tuple[dict[str, Kept], dict[str, ReebaseError]]:
    """What these descriptors keep of a surface, and why some of them could not describe it.

    Raises UnknownName.
    """
    kept: dict[str, Kept] = {}
    refused: dict[str, ReebaseError] = {}
    for descriptor in [descriptor_named(name) for name in names]:
        try:
            values = np.atleast_2d(np.asarray(descriptor.describe(surface), dtype=np.float32))
            # What could not be compared must not be stored: one such row would stop every query of the collection.
            if not np.isfinite(values).all():
                raise ComputationError(f"{descriptor.name} has values that are not finite.")
            descriptor.comparison.rows(values, descriptor.name)
            places = None if descriptor.place is None else np.asarray(descriptor.place(surface), dtype=np.float32)
        except ReebaseError as refusal:
            refused[descriptor.name] = refusal
        except MemoryError:
            # A mesh that is too large for this one is still described by all that is leaner.
            refused[descriptor.name] = ComputationError("There was not enough memory for a mesh of this size.")
        else:
            kept[descriptor.name] = Kept(values, places)
    return kept, refused


def save(file: BinaryIO, kept: Mapping[str, Kept]) -> None:
    """As one ``.npz`` archive of plain arrays."""
    arrays = {name: one.values for name, one in kept.items()}
    arrays |= {name + _PLACES: one.places for name, one in kept.items() if one.places is not None}
    np.savez(file, allow_pickle=False, **arrays)


def load(file: BinaryIO) -> dict[str, Kept]:
    """What ``save`` wrote."""
    with np.load(file, allow_pickle=False) as arrays:
        names = [name for name in arrays.files if not name.endswith(_PLACES)]
        return {name: Kept(arrays[name], arrays.get(name + _PLACES)) for name in names}
