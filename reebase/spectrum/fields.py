"""Scalar fields on the vertices of a mesh, by name: what the Reeb graph is taken of.

A name is ``field`` or ``field:argument``. Everything downstream is even in the field, so its sign is free.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from reebase.errors import ParameterError, unknown_name
from reebase.mesh.geodesics import farthest_points
from reebase.mesh.geometry import face_areas
from reebase.mesh.mesh import Mesh
from reebase.spectrum.eigen import Spectrum
from reebase.spectrum.signatures import heat_kernel_signature

__all__ = ["FIELDS", "Field", "eigenpairs_needed", "field"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Field:
    """A kind of scalar field.

    values: one value a vertex, from the mesh, its spectrum (None if ``eigenpairs`` says 0) and the argument.
    eigenpairs: how many eigenpairs it reads, by its argument.
    argument: the argument when the name has none; None when there is no argument to give.
    fewer: whether fewer eigenpairs will do where the mesh has no more.
    """

    values: Callable[[Mesh, Spectrum | None, str | None], Array]
    eigenpairs: Callable[[str | None], int]
    argument: str | None = None
    fewer: bool = False


def field(name: str, mesh: Mesh, spectrum: Spectrum | None = None) -> Array:
    """The named scalar field at the vertices, float64, (m,).

    ``fiedler``: phi_2, the first eigenfunction that is not constant (4.13).
    ``eigenfunction:k``: phi_k, k >= 1; phi_1 is constant.
    ``height``, ``height:x``, ``height:y``, ``height:z``: a coordinate, z unless named.
    ``auto_diffusion``, ``auto_diffusion:t``: the logarithm of the heat left after time t, in units of the area, of what
    was put at the point: high at the tips of limbs (Gebal, Baerentzen, Aanaes, Larsen, "Shape Analysis Using the Auto
    Diffusion Function", SGP 2009); t from 0.001 to 10, 0.03 unless named.
    ``geodesic_integral``: the mean geodesic distance to all points of the surface, less its least and over its
    greatest value, so in [0, 1): least in the middle (Hilaga, Shinagawa, Kohmura, Kunii, "Topology Matching for Fully
    Automatic Similarity Estimation of 3D Shapes", SIGGRAPH 2001), by 64 points spread evenly.

    spectrum: needed for all but ``height`` and ``geodesic_integral``, with at least ``eigenpairs_needed(name)`` pairs.
    Raises UnknownName, ParameterError for a bad argument or too few eigenpairs.
    """
    kind, argument = _parse(name)
    needed = min(kind.eigenpairs(argument), len(mesh.vertices) if kind.fewer else MAX_INDEX)
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


def _time(argument: str | None) -> float:
    low, high = TIMES
    try:
        time = float(argument or "")
    except ValueError:
        time = np.nan
    if not low <= time <= high:
        raise ParameterError(
            f"'auto_diffusion:t' needs a time over the area from {low} to {high}; found {argument!r}.",
            parameter="field", found=argument, minimum=low, maximum=high,
        )  # fmt: skip
    return time


def _heat_pairs(argument: str | None) -> int:
    _time(argument)
    return HEAT_PAIRS


def _auto_diffusion(mesh: Mesh, spectrum: Spectrum | None, argument: str | None) -> Array:
    assert spectrum is not None  # noqa: S101 - `field` has checked it
    return np.asarray(np.log(heat_kernel_signature(spectrum, _time(argument))[:, 0]))


def _geodesic_integral(mesh: Mesh, spectrum: Spectrum | None, argument: str | None) -> Array:
    base = farthest_points(mesh, BASE_POINTS)
    share = np.bincount(mesh.faces.ravel(), np.repeat(face_areas(mesh), 3), len(mesh.vertices))
    cells = np.bincount(base.nearest, share, len(base.vertices))
    integral = cells @ base.distances
    return np.asarray((integral - integral.min()) / integral.max())


TIMES = (0.001, 10.0)
"""Times of the auto diffusion field: sooner the eigenpairs say nothing, later it is constant."""

HEAT_PAIRS = 36
"""Eigenpairs that the auto diffusion field reads: by Weyl's law 1e-6 is left of the next after 0.03 of the area."""

BASE_POINTS = 64
"""Points from which distances are integrated."""

MAX_INDEX = 1000
"""Eigenfunctions beyond this are refused: no mesh here has a use for them, and a typing error costs hours."""

FIELDS: dict[str, Field] = {
    "fiedler": Field(_fiedler, lambda argument: 2),
    "eigenfunction": Field(_eigenfunction, _index, "2"),
    "height": Field(_height, lambda argument: 0, "z"),
    "auto_diffusion": Field(_auto_diffusion, _heat_pairs, "0.03", fewer=True),
    "geodesic_integral": Field(_geodesic_integral, lambda argument: 0),
}
"""Every field by the first part of its name."""
