"""A mesh light enough to be drawn by a browser, before and after denoising, with scalars on its vertices.

``display_glb(description) -> bytes``: one GLB of at most ``MOST_FACES`` faces;
``fields(description) -> list[Field]``: the scalars that a description has on the vertices of its meshes.

In the GLB, POSITION is the denoised surface around the translation of its node, the morph target ``cleaned`` is
what leads back to the surface before denoising, and each scalar is an attribute such as ``_PHI2``; where a scalar is
unknown it is 0 and ``_PHI2_MISSING`` is 1. ``asset.extras`` says what the fields mean and how much was left out.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.mesh.mesh import Mesh
from reebase.pictures.view import crossed

__all__ = ["FIELDS", "MOST_FACES", "Field", "clustered", "display_glb", "fields_of"]

MOST_FACES = 100_000
"""A phone turns so many smoothly."""

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Field:
    """What a scalar on the vertices means. kind: "signed" has a meaningful zero in the middle, "positive" below."""

    name: str
    title: str
    description: str
    kind: str
    unit: str


FIELDS = (
    Field(
        "phi2", "Scalar field", "the field whose level sets are the bands of the skeleton: φ₂, the first eigenfunction "
        "of the Laplace–Beltrami operator that varies, unless the profile names another", "signed", "",
    ),
    Field(
        "displacement", "Displacement of denoising", "how far denoising moved each vertex", "positive", "mesh",
    ),
    Field(
        "displacement_signed", "Displacement along the normal",
        "how far denoising moved each vertex outwards, along the normal that it had before", "signed", "mesh",
    ),
)  # fmt: skip
"""In the order in which a page offers them."""


def fields_of(cleaned: Mesh, denoised: Mesh, phi2: Array) -> dict[str, Array]:
    """name -> a number for each vertex, (n,), NaN where it is unknown.

    cleaned, denoised: the same vertices before and after. phi2: the profile's field, (n,).
    """
    moved = denoised.vertices - cleaned.vertices
    return {
        "phi2": phi2,
        "displacement": np.sqrt((moved**2).sum(axis=1)),
        "displacement_signed": (moved * _normals(cleaned)).sum(axis=1),
    }


def display_glb(cleaned: Mesh, denoised: Mesh, phi2: Array, most_faces: int = MOST_FACES) -> bytes:
    """The GLB that the module's docstring describes, with every field of ``fields_of``."""
    kept, faces, error = clustered(denoised, most_faces)
    offset = (denoised.vertices.min(axis=0) + denoised.vertices.max(axis=0)) / 2
    points = (denoised.vertices[kept] - offset).astype("<f4")
    back = (cleaned.vertices[kept] - denoised.vertices[kept]).astype("<f4")
    scalars = fields_of(cleaned, denoised, phi2)
    told = []
    for field in FIELDS:
        known = scalars[field.name][np.isfinite(scalars[field.name])]
        low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
        told.append({**asdict(field), "attribute": _attribute(field.name), "min": low, "max": high})
    extras = {
        "fields": told, "vertices": len(denoised.vertices), "faces": len(denoised.faces),
        "decimated": len(kept) < len(denoised.vertices), "error": error,
    }  # fmt: skip
    return _glb(points, back, faces, {name: values[kept] for name, values in scalars.items()}, offset, extras)


def clustered(mesh: Mesh, most_faces: int) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], float]:
    """Vertices to keep, (m,), faces between them, (n, 3), and how far a vertex was moved at most.

    The vertices of each cell of a grid become the one among them that is nearest to their mean (vertex
    clustering, Rossignac and Borrel 1993), so that whatever is known of vertices is known of those that stay.
    The finest grid of a few is taken that gives at most ``most_faces``.
    """
    faces = mesh.faces.astype(np.int64)
    if len(faces) <= most_faces:
        return np.arange(len(mesh.vertices)), faces, 0.0
    corners = mesh.vertices[faces]
    area = float(np.sqrt((crossed(corners) ** 2).sum(axis=1)).sum()) / 2
    box = float(np.ptp(mesh.vertices, axis=0).max()) or 1.0
    # A surface has about 1.5 of its vertices in a cell of its area, and twice as many faces as vertices.
    cell = max(float(np.sqrt(2.0 * area / most_faces)), box * 1e-6)
    while True:
        kept, merged, error = _cells(mesh.vertices, faces, cell)
        if len(merged) <= most_faces:
            return kept, merged, error
        cell *= 1.02 * float(np.sqrt(len(merged) / most_faces))


def _cells(
    vertices: Array, faces: npt.NDArray[np.int64], cell: float
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], float]:
    where = np.floor((vertices - vertices.min(axis=0)) / cell).astype(np.int64)
    span = where.max(axis=0) + 1
    _, group, counts = np.unique(
        (where[:, 0] * span[1] + where[:, 1]) * span[2] + where[:, 2], return_inverse=True, return_counts=True
    )
    means = np.stack([np.bincount(group, axis) for axis in vertices.T], axis=1) / counts[:, None]
    away = ((vertices - means[group]) ** 2).sum(axis=1)
    order = np.lexsort((away, group))
    kept = order[np.concatenate([[0], np.cumsum(counts)[:-1]])]
    merged = group[faces]
    a, b, c = merged.T
    merged = merged[(a != b) & (b != c) & (c != a)]
    # The same three corners twice, turned either way, are one face: two flicker through each other.
    key = np.sort(merged, axis=1)
    _, first = np.unique((key[:, 0] * len(kept) + key[:, 1]) * len(kept) + key[:, 2], return_index=True)
    error = float(np.sqrt(((vertices - vertices[kept][group]) ** 2).sum(axis=1).max()))
    return kept, merged[np.sort(first)], error


def _normals(mesh: Mesh) -> Array:
    """Unit normals of the vertices, weighted by area, (n, 3); 0 where there is none."""
    sides = crossed(mesh.vertices[mesh.faces])
    sums = [np.bincount(mesh.faces.ravel(), np.repeat(axis, 3), len(mesh.vertices)) for axis in sides.T]
    normals = np.stack(sums, axis=1)
    lengths = np.sqrt((normals**2).sum(axis=1, keepdims=True))
    unit: Array = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    return unit


def _attribute(name: str) -> str:
    return "_" + name.upper()


def _glb(
    points: npt.NDArray[np.float32], back: npt.NDArray[np.float32], faces: npt.NDArray[np.int64],
    scalars: Mapping[str, Array], offset: Array, extras: dict[str, Any],
) -> bytes:  # fmt: skip
    """One mesh of one primitive; every accessor has a view of its own and all items are of four bytes."""
    attributes = {"POSITION": points}
    for name, values in scalars.items():
        missing = ~np.isfinite(values)
        attributes[_attribute(name)] = np.where(missing, 0.0, values).astype("<f4")
        if missing.any():
            attributes[_attribute(name) + "_MISSING"] = missing.astype("<f4")
    arrays = [*attributes.values(), back, faces.astype("<u4").ravel()]
    views: list[dict[str, Any]] = []
    accessors: list[dict[str, Any]] = []
    at = 0
    for array in arrays:
        corners = array.dtype.kind == "u"
        views.append(
            {"buffer": 0, "byteOffset": at, "byteLength": array.nbytes, "target": 34963 if corners else 34962}
        )
        accessors.append({
            "bufferView": len(views) - 1, "componentType": 5125 if corners else 5126, "count": len(array),
            "type": "VEC3" if array.ndim == 2 else "SCALAR",
        })  # fmt: skip
        at += array.nbytes
    for place in (0, len(attributes)):
        array = arrays[place]
        accessors[place] |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
    document = {
        "asset": {"version": "2.0", "generator": "Reebase", "extras": extras},
        "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "translation": offset.tolist()}],
        "meshes": [{
            "primitives": [{
                "attributes": {name: place for place, name in enumerate(attributes)},
                "indices": len(arrays) - 1, "targets": [{"POSITION": len(attributes)}],
            }],
            "weights": [0.0], "extras": {"targetNames": ["cleaned"]},
        }],
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": at}],
    }  # fmt: skip
    text = json.dumps(document, separators=(",", ":")).encode("ascii")
    chunks = _chunk(b"JSON", text + b" " * (-len(text) % 4))
    chunks += _chunk(b"BIN\0", b"".join(array.tobytes() for array in arrays))
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks


def _chunk(kind: bytes, content: bytes) -> bytes:
    return len(content).to_bytes(4, "little") + kind + content
