"""Near-duplicates in a collection: candidates by their signatures, then evidence on the meshes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from reebase.duplicates.alignment import Surface
from reebase.duplicates.evidence import compared
from reebase.duplicates.findings import Finding, finding_of, same_bytes
from reebase.duplicates.signature import NUMBERS, PART, signature
from reebase.errors import ParameterError
from reebase.mesh.geometry import face_areas
from reebase.mesh.mesh import Mesh
from reebase.mesh.topology import edges, largest_component

__all__ = ["Candidate", "Shape", "candidates", "comparisons", "find_duplicates"]

Array = npt.NDArray[np.float64]
Progress = Callable[[float], None]

REACH = 0.05
"""Root mean square difference of signatures up to which two shapes are compared."""

MOST = 20
"""Candidates that a shape has at most, the nearest first: one thing in a thousand poses has no end of them."""

HELD = 64
"""Surfaces that are kept prepared; of those compared one after the other most have one in common."""

COPY_AREA = 0.02
MOST_COPIES = 100
"""Share by which the areas of copies in one file may differ, and how many are counted: a plate of screws has no end."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape among which duplicates are sought.

    name: once in a collection. load: gives the cleaned mesh, when it is needed. signature: of that mesh.
    sha256: of its file, where there is one.
    """

    name: str
    load: Callable[[], Mesh]
    signature: Array
    sha256: str | None = None

    @classmethod
    def of(cls, name: str, mesh: Mesh, data: bytes | None = None) -> Shape:
        """Of a cleaned mesh in memory, and the bytes of its file where there is one. Raises NoFaces."""
        digest = None if data is None else hashlib.sha256(data).hexdigest()
        return cls(name, lambda: mesh, signature(mesh), digest)


@dataclass(frozen=True, order=True)
class Candidate:
    """Two shapes, by index, that may be one. distance: of their signatures. parts: whether of each the largest
    component is meant and not the whole. A shape with itself: whether it holds its largest component several times.
    """

    distance: float
    first: int
    second: int
    parts: tuple[bool, bool] = field(default=(False, False))


def find_duplicates(
    shapes: Sequence[Shape], *, pairs: Sequence[Candidate] | None = None, progress: Progress | None = None
) -> list[Finding]:
    """All findings, the strongest first; nothing is changed or deleted.

    Each pair is told once; of n copies there are up to n (n - 1) / 2 findings. pairs: what to compare, those of two
    shapes one after the other; ``comparisons`` of the signatures unless given. progress: called with the fraction done.
    Raises ParameterError for a signature of another length, or two shapes of one name; MeshError from ``load``.
    """
    names = [shape.name for shape in shapes]
    if len(set(names)) != len(names):
        raise ParameterError("Every shape needs a name of its own.", parameter="shapes")
    prepared = lru_cache(HELD)(lambda index, part: _surface(shapes[index].load(), part))
    if pairs is None:
        pairs = comparisons(np.array([shape.signature for shape in shapes]).reshape(len(shapes), -1))
    findings: dict[tuple[int, int], Finding] = {}
    for done, pair in enumerate(pairs):
        _tell(progress, done / len(pairs))
        if (pair.first, pair.second) not in findings:
            own = pair.first == pair.second
            one = _copies_within(shapes[pair.first]) if own else _verified(shapes, pair, prepared)
            if one is not None:
                findings[pair.first, pair.second] = one
    _tell(progress, 1.0)
    return sorted(findings.values(), key=_strength)


def comparisons(signatures: Array) -> list[Candidate]:
    """All that is to be compared: the candidates, and each shape of several components with itself.

    Those of two shapes one after the other, the nearest first. signatures: (n, NUMBERS). Raises ParameterError.
    """
    near = [*candidates(signatures)]
    within = [Candidate(0.0, int(at), int(at), (True, True)) for at in _several(signatures)]
    return sorted([*within, *near], key=lambda one: (one.first, one.second, one.distance))


def candidates(signatures: Array, reach: float = REACH, most: int = MOST) -> Iterator[Candidate]:
    """Pairs whose signatures are near: wholes, or the largest component of one and the whole of the other; each once.

    Two assemblies that have their largest part in common are not one shape, so two components are no pair.

    signatures: (n, NUMBERS). most: how many a shape has at most. Raises ParameterError.
    """
    from scipy.spatial import cKDTree

    if not len(signatures):
        return
    if signatures.ndim != 2 or signatures.shape[1] != NUMBERS:
        raise ParameterError(
            f"Signatures must have {NUMBERS} numbers each; found an array of shape {signatures.shape}.",
            parameter="signatures",
        )
    several = _several(signatures)
    rows = np.concatenate([signatures[:, :PART], signatures[several, PART:]])
    owner = np.concatenate([np.arange(len(signatures)), several])
    distance, near = cKDTree(rows).query(rows, k=range(1, min(most + 2, len(rows)) + 1),
                                         distance_upper_bound=reach * np.sqrt(PART))  # fmt: skip
    seen = set()
    for row, (apart, others) in enumerate(zip(np.asarray(distance), np.asarray(near), strict=True)):
        for length, other in zip(apart, others, strict=True):
            if not np.isfinite(length) or owner[row] == owner[other]:
                continue
            low, high = sorted((row, int(other)), key=lambda at: (owner[at], at))
            parts = (low >= len(signatures), high >= len(signatures))
            if (low, high) not in seen and parts != (True, True):
                seen.add((low, high))
                yield Candidate(float(length / np.sqrt(PART)), int(owner[low]), int(owner[high]), parts)


def _several(signatures: Array) -> npt.NDArray[np.int64]:
    """Which shapes have several components."""
    return np.flatnonzero((signatures[:, :PART] != signatures[:, PART:]).any(axis=1))


def _verified(
    shapes: Sequence[Shape], pair: Candidate, prepared: Callable[[int, bool], Surface]
) -> Finding | None:
    first, second = shapes[pair.first], shapes[pair.second]
    if first.sha256 is not None and first.sha256 == second.sha256:
        return same_bytes(first.name, second.name)
    one, other = prepared(pair.first, pair.parts[0]), prepared(pair.second, pair.parts[1])
    evidence = compared(one, other)
    if evidence is None:
        return None
    if pair.parts[0] == pair.parts[1]:
        return finding_of(first.name, second.name, evidence, other.size)
    if pair.parts[1]:  # it is the second that may hold the first several times
        first, second, one, other = second, first, other, one
        evidence = compared(one, other)
        if evidence is None:
            return None
    alike, more = _alike(first.load(), one)
    if not alike:
        return None
    return finding_of(first.name, second.name, evidence, other.size, 1 + len(alike), more=more)


def _copies_within(shape: Shape) -> Finding | None:
    """The finding that one file holds its largest component more than once."""
    mesh = shape.load()
    body = Surface(largest_component(mesh)[0])
    alike, more = _alike(mesh, body)
    evidence = compared(alike[0], body) if alike else None
    if evidence is None:
        return None
    return finding_of(shape.name, shape.name, evidence, body.size, 1 + len(alike), more=more)


def _alike(mesh: Mesh, body: Surface) -> tuple[list[Surface], bool]:
    """The components of the mesh that are copies of its largest, which is not among them, and whether more may be.

    MOST_COPIES - 1 are looked at, so that a file of ten thousand screws ends.
    """
    own = signature(body.mesh)[:PART]
    area = float(face_areas(body.mesh).sum())
    count, labels = edges(mesh.faces).components
    areas = np.bincount(labels, weights=face_areas(mesh), minlength=count)
    near = np.flatnonzero(np.abs(areas / area - 1) <= COPY_AREA)
    near = near[near != areas.argmax()]
    found = []
    for part in near[: MOST_COPIES - 1]:
        used, corners = np.unique(mesh.faces[labels == part], return_inverse=True)
        other = Mesh(mesh.vertices[used], corners.reshape(-1, 3).astype(np.int32))
        if np.sqrt(((signature(other)[:PART] - own) ** 2).mean()) > REACH:
            continue
        surface = Surface(other)
        if compared(surface, body) is not None:
            found.append(surface)
    return found, len(near) >= MOST_COPIES


def _surface(mesh: Mesh, part: bool) -> Surface:
    return Surface(largest_component(mesh)[0] if part else mesh)


def _strength(finding: Finding) -> tuple[float, str, str]:
    return (-1.0 if finding.evidence is None else finding.evidence.farthest, finding.first, finding.second)


def _tell(progress: Progress | None, fraction: float) -> None:
    if progress is not None:
        progress(fraction)
