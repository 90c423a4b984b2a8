"""What runs inside the sandbox's child: bytes in, files of arrays out, no database and no blobs.

Every computation takes its arguments (JSON), the input file, the output files by name and a progress
callback, and returns a small JSON answer. Whatever it writes can be read back without unpickling.
"""

from __future__ import annotations

import dataclasses
import io
import json
import socket
import time
import zipfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from reebase.errors import ComputationError, MeshError, MissingPackage, ReebaseError
from reebase.mesh.mesh import Mesh

if TYPE_CHECKING:
    from reebase.evaluation import Evaluation
from worker.denoising import denoise
from worker.stacks import pack, unpack

__all__ = ["COMPUTATIONS", "warm"]

LONGEST_WHOLE = 60.0
"""Seconds of a description beyond which its parts are not described by themselves as well."""

_WORST = 50
"""Queries whose mistakes are kept with a report."""

Progress = Callable[[str, float], None]
Computation = Callable[[dict[str, Any], BinaryIO, Mapping[str, BinaryIO], Progress], dict[str, Any]]


def describe(
    arguments: dict[str, Any], source: BinaryIO, outputs: Mapping[str, BinaryIO], progress: Progress
) -> dict[str, Any]:
    """Read the mesh in ``source`` and walk the pipeline.

    arguments: ``format`` (or None: sniffed), ``profile``, ``limits``, ``descriptors``. outputs: ``description`` (a
    saved Description without its meshes and field); where they are asked for ``cleaned`` and ``denoised`` (PLY, the
    latter with the field as ``phi2``); what a page draws: ``display`` (GLB), ``thumbnail`` (PNG) and ``limbs`` (the
    skeleton of ``extended``, empty where that keeps nothing); ``parts`` (the skeleton of each of several parts, packed,
    empty where there is one or one of them has none); and ``kept``: what the descriptors keep of it, and what
    duplicates are sought by where they name ``duplicates``.
    Answers which of these could not describe the mesh, as ``refused``.
    """
    from reebase import pipeline
    from reebase.descriptors import DESCRIPTORS, kept, limb_skeleton, surface_of
    from reebase.duplicates import signature
    from reebase.mesh.read import Limits
    from reebase.mesh.write import to_bytes
    from reebase.pictures.display import clustered, display_glb
    from reebase.pictures.thumbnail import thumbnail
    from reebase.skeleton.graph import pack

    description = pipeline.describe(
        source.read(), pipeline.Profile(**arguments["profile"]),
        format=arguments["format"], limits=Limits(**arguments["limits"]), progress=progress,
    )  # fmt: skip
    refused: dict[str, ReebaseError] = {}
    seconds = description.seconds
    if "kept" in outputs:
        progress("descriptors", 0.9)
        start = time.perf_counter()
        names = list(arguments["descriptors"])
        surface = surface_of(description)
        found, refused = kept.keep(surface, [name for name in names if name in DESCRIPTORS])
        if "limbs" in outputs and "extended" in found:
            outputs["limbs"].write(limb_skeleton(surface).to_bytes())
        if "duplicates" in names:
            try:
                found["duplicates"] = kept.Kept(signature(description.cleaned)[None].astype(np.float32))
            except (ReebaseError, MemoryError) as lacked:
                refused["duplicates"] = ComputationError(f"No copies can be sought of the shape: {lacked}")
        kept.save(outputs["kept"], found)
        seconds = {**seconds, "descriptors": time.perf_counter() - start}
    # Together they take about as long as the whole took, and must not end it at the child's limits.
    if "parts" in outputs and sum(seconds.values()) < LONGEST_WHOLE:
        # The whole has been described: that a part by itself cannot be is no failure.
        with suppress(ReebaseError, MemoryError):
            outputs["parts"].write(pack(description.part_skeletons()))
    if outputs.keys() & {"cleaned", "denoised", "display", "thumbnail"}:
        progress("write", 0.95)
    if "cleaned" in outputs:
        outputs["cleaned"].write(to_bytes(description.cleaned, "ply"))
    if "denoised" in outputs:
        scalars = {"phi2": description.field}
        outputs["denoised"].write(to_bytes(description.denoised, "ply", scalars=scalars))
    if outputs.keys() & {"display", "thumbnail"}:
        light = clustered(description.denoised)
        if "display" in outputs:
            drawn = (description.cleaned, description.denoised, description.field, light)
            outputs["display"].write(display_glb(*drawn, field=description.profile.field))
        if "thumbnail" in outputs:
            outputs["thumbnail"].write(thumbnail(light.of(description.denoised)))
    # The meshes have just been written, where they are wanted at all.
    none = Mesh(np.empty((0, 3)), np.empty((0, 3), dtype=np.int32))
    numbers = dataclasses.replace(description, cleaned=none, denoised=none, field=np.empty(0), seconds=seconds)
    numbers.save(outputs["description"])
    return {"refused": {name: {"code": one.code, "detail": one.message} for name, one in refused.items()}}


def evaluate(
    arguments: dict[str, Any], source: BinaryIO, outputs: Mapping[str, BinaryIO], progress: Progress
) -> dict[str, Any]:
    """All dissimilarities of what is kept of n shapes and the measures of retrieval on them.

    source: what each part of the ranking keeps of them, packed. arguments: ``labels`` and ``names`` (n each),
    ``descriptor``, ``measure``, ``rerank``, ``bootstrap``, ``seed``. outputs: ``report`` (JSON), ``matrix`` (npy,
    (n, n)).
    """
    from reebase.evaluation import measures
    from reebase.ranking import ranking_named

    ranking = ranking_named(arguments["descriptor"], arguments["measure"], arguments["rerank"])
    dissimilarities = ranking.matrix(
        unpack(source), progress=lambda fraction: progress("matrix", 0.9 * fraction)
    )
    progress("measures", 0.9)
    evaluation = measures.evaluate(
        dissimilarities, arguments["labels"], arguments["names"],
        bootstrap=arguments["bootstrap"], seed=arguments["seed"],
    )  # fmt: skip
    report = {**evaluation.to_json(), "mistakes": _mistakes(evaluation)}
    outputs["report"].write(json.dumps(report).encode())
    np.save(outputs["matrix"], dissimilarities, allow_pickle=False)
    return {}


def _mistakes(evaluation: Evaluation) -> dict[str, Any]:
    """Which classes are taken for which, and the worst queries with what they retrieved; rows by number."""
    from reebase.evaluation.mistakes import confusion
    from reebase.report.lists import worst

    table = confusion(evaluation)
    return {
        "confusion": {"labels": list(table.labels), "counts": table.counts.tolist()},
        "worst": [
            {
                "row": row.query, "average_precision": row.average_precision,
                "hits": [
                    {"row": hit, "relevant": relevant, "dissimilarity": float(evaluation.matrix[row.query, hit])}
                    for hit, relevant in zip(row.hits, row.relevant, strict=True)
                ],
            }
            for row in worst(evaluation, _WORST)
        ],
    }  # fmt: skip


def map_collection(
    arguments: dict[str, Any], source: BinaryIO, outputs: Mapping[str, BinaryIO], progress: Progress
) -> dict[str, Any]:
    """A place in the plane for each of n shapes.

    source: what each part of the ranking keeps of them, packed. arguments: ``descriptor``, ``measure``. outputs:
    ``points`` (JSON).
    """
    from reebase.embedding import neighbours_kept, plane
    from reebase.ranking import Ranking

    ranking = Ranking(arguments["descriptor"], arguments["measure"], rerank=False)
    dissimilarities = ranking.matrix(
        unpack(source), progress=lambda fraction: progress("matrix", 0.6 * fraction)
    )
    progress("plane", 0.6)
    points = plane(dissimilarities)
    made = {"points": points.round(4).tolist(), "neighbours_kept": round(neighbours_kept(dissimilarities, points), 4)}
    outputs["points"].write(json.dumps(made).encode())
    return {}


def duplicates(
    _: dict[str, Any], source: BinaryIO, outputs: Mapping[str, BinaryIO], progress: Progress
) -> dict[str, Any]:
    """Which of some pairs of shapes are one. source: zip of meshes by number (PLY), ``names.json``, ``signatures.npy``
    and ``pairs.json`` (distance, numbers of both, whether of each the largest component is meant). outputs:
    ``findings`` (JSON).
    """
    from reebase.duplicates import Candidate, Shape, find_duplicates
    from reebase.mesh.read import read

    with zipfile.ZipFile(source) as archive:
        signatures = np.load(io.BytesIO(archive.read("signatures.npy")), allow_pickle=False)

        def mesh(number: int) -> Mesh:
            return read(archive.read(f"{number}.ply"), "ply")

        names = json.loads(archive.read("names.json"))
        shapes = [
            Shape(name, partial(mesh, number), signatures[number]) for number, name in enumerate(names)
        ]
        pairs = [Candidate(apart, a, b, tuple(parts)) for apart, a, b, parts in json.loads(archive.read("pairs.json"))]
        found = find_duplicates(shapes, pairs=pairs, progress=lambda fraction: progress("compare", fraction))
    outputs["findings"].write(json.dumps([one.to_json() for one in found]).encode())
    return {}


def report(
    arguments: dict[str, Any], source: BinaryIO, outputs: Mapping[str, BinaryIO], progress: Progress
) -> dict[str, Any]:
    """Evaluations of the same shapes side by side.

    source: a ZIP archive of ``items.json``, ``matrix-0.npy`` ... and ``ID.png``. arguments: ``title``, ``entries``
    (``name`` and ``measure`` of each matrix). outputs: ``page`` (HTML), ``files`` (ZIP).
    """
    from reebase.evaluation import evaluate
    from reebase.report import Entry, Report, files
    from reebase.report.lists import shown_in

    entries: list[Entry] = []
    with zipfile.ZipFile(source) as archive:
        items = json.loads(archive.read("items.json"))
        labels, ids = [item["label"] for item in items], [item["id"] for item in items]
        for number, told in enumerate(arguments["entries"]):
            progress("measures", 0.6 * number / len(arguments["entries"]))
            with archive.open(f"matrix-{number}.npy") as matrix:
                dissimilarities = np.load(io.BytesIO(matrix.read()), allow_pickle=False)
            entries.append(Entry(told["name"], told["measure"], evaluate(dissimilarities, labels, ids)))
        there = {name.removesuffix(".png") for name in archive.namelist()}
        drawn = {shape: archive.read(f"{shape}.png") for shape in shown_in(entries) if shape in there}
    names = {item["id"]: item["name"] for item in items}
    made = files(
        Report(arguments["title"], entries, names=names, thumbnails=drawn),
        progress=lambda fraction: progress("plots", 0.6 + 0.4 * fraction),
    )
    outputs["page"].write(made["index.html"])
    with zipfile.ZipFile(outputs["files"], "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in made.items():
            # Of no date, so that the same report is the same file.
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return {}


def synthesise(
    arguments: dict[str, Any], _: BinaryIO, outputs: Mapping[str, BinaryIO], progress: Progress
) -> dict[str, Any]:
    """One shape of the synthetic set; arguments as those of ``synthetic_shape``. outputs: ``mesh`` (PLY)."""
    from reebase.evaluation.synthetic import synthetic_shape
    from reebase.mesh.write import to_bytes

    progress("synthesise", 0.0)
    outputs["mesh"].write(to_bytes(synthetic_shape(**arguments).mesh, "ply"))
    return {}


def probe(_: dict[str, Any], __: BinaryIO, ___: Mapping[str, BinaryIO], ____: Progress) -> dict[str, Any]:
    """Nothing but an attempt at what must be refused; the child reports its guards beside the answer."""
    try:
        socket.socket().close()
    except OSError:
        return {"network": False}
    return {"network": True}


COMPUTATIONS: dict[str, Computation] = {
    "denoise": denoise, "describe": describe, "duplicates": duplicates, "evaluate": evaluate, "map": map_collection,
    "probe": probe, "report": report, "synthesise": synthesise,
}  # fmt: skip


def warm() -> None:
    """Walk every computation once on small meshes, so that all modules are imported and all kernels ready."""
    from reebase import pipeline
    from reebase import warm as kernels
    from reebase.descriptors import DESCRIPTORS
    from reebase.descriptors import kept as stored
    from reebase.evaluation.synthetic import CLASSES
    from reebase.mesh.write import to_bytes
    from reebase.ranking import FUSED, PARTS

    kernels.warm()
    profile = pipeline.Profile().to_json()
    made = io.BytesIO()
    synthesise({"label": CLASSES[0], "index": 0, "vertices": 1000}, io.BytesIO(), {"mesh": made}, _silent)
    kept = io.BytesIO()
    # A mesh in each format loads its reader; the last has an edge of four faces, for the operator of such.
    for mesh, format in [*((kernels.sample(), format) for format in _FORMATS), (_two_tetrahedra(), "ply")]:
        outputs = {name: io.BytesIO() for name in _DESCRIBED}
        names = [] if kept.getvalue() else ["duplicates", *DESCRIPTORS]
        try:
            source = io.BytesIO(to_bytes(mesh, format))
            asked = {"format": format, "limits": {}, "profile": profile, "descriptors": names}
            describe(asked, source, outputs, _silent)
            kept = outputs["kept"] if names else kept
        except (MissingPackage, MeshError):
            continue  # what is not installed, or refused, needs no warming
    noisy = to_bytes(kernels.sample(), "ply")
    parts = {name: {"start": 0, "size": len(noisy), "format": "ply"} for name in ("file", "truth")}
    how = {"parts": parts, "method": "auto", "iterations": 1, "boundary": "curve", "parameters": {}, "limits": {}}
    denoise(how, io.BytesIO(noisy), {"mesh": io.BytesIO()}, _silent)
    kept.seek(0)
    same = stored.load(kept)
    packed = io.BytesIO(pack({part: 4 * [same[part].values] for part in PARTS}))
    labelled = {"labels": ["a", "a", "b", "b"], "names": ["0", "1", "2", "3"]}
    outputs = {name: io.BytesIO() for name in ("report", "matrix")}
    ranking = {"descriptor": FUSED, "measure": None, "rerank": True}
    evaluate({**labelled, **ranking, "bootstrap": 2, "seed": 0}, packed, outputs, _silent)


_DESCRIBED = ("description", "kept", "cleaned", "denoised", "display", "thumbnail")
_FORMATS = ("ply", "obj", "off", "stl", "glb")


def _silent(_: str, __: float) -> None:
    return


def _two_tetrahedra() -> Mesh:
    """Two tetrahedra that share one edge."""
    corners = [[0, 0, 0], [0, 0, 1], [1, 0, 0.5], [1, 1, 0.5], [-1, 0, 0.5], [-1, -1, 0.5]]
    vertices = np.array(corners, dtype=np.float64)
    tetrahedra = [(0, 1, 2, 3), (0, 1, 4, 5)]
    sides = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    faces = [[four[i] for i in side] for four in tetrahedra for side in sides]
    return Mesh(vertices, np.array(faces, dtype=np.int32))
