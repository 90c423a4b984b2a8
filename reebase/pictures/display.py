"""A mesh light enough to be drawn by a browser, before and after denoising, with scalars on its vertices.

``display_glb(cleaned, denoised, phi2) -> bytes``: one GLB of at most ``MOST_FACES`` faces
``fields_of(cleaned, denoised, phi2) -> dict``: the scalars on the vertices of the two meshes, which FIELDS explains
``clustered(mesh, most_faces) -> Light``: a lighter mesh on some of the vertices

In the GLB, POSITION is the denoised surface as the translation and scale of its node place it, the morph target
``cleaned`` is what leads back to the surface before denoising, and each scalar is an attribute such as ``_PHI2``;
where a scalar is unknown it is 0 and ``_PHI2_MISSING`` is 1. ``asset.extras`` says what the fields mean and how much
was left out.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.mesh.mesh import Mesh
from reebase.pictures.view import crossed

__all__ = ["FIELDS", "MOST_FACES", "Field", "Light", "clustered", "display_glb", "fields_of", "named_fields"]

MOST_FACES = 100_000
"""A phone turns so many smoothly."""

Array = npt.NDArray[np.float64]

_MOST = float(np.finfo(np.float32).max)


@dataclass(frozen=True)
class Field:
    """What a scalar on the vertices means. kind: "signed" has a meaningful zero in the middle, "positive" below."""

    name: str
    title: str
    description: str
    kind: str
    unit: str


@dataclass(frozen=True, eq=False)
class Light:
    """A lighter mesh. kept: the vertices that stay, (m,). faces: between these, (n, 3). error: how far a vertex was
    moved at most.
    """

    kept: npt.NDArray[np.int64]
    faces: npt.NDArray[np.int64]
    error: float

    def of(self, mesh: Mesh) -> Mesh:
        """The lighter mesh itself, of the mesh that it was made of or of one with the same vertices."""
        return Mesh(mesh.vertices[self.kept], self.faces.astype(np.int32))


FIELDS = (
    Field(
        "phi2", "φ₂", "the field whose level sets are the bands of the skeleton: φ₂, the first eigenfunction "
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


def named_fields(field: str) -> tuple[Field, ...]:
    """FIELDS of a profile whose field is another than ``fiedler``: its name is the title then."""
    first, *others = FIELDS
    return FIELDS if field == "fiedler" else (replace(first, title=field), *others)


def fields_of(cleaned: Mesh, denoised: Mesh, phi2: Array) -> dict[str, Array]:
    """name -> a number for each vertex, (n,), NaN where it is unknown.

    cleaned, denoised: the same vertices before and after. phi2: the profile's field, (n,).
    """
    unit = float(np.abs(cleaned.vertices).max()) or 1.0  # squares of any unit are numbers
    moved = (denoised.vertices - cleaned.vertices) / unit
    return {
        "phi2": phi2,
        "displacement": np.sqrt((moved**2).sum(axis=1)) * unit,
        "displacement_signed": (moved * _normals(cleaned.vertices / unit, cleaned.faces)).sum(axis=1) * unit,
    }


def display_glb(
    cleaned: Mesh, denoised: Mesh, phi2: Array, light: Light | None = None, *, field: str = "fiedler"
) -> bytes:
    """The GLB that the module's docstring describes, with every field of ``fields_of``.

    light: ``clustered(denoised)``, if it is at hand. field: what the profile calls ``phi2``.
    """
    light = light or clustered(denoised)
    kept = light.kept
    offset = denoised.vertices.min(axis=0) / 2 + denoised.vertices.max(axis=0) / 2
    extent = float(np.abs(denoised.vertices - offset).max())
    # Units in which float32 could not hold the surface, or only as zeros.
    scale = 1.0 if 1e-30 < extent < 1e30 else extent
    points = ((denoised.vertices[kept] - offset) / scale).astype("<f4")
    back = ((cleaned.vertices[kept] - denoised.vertices[kept]) / scale).astype("<f4")
    scalars = fields_of(cleaned, denoised, phi2)
    told = []
    for one in named_fields(field):
        known = scalars[one.name][np.isfinite(scalars[one.name])]
        low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
        told.append({**asdict(one), "attribute": _attribute(one.name), "min": low, "max": high})
    extras = {
        "fields": told, "vertices": len(denoised.vertices), "faces": len(denoised.faces),
        "decimated": len(kept) < len(denoised.vertices), "error": light.error,
    }  # fmt: skip
    placing = {"translation": offset.tolist(), **({"scale": [scale] * 3} if scale != 1.0 else {})}
    return _glb(points, back, light.faces, {name: values[kept] for name, values in scalars.items()}, placing, extras)


def clustered(mesh: Mesh, most_faces: int = MOST_FACES) -> Light:
    """A mesh of at most that many faces on some of the vertices of this one.

    The vertices of each cell of a grid become the one among them that is nearest to their mean (vertex
    clustering, Rossignac and Borrel 1993), so that whatever is known of vertices is known of those that stay.
    The finest grid of a few is taken that gives at most ``most_faces``.
    """
    faces = mesh.faces.astype(np.int64)
    if len(faces) <= most_faces:
        return Light(np.arange(len(mesh.vertices)), faces, 0.0)
    corners = mesh.vertices[faces]
    area = float(np.sqrt((crossed(corners) ** 2).sum(axis=1)).sum()) / 2
    box = float(np.ptp(mesh.vertices, axis=0).max()) or 1.0
    # Faces are twice as many as vertices, and a surface meets somewhat more cells than its area has squares of them.
    cell = max(float(np.sqrt(2.0 * area / most_faces)), box * 1e-6)
    while True:
        light = _merged(mesh.vertices, faces, cell)
        if len(light.faces) <= most_faces:
            return light
        cell *= 1.02 * float(np.sqrt(len(light.faces) / most_faces))


def _merged(vertices: Array, faces: npt.NDArray[np.int64], cell: float) -> Light:
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
    return Light(kept, merged[np.sort(first)], error)


def _normals(vertices: Array, faces: npt.NDArray[np.int32]) -> Array:
    """Unit normals of the vertices, weighted by area, (n, 3); 0 where there is none."""
    sides = crossed(vertices[faces])
    sums = [np.bincount(faces.ravel(), np.repeat(axis, 3), len(vertices)) for axis in sides.T]
    normals = np.stack(sums, axis=1)
    lengths = np.sqrt((normals**2).sum(axis=1, keepdims=True))
    unit: Array = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    return unit


def _attribute(name: str) -> str:
    return "_" + name.upper()


def _glb(
    points: npt.NDArray[np.float32], back: npt.NDArray[np.float32], faces: npt.NDArray[np.int64],
    scalars: Mapping[str, Array], placing: dict[str, Any], extras: dict[str, Any],
) -> bytes:  # fmt: skip
    """One mesh of one primitive; every accessor has a view of its own and all items are of four bytes."""
    attributes = {"POSITION": points}
    for name, values in scalars.items():
        missing = ~np.isfinite(values)
        attributes[_attribute(name)] = np.clip(np.where(missing, 0.0, values), -_MOST, _MOST).astype("<f4")
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
        "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, **placing}],
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
