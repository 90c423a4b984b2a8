"""The one path: bytes -> Mesh -> cleaned -> denoised -> operator -> phi_2 -> Reeb graph -> endpoint features.

Every caller walks it: the worker, the evaluation of the synthetic set, the command line and a notebook.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import numpy.typing as npt

from reebase.denoise import METHODS, denoise
from reebase.errors import ComputationError, FormatError, LimitError, ParameterError, unknown_name
from reebase.matching.features import AREAS, endpoint_features
from reebase.mesh.clean import clean
from reebase.mesh.health import Health
from reebase.mesh.mesh import Mesh
from reebase.mesh.parts import Parts, links, parts
from reebase.mesh.read import Limits, read
from reebase.mesh.topology import compacted
from reebase.skeleton import LEVELS, MAX_BANDS, ROOTS, SALIENCIES, Skeleton, prune, reeb_graph, rooted
from reebase.spectrum import KINDS as OPERATORS
from reebase.spectrum import Operator, Spectrum, eigenpairs, eigenpairs_needed, linked
from reebase.spectrum import field as scalar_field
from reebase.spectrum import operator as laplacian

__all__ = [
    "PIPELINE_VERSION", "PROFILES", "STAGES", "Description", "Profile", "describe", "profile_named", "skeleton",
    "skeletons_of_parts",
]  # fmt: skip

PIPELINE_VERSION = 5
"""Raised whenever the same mesh and profile would give other numbers, or more is kept of a shape; nothing is compared
across versions."""

STAGES = ("read", "clean", "denoise", "operator", "eigenpairs", "skeleton", "features")
"""The stages in order; progress names them."""

COMPONENTS = ("joined", "largest")
"""What the skeleton of a surface in several parts is."""

LEAST_PART = 1e-9
"""Parts with less than this share of the area are left out."""

MOST_PARTS = 20_000
"""Parts that are joined, the largest; others are left out, and the report says so."""

Progress = Callable[[str, float], None]
"""Called with the stage that begins and the fraction of the whole that is done."""


@dataclass(frozen=True)
class Profile:
    """The parameters of the pipeline; two descriptions are comparable when their ``key`` is the same.

    denoise: name of a filter, or "none". iterations: of that filter, at least 1.
    field: name of the scalar field. bands: number of bands of the Reeb graph, 2 to 1024. levels: "area" for bands of
    equal area, "width" for bands of equal width in the field, as in the thesis.
    saliency: "area" or "length"; threshold: branches with less than this share are pruned, 0 to 0.99.
    area: "band" or "ring", the reading of the relative node area (METHOD §5).
    operator: "auto", "cotangent" or "tufted", what the stiffness is built from.
    components: "joined", of a surface in several parts the skeletons of all, joined where they are nearest, or
    "largest", that of the largest part by area alone.
    root: "median", the node with the shortest mean way to the whole surface, or "centroid", as in the thesis.
    """

    denoise: str = "finite_volume"
    iterations: int = 1
    field: str = "fiedler"
    bands: int = 128
    levels: str = "area"
    saliency: str = "area"
    threshold: float = 0.01
    area: str = "band"
    operator: str = "auto"
    components: str = "joined"
    root: str = "median"

    def __post_init__(self) -> None:
        """Refuse what no stage could use. Raises UnknownName or ParameterError."""
        known: dict[str, tuple[str, Collection[str]]] = {
            "denoising filter": (self.denoise, ("none", *METHODS)),
            "levels": (self.levels, LEVELS),
            "saliency": (self.saliency, SALIENCIES),
            "area": (self.area, AREAS),
            "operator": (self.operator, OPERATORS),
            "components": (self.components, COMPONENTS),
            "root": (self.root, ROOTS),
        }
        for kind, (name, names) in known.items():
            if name not in names:
                raise unknown_name(kind, name, names)
        eigenpairs_needed(self.field)
        for parameter, low, high in (("iterations", 1, 1000), ("bands", 2, MAX_BANDS), ("threshold", 0.0, 0.99)):
            value = getattr(self, parameter)
            types, kind = ((int,), "whole number") if type(low) is int else ((int, float), "number")
            if type(value) not in types or not low <= value <= high:
                raise ParameterError(
                    f"{parameter} must be a {kind} between {low} and {high}; found {value!r}.",
                    parameter=parameter, found=repr(value), minimum=low, maximum=high,
                )  # fmt: skip
        object.__setattr__(self, "threshold", float(self.threshold))  # 0 and 0.0 have the same key

    def to_json(self) -> dict[str, Any]:
        """The parameters by name, JSON-serialisable: ``Profile(**record)`` is the inverse."""
        return dataclasses.asdict(self)

    @property
    def key(self) -> str:
        """Hash of the pipeline's version and these parameters, 16 hexadecimal digits."""
        canonical = json.dumps([PIPELINE_VERSION, self.to_json()], sort_keys=True)
        return hashlib.sha256(canonical.encode()).hexdigest()[:16]


PROFILES = {
    "default": Profile(),
    "thesis": Profile(bands=64, levels="width", components="largest", root="centroid"),
}
"""Profiles by name. "thesis": Kacem's reading of each step, one iteration of the finite-volume filter
(3.5), 64 bands of equal width in phi_2, the largest component, the root nearest the area centroid (Figure 4.12)."""


def profile_named(name: str) -> Profile:
    """One of PROFILES. Raises UnknownName."""
    if name not in PROFILES:
        raise unknown_name("profile", name, PROFILES)
    return PROFILES[name]


@dataclass(frozen=True, eq=False)
class Description:
    """Everything that the pipeline learns about one mesh.

    cleaned, denoised: meshes with the same faces; health: the report with the flags of all stages.
    eigenvalues: the first three of the operator at unit area, (3,), lambda_1 = 0.
    field: the scalar field at each vertex of ``denoised``, (m,), NaN off the parts that the skeleton is of.
    skeleton: pruned; features: omega of each endpoint in the order of ``skeleton.endpoints``, (k, 3).
    seconds: stage -> wall time.
    """

    cleaned: Mesh
    denoised: Mesh
    health: Health
    eigenvalues: npt.NDArray[np.float64]
    field: npt.NDArray[np.float64]
    skeleton: Skeleton
    features: npt.NDArray[np.float64]
    seconds: dict[str, float]
    profile: Profile

    def part_skeletons(self) -> list[Skeleton]:
        """Of a shape in several parts the skeleton of each as if it were alone (``skeletons_of_parts``)."""
        if "several_components" not in self.health.flags:
            return []
        profile = self.profile
        return skeletons_of_parts(
            self.denoised, field=profile.field, bands=profile.bands, levels=profile.levels,
            threshold=profile.threshold, saliency=profile.saliency, operator=profile.operator, root=profile.root,
        )  # fmt: skip

    def save(self, file: BinaryIO) -> None:
        """Write the description as one ``.npz`` archive of plain arrays and JSON; nothing is pickled."""
        record = {
            "version": PIPELINE_VERSION,
            "health": self.health.to_json(),
            "seconds": self.seconds,
            "profile": self.profile.to_json(),
            "root": self.skeleton.root,
        }
        skeleton = {f"skeleton_{name}": getattr(self.skeleton, name) for name in _SKELETON_ARRAYS}
        np.savez(
            file,
            record=np.frombuffer(json.dumps(record).encode(), dtype=np.uint8),
            cleaned=self.cleaned.vertices,
            denoised=self.denoised.vertices,
            faces=self.cleaned.faces,
            eigenvalues=self.eigenvalues,
            field=self.field,
            features=self.features,
            **skeleton,
        )

    @classmethod
    def load(cls, file: BinaryIO) -> Description:
        """Read what ``save`` wrote. Raises FormatError for an archive of another pipeline version."""
        with np.load(file, allow_pickle=False) as archive:
            record = json.loads(archive["record"].tobytes())
            if record["version"] != PIPELINE_VERSION:
                raise FormatError(
                    f"The description was written by pipeline version {record['version']}; "
                    f"this is version {PIPELINE_VERSION}. Describe the mesh again."
                )
            faces = archive["faces"]
            arrays = {name: archive[f"skeleton_{name}"] for name in _SKELETON_ARRAYS}
            return cls(
                cleaned=Mesh(archive["cleaned"], faces),
                denoised=Mesh(archive["denoised"], faces),
                health=Health.from_json(record["health"]),
                eigenvalues=archive["eigenvalues"],
                field=archive["field"],
                skeleton=Skeleton(root=record["root"], **arrays),
                features=archive["features"],
                seconds=record["seconds"],
                profile=Profile(**record["profile"]),
            )


_SKELETON_ARRAYS = ("positions", "areas", "ring_areas", "bands", "edges", "lengths", "endpoints", "joins")


class _Clock:
    """Names the stages to the listener as they begin, and keeps the wall time of each."""

    def __init__(self, progress: Progress | None) -> None:
        self.progress = progress
        self.seconds: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        if self.progress is not None:
            self.progress(name, STAGES.index(name) / len(STAGES))
        start = time.perf_counter()
        yield
        self.seconds[name] = time.perf_counter() - start


def describe(
    source: Mesh | bytes | str | os.PathLike[str],
    profile: Profile | str | None = None,
    *,
    format: str | None = None,
    limits: Limits | None = None,
    progress: Progress | None = None,
) -> Description:
    """Walk one mesh through all stages.

    source: a mesh, or what ``reebase.read`` takes (a path or a file's bytes, with ``format`` and ``limits``).
    profile: the parameters or a name of PROFILES, by default the pipeline's own.
    progress: called with (stage, fraction) as each stage begins.
    Raises OSError, FormatError, MeshError, LimitError, ParameterError, ComputationError or MissingPackage. A shape
    for which the method is not defined (several components, a boundary, near-equal eigenvalues, no endpoint) is
    described all the same, with a flag in its health report.
    """
    profile = profile_named(profile) if isinstance(profile, str) else profile or Profile()
    clock = _Clock(progress)
    with clock.stage("read"):
        mesh = source if isinstance(source, Mesh) else read(source, format, limits=limits or Limits())
    with clock.stage("clean"):
        cleaned, health = clean(mesh)
    with clock.stage("denoise"):
        denoised = cleaned
        if profile.denoise != "none":
            denoised = denoise(cleaned, profile.denoise, profile.iterations)
        # A filter can flatten a sliver that cleaning let pass: parts are those of what is left.
        every = parts(denoised)
        found = _described(every, profile.components, profile.field)
    try:
        made = _skeletonised(found, cleaned, profile, clock)
    except (ComputationError, LimitError, MemoryError):
        if len(found) == 1:
            raise
        # Thousands of parts thrown together touch everywhere: joined they are no surface, and each of them still is.
        found = every.largest(1)
        made = _skeletonised(found, cleaned, profile, clock)
    body_operator, spectrum, values, kept, skeleton = made
    with clock.stage("features"):
        features = endpoint_features(skeleton, profile.area)
    field = np.full(len(denoised.vertices), np.nan)
    field[kept] = values
    late = _late_flags(body_operator, spectrum, skeleton, features)
    return Description(
        cleaned=cleaned,
        denoised=denoised,
        health=health.flagged(*_parts_flags(every, found), *late),
        eigenvalues=spectrum.eigenvalues[:3],
        field=field,
        skeleton=skeleton,
        features=features,
        seconds=clock.seconds,
        profile=profile,
    )


class _Skeletonised(NamedTuple):
    """Of the parts that are described: operator, eigenpairs, the field, which vertices have it, and the skeleton."""

    operator: Operator
    spectrum: Spectrum
    values: npt.NDArray[np.float64]
    kept: npt.NDArray[np.int32]
    skeleton: Skeleton


def _skeletonised(found: Parts, cleaned: Mesh, profile: Profile, clock: _Clock) -> _Skeletonised:
    """From the denoised parts to their skeleton. Raises as ``describe``, and MemoryError."""
    body, kept = compacted(found.mesh.vertices, found.mesh.faces)
    with clock.stage("operator"):
        # Whether parts touch is a fact of the file: a filter draws coarse ones apart.
        before = dataclasses.replace(found, mesh=Mesh(cleaned.vertices, found.mesh.faces))
        gaps = links(before) if len(found) > 1 else None
        used = laplacian(body, profile.operator)
        body_operator = linked(used, body, gaps) if gaps else used
    with clock.stage("eigenpairs"):
        spectrum = eigenpairs(body_operator, _pairs(profile.field, body))
        values = scalar_field(profile.field, body, spectrum)
    with clock.stage("skeleton"):
        graph = reeb_graph(body, values, profile.bands, profile.levels, gaps)
        skeleton = rooted(prune(graph, profile.threshold, profile.saliency), profile.root)
    return _Skeletonised(body_operator, spectrum, values, kept, skeleton)


def _described(every: Parts, components: str, field: str) -> Parts:
    """The parts that the skeleton is of."""
    # Distances along the surface know no way from part to part.
    if components == "largest" or field.startswith("geodesic_integral"):
        return every.largest(1)
    with_area = int((every.areas > LEAST_PART * every.areas.sum()).sum())
    return every.largest(min(max(with_area, 1), MOST_PARTS))


def _parts_flags(every: Parts, found: Parts) -> list[str]:
    """What became of the parts."""
    noticed = {
        "joined_components": len(found) > 1,
        "largest_component_only": len(found) == 1 < len(every),
        "small_components_left_out": 1 < len(found) < len(every),
    }
    return [flag for flag, is_so in noticed.items() if is_so]


def _late_flags(
    used: Operator, spectrum: Spectrum, skeleton: Skeleton, features: npt.NDArray[np.float64]
) -> list[str]:
    """What the stages after cleaning noticed."""
    noticed = {
        "near_degenerate_eigenvalues": spectrum.near_degenerate,
        "single_node": len(skeleton.positions) == 1,
        "no_endpoints": len(skeleton.endpoints) == 0,
        "no_path_lengths": len(skeleton.endpoints) > 0 and len(features) == 0,
        "tufted_operator": used.kind == "tufted",
    }
    return [flag for flag, is_so in noticed.items() if is_so]


def skeleton(
    mesh: Mesh,
    *,
    field: str = "fiedler",
    bands: int = 128,
    levels: str = "area",
    threshold: float = 0.01,
    saliency: str = "area",
    operator: str = "auto",
    components: str = "joined",
    root: str = "median",
) -> Skeleton:
    """The pruned spectral Reeb graph of a mesh as it is (METHOD §3, §4): neither cleaned nor denoised.

    components: of a surface in several parts "joined" takes all, joined where they are nearest, and "largest" the
    largest by area. ``skeletons_of_parts`` gives that of each. What was read from a file needs ``clean`` first, as the
    triangles of an STL share no vertices.
    Raises MeshError for a mesh without area, ParameterError for an unknown field, levels, saliency, components or
    root, or bands or a threshold out of range; ComputationError when no eigenpairs are found; MissingPackage for a
    non-manifold mesh without robust-laplacian.
    """
    if components not in COMPONENTS:
        raise unknown_name("components", components, COMPONENTS)
    found = _described(parts(mesh), components, field)
    body, _ = compacted(mesh.vertices, found.mesh.faces)
    gaps = links(found) if len(found) > 1 else None
    used = laplacian(body, operator)
    values = scalar_field(field, body, eigenpairs(linked(used, body, gaps) if gaps else used, _pairs(field, body)))
    return rooted(prune(reeb_graph(body, values, bands, levels, gaps), threshold, saliency), root)


def skeletons_of_parts(
    mesh: Mesh,
    *,
    field: str = "fiedler",
    bands: int = 128,
    levels: str = "area",
    threshold: float = 0.01,
    saliency: str = "area",
    operator: str = "auto",
    root: str = "median",
    most: int = 100,
) -> list[Skeleton]:
    """The skeleton of each part as if it were alone, by decreasing area, at most ``most`` of them.

    Parts without area have none. Parameters and errors as of ``skeleton``.
    """
    found = _described(parts(mesh), "joined", "fiedler")
    return [
        skeleton(
            found.part(number)[0], field=field, bands=bands, levels=levels, threshold=threshold, saliency=saliency,
            operator=operator, root=root,
        )
        for number in range(min(len(found), most))
    ]  # fmt: skip


def _pairs(field: str, body: Mesh) -> int:
    """How many eigenpairs to compute: what the field reads and the report needs, as far as there are vertices."""
    return min(max(3, eigenpairs_needed(field)), max(3, len(body.vertices)))
