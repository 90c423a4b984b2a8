"""glTF 2.0 and GLB, geometry only: triangles, strips and fans of the scene, with the transforms of its nodes.

Materials, textures, images, cameras and animations are never looked at, so that a missing image cannot
fail a load. What geometry needs must be in the file itself.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import numpy.typing as npt

from reebase.errors import FormatError, NoFaces, TruncatedFile, UnsupportedFeature
from reebase.mesh.mesh import Mesh
from reebase.mesh.read.gltf_accessors import Accessors, field, table
from reebase.mesh.read.limits import Limits
from reebase.mesh.read.polygons import build, strips
from reebase.mesh.read.text import json_fault, plain_text

__all__ = ["MAGIC", "read_gltf"]

MAGIC = b"glTF"
_JSON, _BIN = 0x4E4F534A, 0x004E4942
TRIANGLES, STRIP, FAN = 4, 5, 6
_UPGRADE = "Reebase reads glTF 2.0. Convert it with gltf-pipeline, or export the scene anew as GLB, OBJ or STL."

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Part = tuple[Floats, Ints]


def read_gltf(data: bytes, limits: Limits) -> Mesh:
    """The mesh of a glTF or GLB file: nodes in depth-first order, primitives of a mesh in theirs.

    Positions are in scene coordinates. Primitives of one mesh that share positions share vertices.
    Raises FormatError, MeshError, LimitError.
    """
    text, binary = _container(data) if data.startswith(MAGIC) else (_bare(data), None)
    document = _document(text)
    accessors = Accessors(document, binary, limits)
    meshes = table(document, "meshes")
    nodes = table(document, "nodes")
    placed = [
        (field(nodes[node], "mesh", len(meshes), f"nodes[{node}]"), matrix)
        for node, matrix in _placed(document, nodes)
    ]
    if not nodes:  # a file of meshes that nothing places
        placed = [(at, np.eye(4)) for at in range(len(meshes))]
    read: dict[int, Part] = {}
    vertices: list[Floats] = []
    faces: list[Ints] = []
    vertex_count = face_count = 0
    for at, matrix in placed:
        if at is None:
            continue
        if at not in read:
            read[at] = _mesh(meshes[at], at, accessors, limits)
        points, triangles = read[at]
        limits.check_vertices(vertex_count + len(points))
        limits.check_faces(face_count + len(triangles))
        vertices.append(points @ matrix[:3, :3].T + matrix[:3, 3])
        turned = np.linalg.det(matrix[:3, :3]) < 0
        faces.append(triangles[:, ::-1] + vertex_count if turned else triangles + vertex_count)
        vertex_count += len(points)
        face_count += len(triangles)
    if not face_count:
        raise NoFaces("The glTF scene has no triangles (points and lines are not a surface).")
    return build(np.concatenate(vertices), np.concatenate(faces).ravel(), np.full(face_count, 3), limits)


def _bare(data: bytes) -> bytes:
    """The JSON of a glTF file."""
    text = plain_text(data)
    if not text.lstrip().startswith((b"{", b"[")):
        raise FormatError(
            "This is not a GLB file: it does not begin with the four bytes glTF. Nor is it JSON, as other glTF is."
        )
    return text


def _container(data: bytes) -> tuple[bytes, bytes | None]:
    """(JSON, binary chunk) of a GLB file."""
    if len(data) < 20:
        raise TruncatedFile(f"A GLB file has a header of 20 bytes; the file has {len(data)}.")
    _, version, length, first, kind = np.frombuffer(data, "<u4", 5).tolist()
    if version != 2:
        raise UnsupportedFeature(
            f"This is GLB version {version}, of glTF {version}.0; {_UPGRADE}", version=f"{version}.0"
        )
    if length > len(data):
        raise TruncatedFile(
            f"The GLB header announces {length:,} bytes, but the file has {len(data):,}.",
            announced=length, found=len(data),
        )  # fmt: skip
    if kind != _JSON:
        raise FormatError("GLB: the first chunk is not JSON.")
    if 20 + first > len(data):
        raise TruncatedFile("GLB: the file ends within its JSON chunk.")
    at = 20 + first
    while at + 8 <= min(length, len(data)):
        size, kind = np.frombuffer(data, "<u4", 2, at).tolist()
        if at + 8 + size > len(data):
            raise TruncatedFile("GLB: the file ends within a chunk.")
        if kind == _BIN:
            return data[20 : 20 + first], data[at + 8 : at + 8 + size]
        at += 8 + size
    return data[20 : 20 + first], None


def _document(text: bytes) -> dict[str, Any]:
    try:
        document = json.loads(text)
    except RecursionError:
        raise FormatError("glTF: the JSON is nested too deeply.") from None
    except ValueError as error:
        fault = json_fault(error)
        if "Unterminated" in fault or not text.rstrip().endswith(b"}"):
            raise TruncatedFile(f"glTF: the JSON ends early ({fault}).") from None
        raise FormatError(f"glTF: the JSON is not well formed ({fault}).") from None
    if not isinstance(document, dict):
        raise FormatError("glTF: the JSON is not an object.")
    asset = document.get("asset")
    version = asset.get("version") if isinstance(asset, dict) else None
    if version is None:
        raise FormatError("glTF: asset.version is missing; this may be JSON, but not glTF.")
    version = str(version)[:8]
    if version.split(".")[0] != "2":
        full = f"{version}.0" if version.isdecimal() else version
        raise UnsupportedFeature(f"This is glTF {full}; {_UPGRADE}", version=version)
    return document


def _placed(document: dict[str, Any], nodes: list[dict[str, Any]]) -> list[tuple[int, Floats]]:
    """(node, matrix to scene coordinates), depth first. Every node stands in one place at most."""
    scenes = table(document, "scenes")
    children = [_indices(node, "children", len(nodes), f"nodes[{i}]") for i, node in enumerate(nodes)]
    if scenes:
        chosen = field(document, "scene", len(scenes), "glTF") or 0
        roots = _indices(scenes[chosen], "nodes", len(nodes), f"scenes[{chosen}]")
    else:
        below = {child for listed in children for child in listed}
        roots = [i for i in range(len(nodes)) if i not in below]
    placed: list[tuple[int, Floats]] = []
    seen: set[int] = set()
    waiting = [(root, np.eye(4)) for root in reversed(roots)]
    while waiting:
        node, above = waiting.pop()
        if node in seen:
            raise FormatError(f"glTF: node {node} has several parents or is its own; nodes must form a tree.")
        seen.add(node)
        matrix = above @ _matrix(nodes[node], node)
        placed.append((node, matrix))
        waiting += [(child, matrix) for child in reversed(children[node])]
    return placed


def _matrix(node: dict[str, Any], at: int) -> Floats:
    """The node's own transform, shape (4, 4)."""
    extensions = node.get("extensions")
    if isinstance(extensions, dict) and "EXT_mesh_gpu_instancing" in extensions:
        raise UnsupportedFeature("glTF: EXT_mesh_gpu_instancing is not read; export the instances as nodes.")
    if "matrix" in node:
        return _numbers(node, "matrix", 16, at).reshape(4, 4).T
    matrix = np.eye(4)
    if "rotation" in node:
        x, y, z, w = _numbers(node, "rotation", 4, at)
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    if "scale" in node:
        matrix[:3, :3] *= _numbers(node, "scale", 3, at)
    if "translation" in node:
        matrix[:3, 3] = _numbers(node, "translation", 3, at)
    return matrix


def _numbers(node: dict[str, Any], name: str, count: int, at: int) -> Floats:
    given = node[name]
    if not isinstance(given, list) or len(given) != count:
        raise FormatError(f"glTF: nodes[{at}].{name} is not a list of {count} numbers.")
    if not all(isinstance(x, (int, float)) and not isinstance(x, bool) and abs(x) < 1e300 for x in given):
        raise FormatError(f"glTF: nodes[{at}].{name} is not a list of {count} finite numbers.")
    return np.array(given, dtype=np.float64)


def _indices(record: dict[str, Any], name: str, count: int, where: str) -> list[int]:
    given = record.get(name, [])
    if not isinstance(given, list):
        raise FormatError(f"glTF: {where}.{name} is not a list.")
    found = [field({name: one}, name, count, where) for one in given]
    return [one for one in found if one is not None]


def _mesh(mesh: dict[str, Any], at: int, accessors: Accessors, limits: Limits) -> Part:
    """(vertices, faces) of all primitives that are surfaces."""
    vertices: list[Floats] = [np.zeros((0, 3))]
    faces: list[Ints] = [np.zeros((0, 3), dtype=np.int64)]
    starts: dict[int, int] = {}
    count = used = 0
    for number, primitive in enumerate(table(mesh, "primitives")):
        where = f"meshes[{at}].primitives[{number}]"
        mode = primitive.get("mode", TRIANGLES)
        if mode not in range(7):
            raise FormatError(f"glTF: {where}.mode is {str(mode)[:16]}, not 0 to 6.")
        if mode not in (TRIANGLES, STRIP, FAN):
            continue
        attributes = primitive.get("attributes")
        if not isinstance(attributes, dict) or "POSITION" not in attributes:
            continue
        position = accessors.index(attributes, "POSITION", f"{where}.attributes")
        extensions = primitive.get("extensions")
        if isinstance(extensions, dict) and "KHR_draco_mesh_compression" in extensions and accessors.is_empty(position):
            raise UnsupportedFeature(
                "glTF: the mesh is compressed with Draco, which is not read. Export it without compression."
            )
        if position not in starts:
            points = accessors.vectors(position)
            starts[position] = count
            vertices.append(points)
            count += len(points)
            limits.check_vertices(count)
        own = len(accessors.vectors(position))
        if primitive.get("indices") is None:
            indices = np.arange(own)
        else:
            indices = accessors.scalars(accessors.index(primitive, "indices", where))
        accessors.check_range(indices, own, where)
        used += len(indices)
        limits.check_faces(used // 3)
        faces.append(starts[position] + _triangles(indices, mode))
    return np.concatenate(vertices), np.concatenate(faces)


def _triangles(indices: Ints, mode: int) -> Ints:
    if mode == STRIP:
        return strips(indices)
    if mode == FAN:
        if len(indices) < 3:
            return np.zeros((0, 3), dtype=np.int64)
        return np.stack([indices[1:-1], indices[2:], np.full(len(indices) - 2, indices[0])], axis=1)
    return indices[: len(indices) // 3 * 3].reshape(-1, 3)
