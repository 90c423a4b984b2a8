"""Ten classes of articulated figures, posed at random: a labelled set made from a seed.

The classes carry the names of the McGill articulated benchmark. Each shape is a skeleton of bones in a
plausible pose, fleshed out as an implicit surface and meshed as one closed, oriented manifold. Every
shape has random streams of its own, keyed by (class, index, concern): none depends on another shape or on an
option that is off.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from reebase.errors import ComputationError, ParameterError, unknown_name
from reebase.evaluation.synthetic import disturb
from reebase.evaluation.synthetic.figures import FIGURES
from reebase.evaluation.synthetic.implicit import Field, Figure, is_clear
from reebase.evaluation.synthetic.surface import extract, genus, relax, triangulate
from reebase.mesh.mesh import Mesh

__all__ = ["CLASSES", "LabelledMesh", "synthetic_set", "synthetic_shape"]

CLASSES: tuple[str, ...] = tuple(FIGURES)
"""The labels, in the order in which the set is made."""

_ATTEMPTS = 256
"""Poses that are drawn before giving up; a pose in which limbs touch is drawn again."""

_RELAXATIONS = 4


class _Concern(IntEnum):
    """The streams of a shape; their numbers are part of what a seed means."""

    POSE = 0
    GRID = 1
    NOISE = 2
    ROTATION = 3
    SCALE = 4
    ORDER = 5


@dataclass(frozen=True, eq=False)
class LabelledMesh:
    """A mesh of known class. name: like ``ants-00``, unique in its set. label: one of ``CLASSES``."""

    name: str
    label: str
    mesh: Mesh


def synthetic_set(
    per_class: int = 25, seed: int = 0, *, noise: float = 0.0, rotation: bool = True, scale: bool = True,
    tessellation: bool = True, vertex_order: bool = True, vertices: int = 3000,
    classes: Sequence[str] | None = None,
) -> Iterator[LabelledMesh]:  # fmt: skip
    """The shapes class by class: closed connected manifolds of genus 0, but spectacles of genus 2.

    per_class: shapes of each class, at least 1. seed: at least 0; the same seed gives the same set.
    noise: displacement along the normals in mean edge lengths (METHOD §1), 0 for none.
    rotation, scale: a random rotation, and a factor of 0.1 to 10. tessellation: a sampling grid of its own
    orientation, anisotropy and resolution for each shape. vertex_order: vertices, faces and first corners
    shuffled. vertices: about how many a mesh has, 1000 to 50000; thin limbs may need more.
    classes: a part of ``CLASSES``, the same shapes as in the whole.
    Raises ParameterError, UnknownName.
    """
    chosen = CLASSES if classes is None else tuple(classes)
    if per_class < 1:
        raise ParameterError(f"per_class must be at least 1; found {per_class}.", parameter="per_class")
    _check(seed, noise, vertices, chosen)
    return (
        synthetic_shape(
            label, index, seed, noise=noise, rotation=rotation, scale=scale, tessellation=tessellation,
            vertex_order=vertex_order, vertices=vertices,
        )
        for label in chosen
        for index in range(per_class)
    )  # fmt: skip


def synthetic_shape(
    label: str, index: int, seed: int = 0, *, noise: float = 0.0, rotation: bool = True, scale: bool = True,
    tessellation: bool = True, vertex_order: bool = True, vertices: int = 3000,
) -> LabelledMesh:  # fmt: skip
    """One shape of a class, as ``synthetic_set`` gives it; parameters and errors as there.

    Raises ComputationError where no pose with its limbs apart is found, which is not expected.
    """
    _check(seed, noise, vertices, (label,))
    if index < 0:
        raise ParameterError(f"index must be at least 0; found {index}.", parameter="index")

    def random(concern: _Concern, attempt: int = 0) -> np.random.Generator:
        key = (CLASSES.index(label), index, int(concern), attempt)
        return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))

    for attempt in range(_ATTEMPTS):
        figure = FIGURES[label](random(_Concern.POSE, attempt))
        grid = random(_Concern.GRID, attempt) if tessellation else None
        mesh = _meshed(figure, vertices, grid)
        if mesh is not None:
            break
    else:
        raise ComputationError(f"No pose of {label} number {index} with seed {seed} keeps its limbs apart.")
    if noise > 0:
        from reebase.denoise.noise import add_noise

        mesh = add_noise(mesh, noise, seed=int(random(_Concern.NOISE).integers(2**63)))
    if rotation:
        mesh = disturb.rotated(mesh, random(_Concern.ROTATION))
    if scale:
        mesh = disturb.scaled(mesh, random(_Concern.SCALE))
    if vertex_order:
        mesh = disturb.shuffled(mesh, random(_Concern.ORDER))
    return LabelledMesh(f"{label}-{index:02d}", label, mesh)


def _check(seed: int, noise: float, vertices: int, classes: Sequence[str]) -> None:
    if seed < 0:
        raise ParameterError(f"seed must be at least 0; found {seed}.", parameter="seed")
    if not (np.isfinite(noise) and noise >= 0):
        raise ParameterError(
            f"noise must be a finite number of at least 0; found {noise}.", parameter="noise"
        )  # fmt: skip
    if not 1000 <= vertices <= 50_000:
        raise ParameterError(f"vertices must be from 1000 to 50000; found {vertices}.", parameter="vertices")
    for label in classes:
        if label not in FIGURES:
            raise unknown_name("class", label, CLASSES)


def _meshed(figure: Figure, vertices: int, grid: np.random.Generator | None) -> Mesh | None:
    """The surface; None when limbs touch or the topology is not the figure's."""
    # A surface crosses 1.5 grid edges per square step on average, and each gives about one vertex.
    step = min(float(np.sqrt(1.35 * figure.area / vertices)), 1.15 * figure.thinnest)
    if not is_clear(figure, 1.25 * step):
        return None
    frame, stretch, shift = np.eye(3), np.ones(3), np.zeros(3)
    if grid is not None:
        frame = disturb.random_rotation(grid)
        stretch = np.exp(grid.uniform(-0.13, 0.13, size=3)) * np.exp(grid.uniform(-0.12, 0.08))
        shift = grid.uniform(0, 1, size=3)
    field = Field(figure)
    corners, quads = extract(field, *figure.box, step * stretch, frame, shift)
    if genus(len(corners), triangulate(corners, quads)) != figure.genus:
        return None
    corners = relax(field, corners, quads, _RELAXATIONS)
    return Mesh(corners, triangulate(corners, quads).astype(np.int32))
