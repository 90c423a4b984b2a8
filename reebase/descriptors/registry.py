"""The registry of descriptors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from reebase.descriptors import srg
from reebase.errors import unknown_name
from reebase.pipeline import Description
from reebase.skeleton.graph import Skeleton

__all__ = ["DESCRIPTORS", "Descriptor", "descriptor_named"]


@dataclass(frozen=True)
class Descriptor:
    """One way to describe a shape.

    describe: a description, or the skeleton in it -> what is kept, float64.
    compare: two of these and the name of a measure -> their dissimilarity, >= 0.
    """

    name: str
    summary: str
    describe: Callable[[Description | Skeleton], npt.NDArray[np.float64]]
    compare: Callable[[npt.NDArray[np.float64], npt.NDArray[np.float64], str], float]


DESCRIPTORS: Mapping[str, Descriptor] = MappingProxyType({
    "srg": Descriptor(
        "srg", "Endpoints of the spectral Reeb graph, compared by D.", srg.describe, srg.compare
    ),
})  # fmt: skip
"""name -> descriptor."""


def descriptor_named(name: str) -> Descriptor:
    """The descriptor of that name. Raises UnknownName with the names that would do."""
    if name not in DESCRIPTORS:
        raise unknown_name("descriptor", name, DESCRIPTORS)
    return DESCRIPTORS[name]
