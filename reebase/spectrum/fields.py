"""Scalar fields on the vertices of a mesh, by name: what the Reeb graph is taken of.

A name is ``field`` or ``field:argument``. Everything downstream is even in the field, so its sign is free.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError, unknown_name
from reebase.mesh.mesh import Mesh
from reebase.spectrum.eigen import Spectrum

__all__ = ["FIELDS", "Field", "eigenpairs_needed", "field"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Field:
    """A kind of scalar field.

    values: one value a vertex, from the mesh, its spectrum (None if ``eigenpairs`` says 0) and the argument.
    eigenpairs: how many eigenpairs it reads, by its argument.
    argument: the argument when the name has none; None when there is no argument to give.
    """

    values: Callable[[Mesh, Spectrum | None, str | None], Array]
    eigenpairs: Callable[[str | None], int]
    argument: str | None = None


def field(name: str, mesh: Mesh, spectrum: Spectrum | None = None) -> Array:
    """The named scalar field at the vertices, float64, (m,).

    ``fiedler``: phi_2, the first eigenfunction that is not constant (4.13).
    ``eigenfunction:k``: phi_k, k >= 1; phi_1 is constant.
    ``height``, ``height:x``, ``height:y``, ``height:z``: a coordinate, z unless named.

    spectrum: needed for the first two, with at least ``eigenpairs_needed(name)`` pairs.
    Raises UnknownName, ParameterError for a bad argument or too few eigenpairs.
    """
    kind, argument = _parse(name)
    needed = kind.eigenpairs(argument)
    if needed and (spectrum is None or len(spectrum.eigenvalues) < needed):
        found = 0 if spectrum is None else len(spectrum.eigenvalues)
        raise ParameterError(
            f"The field {name!r} needs {needed} eigenpairs; {found} were given.",
            parameter="spectrum", needed=needed, found=found,
        )  # fmt: skip
    values = kind.values(mesh, spectrum, argument)
    if len(values) != len(mesh.vertices):
        raise ParameterError(
            f"The spectrum is of {len(values)} vertices and the mesh has {len(mesh.vertices)}.",
            parameter="spectrum",
        )
    return np.ascontiguousarray(values)


def eigenpairs_needed(name: str) -> int:
    """How many eigenpairs the named field reads; 0 when it needs none. Raises as ``field`` does."""
    kind, argument = _parse(name)
    return kind.eigenpairs(argument)


def _parse(name: str) -> tuple[Field, str | None]:
    key, colon, argument = name.partition(":")
    if key not in FIELDS:
        raise unknown_name("field", name, FIELDS)
    kind = FIELDS[key]
    if colon and kind.argument is None:
        raise ParameterError(
            f"The field {key!r} takes no argument; found {name!r}.", parameter="field", found=name
        )
    return kind, argument if colon else kind.argument


def _fiedler(mesh: Mesh, spectrum: Spectrum | None, argument: str | None) -> Array:
    assert spectrum is not None  # noqa: S101 - `field` has checked it
    return spectrum.fiedler


def _index(argument: str | None) -> int:
    digits = argument if argument and argument.isascii() and argument.isdigit() else "0"
    if not 1 <= int(digits[:9]) <= MAX_INDEX:
        raise ParameterError(
            f"'eigenfunction:k' needs a whole number k from 1 to {MAX_INDEX}; found {argument!r}.",
            parameter="field", found=argument,
        )  # fmt: skip
    return int(digits)


def _eigenfunction(mesh: Mesh, spectrum: Spectrum | None, argument: str | None) -> Array:
    assert spectrum is not None  # noqa: S101 - `field` has checked it
    column: Array = spectrum.eigenvectors[:, _index(argument) - 1]
    return column


def _height(mesh: Mesh, spectrum: Spectrum | None, argument: str | None) -> Array:
    axes = ("x", "y", "z")
    if argument not in axes:
        raise unknown_name("axis", str(argument), axes)
    return np.asarray(mesh.vertices[:, axes.index(argument)])


MAX_INDEX = 1000
"""Eigenfunctions beyond this are refused: no mesh here has a use for them, and a typing error costs hours."""

FIELDS: dict[str, Field] = {
    "fiedler": Field(_fiedler, lambda argument: 2),
    "eigenfunction": Field(_eigenfunction, _index, "2"),
    "height": Field(_height, lambda argument: 0, "z"),
}
"""Every field by the first part of its name."""
