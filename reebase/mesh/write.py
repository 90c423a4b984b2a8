"""Writes meshes: PLY with scalars and without loss, OBJ and OFF without loss, STL and GLB in float32."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from reebase.errors import MeshError, NoFaces, ParameterError, unknown_name
from reebase.mesh.mesh import Mesh

__all__ = ["WRITTEN", "to_bytes", "write"]

Floats = npt.NDArray[np.float64]
Scalars = Mapping[str, npt.NDArray[np.floating]]

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,62}")


def write(
    mesh: Mesh, path: str | os.PathLike[str], format: str | None = None, *, scalars: Scalars | None = None
) -> None:
    """Writes a mesh to a file; the format comes from the path's suffix unless it is given.

    See ``to_bytes``, which raises the rest. Raises OSError.
    """
    target = Path(path)
    target.write_bytes(to_bytes(mesh, format or target.suffix.removeprefix("."), scalars=scalars))


def to_bytes(mesh: Mesh, format: str, *, scalars: Scalars | None = None) -> bytes:
    """A mesh as the bytes of a file, vertices and faces in their order.

    format: one of WRITTEN. PLY is binary, little-endian, float64; OBJ and OFF give the shortest text
    that reads back to the same float64; STL (binary, three vertices a face) and GLB hold float32.
    scalars: values of the vertices by name, each shape (m,). PLY holds them as float64 properties, NaN
    allowed; GLB as float32 attributes named _NAME in capitals. glTF forbids NaN: it becomes 0, and a second
    attribute _NAME_MISSING is 1 there. The other formats have no place for scalars.

    Raises UnknownName for a format that is not written, ParameterError for scalars that do not fit,
    MeshError for coordinates beyond float32, NoFaces for a GLB without faces (glTF knows no empty mesh).
    """
    name = format.lower().removeprefix(".")
    if name not in WRITTEN:
        raise unknown_name("format to write", format, WRITTEN)
    return WRITTEN[name](mesh, _checked(mesh, scalars or {}, name))


def _checked(mesh: Mesh, scalars: Scalars, format_name: str) -> dict[str, Floats]:
    if scalars and format_name not in ("ply", "glb"):
        raise ParameterError(f"{format_name.upper()} has no place for scalars; write PLY or GLB.")
    checked = {}
    for name, values in scalars.items():
        if not _NAME.fullmatch(name) or name in ("x", "y", "z"):
            raise ParameterError(
                f"A scalar cannot be named {name[:80]!r}: letters, digits and underscores, and not x, y or z."
            )
        array = np.asarray(values, dtype=np.float64)
        if array.shape != (len(mesh.vertices),):
            raise ParameterError(
                f"Scalar {name!r} must have shape ({len(mesh.vertices)},), one value a vertex; "
                f"found {array.shape}."
            )
        checked[name] = array
    return checked


def _ply(mesh: Mesh, scalars: dict[str, Floats]) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.vertices)}"]
    lines += [f"property double {name}" for name in ("x", "y", "z", *scalars)]
    lines += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header", ""]
    columns = np.column_stack([mesh.vertices, *scalars.values()]).astype("<f8")
    records = np.empty(len(mesh.faces), dtype=[("size", "u1"), ("corners", "<i4", 3)])
    records["size"], records["corners"] = 3, mesh.faces
    return "\n".join(lines).encode("ascii") + columns.tobytes() + records.tobytes()


def _obj(mesh: Mesh, _: dict[str, Floats]) -> bytes:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces.astype(np.int64) + 1).tolist()]
    return "\n".join([*lines, ""]).encode("ascii")


def _off(mesh: Mesh, _: dict[str, Floats]) -> bytes:
    lines = ["OFF", f"{len(mesh.vertices)} {len(mesh.faces)} 0"]
    lines += [f"{x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist()]
    return "\n".join([*lines, ""]).encode("ascii")


def _stl(mesh: Mesh, _: dict[str, Floats]) -> bytes:
    corners = _single(mesh.vertices[mesh.faces], "STL")
    sides = corners.astype(np.float64)
    with np.errstate(all="ignore"):
        normals = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = np.where((lengths > 0) & np.isfinite(lengths), normals / lengths, 0.0)
    layout = [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")]
    records = np.zeros(len(mesh.faces), dtype=layout)
    records["normal"], records["corners"] = normals, corners
    # Not "solid": that is how a text STL starts.
    header = b"binary STL".ljust(80, b" ")
    return header + len(mesh.faces).to_bytes(4, "little") + records.tobytes()


def _glb(mesh: Mesh, scalars: dict[str, Floats]) -> bytes:
    if not len(mesh.faces):
        raise NoFaces("A mesh without faces cannot be written as GLB.")
    points = _single(mesh.vertices, "GLB")
    arrays = {"POSITION": points}
    for name, values in scalars.items():
        missing = np.isnan(values)
        with np.errstate(over="ignore"):
            single = np.where(missing, 0, values).astype("<f4")
        if not np.isfinite(single).all():
            raise ParameterError(f"Scalar {name!r} is beyond float32 somewhere, which GLB cannot hold.")
        attribute = "_" + name.upper().lstrip("_")
        if attribute in arrays:
            raise ParameterError(f"Two scalars would be {attribute} in GLB, where names are in capitals.")
        arrays[attribute] = single
        if missing.any():
            arrays[attribute + "_MISSING"] = missing.astype("<f4")
    views, accessors, parts, at = [], [], [], 0
    for array in (*arrays.values(), mesh.faces.astype("<u4").ravel()):
        raw = array.tobytes()
        corner = array is not points and array.dtype.kind == "u"
        target = 34963 if corner else 34962
        views.append({"buffer": 0, "byteOffset": at, "byteLength": len(raw), "target": target})
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": 5125 if corner else 5126,
                "count": len(array),
                "type": "VEC3" if array.ndim == 2 else "SCALAR",
            }
        )
        parts.append(raw)
        at += len(raw)
    accessors[0] |= {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
    attributes = {name: i for i, name in enumerate(arrays)}
    document = {
        "asset": {"version": "2.0", "generator": "Reebase"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": len(arrays)}]}],
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": at}],
    }
    text = json.dumps(document, separators=(",", ":")).encode("ascii")
    text += b" " * (-len(text) % 4)
    binary = b"".join(parts)  # all arrays are of four-byte items, so no view needs padding
    chunks = _chunk(b"JSON", text) + _chunk(b"BIN\0", binary)
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks


def _chunk(kind: bytes, content: bytes) -> bytes:
    return len(content).to_bytes(4, "little") + kind + content


def _single(vertices: Floats, name: str) -> npt.NDArray[np.float32]:
    with np.errstate(over="ignore"):
        single = vertices.astype("<f4")
    if not np.isfinite(single).all():
        raise MeshError(f"A coordinate is NaN or beyond float32, which {name} cannot hold; write PLY, OBJ or OFF.")
    return single


WRITTEN: dict[str, Callable[[Mesh, dict[str, Floats]], bytes]] = {
    "ply": _ply,
    "obj": _obj,
    "off": _off,
    "stl": _stl,
    "glb": _glb,
}
"""Every format that is written: name -> writer."""
