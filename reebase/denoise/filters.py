"""``denoise``: any filter by name, iterated, with one treatment of boundaries for all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.denoise.anisotropic import ANISOTROPIC
from reebase.denoise.automatic import AUTO, Choice, applied, chosen
from reebase.denoise.bilateral import BILATERAL
from reebase.denoise.bilateral_normal import BILATERAL_NORMAL
from reebase.denoise.bilateral_normal_global import BILATERAL_NORMAL_GLOBAL
from reebase.denoise.fairing import FAIRING
from reebase.denoise.fast_effective import FAST_EFFECTIVE
from reebase.denoise.filter import Filter, FloatArray, Report, Surface, stepped
from reebase.denoise.finite_volume import FINITE_VOLUME
from reebase.denoise.graph_diffusion import GRAPH_P_LAPLACIAN, UNIFORM
from reebase.denoise.guided_normal import GUIDED_NORMAL
from reebase.denoise.kernel_diffusion import KERNEL
from reebase.denoise.l0 import L0
from reebase.denoise.laplacian import LAPLACIAN
from reebase.denoise.mean_median import ANGLE_MEDIAN, MEAN
from reebase.denoise.multiscale_anisotropic import MULTISCALE_ANISOTROPIC
from reebase.denoise.taubin import TAUBIN
from reebase.denoise.weighted_laplacian import WEIGHTED_LAPLACIAN
from reebase.errors import ParameterError, unknown_name
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import Rings, rings

__all__ = ["BOUNDARIES", "METHODS", "apply_choice", "choose", "denoise"]

Progress = Callable[[float], None]

METHODS: dict[str, Filter] = {
    entry.name: entry
    for entry in (
        LAPLACIAN, MEAN, ANGLE_MEDIAN, WEIGHTED_LAPLACIAN, BILATERAL, ANISOTROPIC, GRAPH_P_LAPLACIAN, KERNEL, UNIFORM,
        FINITE_VOLUME, MULTISCALE_ANISOTROPIC, BILATERAL_NORMAL, BILATERAL_NORMAL_GLOBAL, GUIDED_NORMAL, FAST_EFFECTIVE,
        TAUBIN, FAIRING, L0, AUTO,
    )
}  # fmt: skip
"""Every filter by name."""

BOUNDARIES = {
    "curve": "boundary vertices move along the boundary curve only",
    "fixed": "boundary vertices stay where they are",
    "free": "boundary vertices move as the filter says",
}
"""What may become of vertices on the boundary, by name."""

MOST_ITERATIONS = 1000


def denoise(
    mesh: Mesh, method: str = "finite_volume", iterations: int = 1, *, boundary: str = "curve",
    progress: Progress | None = None, **parameters: Any,
) -> Mesh:  # fmt: skip
    """The mesh with the same faces and its vertices moved by a filter.

    method: a name from METHODS. iterations: 1 to 1000. boundary: a name from BOUNDARIES; "curve" keeps of
    each displacement d its part along the boundary, (d . t) t with t the direction between the two
    neighbours on the boundary, and nothing where the boundary passes a vertex more than once. progress: called with the
    share that is done, after each iteration and during long ones. parameters:
    those of the filter, ``METHODS[method].parameters``. Topology is built once; all geometry is computed
    anew in each iteration. Isolated vertices stay untouched. Invariant to translation, rotation, scale and
    vertex order up to rounding. Raises UnknownName, ParameterError.
    """
    if method not in METHODS:
        raise unknown_name("method", method, METHODS)
    if boundary not in BOUNDARIES:
        raise unknown_name("boundary", boundary, BOUNDARIES)
    if type(iterations) is not int or not 1 <= iterations <= MOST_ITERATIONS:
        raise ParameterError(
            f"iterations must be a whole number from 1 to {MOST_ITERATIONS}; found {iterations!r}.",
            parameter="iterations", found=repr(iterations),
        )  # fmt: skip
    checked = METHODS[method].checked(parameters)

    around = rings(mesh.faces, len(mesh.vertices))
    start, scale = framed(mesh.vertices, around)
    if scale == 0:
        return mesh
    surface = bounded(Surface(start, mesh.faces, around, scale, report=Report(progress, iterations)), boundary)
    entry = METHODS[method]
    if entry.run is not None:
        positions = entry.run(surface, checked, iterations)
    else:
        positions = stepped(surface, entry.prepare(surface, checked), iterations)
    if progress is not None:
        progress(1.0)
    positions -= start
    positions *= scale
    positions += mesh.vertices
    return Mesh(positions, mesh.faces)


def choose(mesh: Mesh, *, progress: Progress | None = None) -> Choice:
    """What ``denoise(mesh, "auto")`` runs, and why; nothing for a mesh without extent."""
    around = rings(mesh.faces, len(mesh.vertices))
    start, scale = framed(mesh.vertices, around)
    return chosen(Surface(start, mesh.faces, around, scale, report=Report(progress)))


def apply_choice(
    mesh: Mesh, choice: Choice, boundary: str = "curve", *, progress: Progress | None = None
) -> Mesh:
    """What ``denoise(mesh, "auto")`` gives, for the choice that ``choose`` made. Raises UnknownName."""
    if boundary not in BOUNDARIES:
        raise unknown_name("boundary", boundary, BOUNDARIES)
    around = rings(mesh.faces, len(mesh.vertices))
    start, scale = framed(mesh.vertices, around)
    if scale == 0 or not choice.parts:
        return mesh
    surface = bounded(Surface(start, mesh.faces, around, scale, report=Report(progress)), boundary)
    moved = surface.hold(start, applied(surface, choice))
    return Mesh(mesh.vertices + scale * ((start + moved) - start), mesh.faces)


def bounded(surface: Surface, boundary: str) -> Surface:
    """The surface with what a kind of boundary allows of displacements, which are changed in place."""
    curve, along = surface.rings.boundary_curve
    if len(curve) == 0 or boundary == "free":
        return surface

    def hold(positions: FloatArray, displacements: FloatArray) -> FloatArray:
        displacements[curve] = 0.0 if boundary == "fixed" else along_curve(positions, displacements[curve], along)
        return displacements

    return replace(surface, hold=hold, held=True)


def framed(vertices: FloatArray, around: Rings) -> tuple[FloatArray, float]:
    """The vertices about one of them in mean edge lengths, isolated ones at the origin, (m, 3), and that
    length.

    There squares neither overflow nor lose digits. The length is 0 when no edge has a length.
    """
    from reebase.mesh.topology_kernels import centred, mean_distance

    isolated = around.degrees == 0
    if isolated.all():
        return vertices, 0.0
    start, extent = centred(vertices, int(isolated.argmin()), isolated)
    if extent == 0:
        return start, 0.0
    start /= extent
    length = mean_distance(start, around.neighbour_starts, around.neighbours)
    start /= length
    return start, extent * length


def along_curve(
    positions: FloatArray, displacements: FloatArray, neighbours: npt.NDArray[np.int32]
) -> FloatArray:
    """The part of each displacement, (b, 3), along the line between the two neighbours on the boundary, (b,
    2)."""
    tangents = positions[neighbours[:, 1]] - positions[neighbours[:, 0]]
    square = (tangents**2).sum(axis=1)
    share = (displacements * tangents).sum(axis=1) / np.where(square > 0, square, 1.0)
    return np.asarray(share[:, None] * tangents)
