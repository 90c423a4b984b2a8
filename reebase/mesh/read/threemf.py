"""3MF: the objects that the build lists, with their components and transforms, also across model files
(the production extension). Units, colours, supports' settings and thumbnails are passed over."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from xml.parsers import expat

import numpy as np
import numpy.typing as npt

from reebase.errors import FaceIndexOutOfRange, FormatError, LimitError, NoFaces, UnknownFormat
from reebase.mesh.mesh import Mesh
from reebase.mesh.read.archive import Archive
from reebase.mesh.read.foreign import archive_in_words
from reebase.mesh.read.limits import Limits
from reebase.mesh.read.polygons import build
from reebase.words import counted

__all__ = ["read_3mf"]

MOST_NESTED = 64
"""Components within components; real files have one or two."""

MOST_PARTS = 100_000
"""Objects, components and build items; empty ones cost memory and time too, and may multiply."""

Floats = npt.NDArray[np.float64]
Key = tuple[str, str]
IDENTITY = np.vstack([np.eye(3), np.zeros(3)])


@dataclass
class _Object:
    """An object as written: vertices and triangles of its mesh, and (object, transform) of its components."""

    coordinates: list[str] = field(default_factory=list)
    corners: list[str] = field(default_factory=list)
    components: list[tuple[Key, Floats]] = field(default_factory=list)
    vertices: Floats = field(default_factory=lambda: np.zeros((0, 3)))
    faces: npt.NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))


@dataclass
class _Model:
    objects: dict[Key, _Object] = field(default_factory=dict)
    items: list[tuple[Key, Floats]] = field(default_factory=list)


def read_3mf(data: bytes, limits: Limits) -> Mesh:
    """The mesh of a 3MF file: build items in their order, each object's mesh, then its components.

    Raises FormatError, MeshError, LimitError (ExpandsTooMuch for an archive that is a bomb).
    """
    archive = Archive(data, limits)
    root = _root(archive)
    model = _Model()
    waiting, seen = [root], {root}
    while waiting:
        path = waiting.pop()
        content = archive.read(path)
        if content is None:
            raise FormatError(f"3MF: the model file {path[:80]!r} is missing in the archive.")
        parsed = _parse(content, path, limits)
        model.objects.update(parsed.objects)
        if path == root:
            model.items = parsed.items
        targets = [key for one in parsed.objects.values() for key, _ in one.components]
        for target, _ in targets + [key for key, _ in parsed.items]:
            if target not in seen:
                seen.add(target)
                waiting.append(target)
    return _assemble(model, limits)


def _root(archive: Archive) -> str:
    """The path of the model that the package starts from, in lower case and without a leading slash."""
    found: list[str] = []

    def start(name: str, attributes: dict[str, str]) -> None:
        if _local(name) == "Relationship" and attributes.get("Type", "").endswith("/3dmodel"):
            found.append(attributes.get("Target", ""))

    relations = archive.read("_rels/.rels")
    if relations is not None:
        _run(relations, start, "_rels/.rels")
    for path in [*found, "3d/3dmodel.model", *(n for n in archive.names if n.endswith(".model"))]:
        if _path(path) in archive.names:
            return _path(path)
    raise UnknownFormat(archive_in_words(archive.names))


def _path(target: str) -> str:
    return target.lower().lstrip("/")


def _local(name: str) -> str:
    return name.rpartition(":")[2]


def _run(content: bytes, start: Callable[[str, dict[str, str]], None], path: str) -> None:
    """Feeds XML to a handler of start tags. Entities and document types are refused."""

    def refuse(*_: object) -> None:
        raise FormatError(f"3MF: {path[:80]!r} declares a document type or entities, which are refused.")

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise FormatError(f"3MF: {path[:80]!r} is not well-formed XML ({error}).") from None
    except KeyError:
        raise
    except (LookupError, ValueError):
        raise FormatError(f"3MF: {path[:80]!r} is XML in an encoding that is not read; save it as UTF-8.") from None


def _parse(content: bytes, path: str, limits: Limits) -> _Model:
    model = _Model()
    current = _Object()
    parts = 0

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal current, parts
        local = _local(name)
        if local == "vertex":
            current.coordinates += (attributes["x"], attributes["y"], attributes["z"])
            if len(current.coordinates) > 3 * limits.vertices:
                limits.check_vertices(len(current.coordinates) // 3)
        elif local == "triangle":
            current.corners += (attributes["v1"], attributes["v2"], attributes["v3"])
            if len(current.corners) > 3 * limits.faces:
                limits.check_faces(len(current.corners) // 3)
        elif local == "object":
            current = model.objects.setdefault((path, attributes["id"]), _Object())
            parts += 1
            _check_parts(parts)
        elif local == "component":
            current.components.append(_reference(attributes, path))
            parts += 1
            _check_parts(parts)
        elif local == "item":
            model.items.append(_reference(attributes, path))
            parts += 1
            _check_parts(parts)

    try:
        _run(content, start, path)
        for one in model.objects.values():
            one.vertices = np.fromiter(map(float, one.coordinates), np.float64).reshape(-1, 3)
            one.faces = np.fromiter(map(int, one.corners), np.int64).reshape(-1, 3)
            one.coordinates, one.corners = [], []
    except KeyError as error:
        raise FormatError(f"3MF: an element in {path[:80]!r} lacks its attribute {error}.") from None
    except (ValueError, OverflowError) as error:
        token = re.search(r": ('.*')$", str(error), re.DOTALL)
        named = f": {token[1][:60]}" if token else ""
        raise FormatError(f"3MF: {path[:80]!r} has a coordinate or an index that is not a number{named}.") from None
    return model


def _check_parts(found: int) -> None:
    if found > MOST_PARTS:
        raise LimitError(f"The 3MF file has more than {MOST_PARTS:,} parts.", limit=MOST_PARTS)


def _reference(attributes: dict[str, str], path: str) -> tuple[Key, Floats]:
    """(object, transform (4, 3)) of a component or build item; its path may lie in another model file."""
    other = next((value for name, value in attributes.items() if _local(name) == "path"), None)
    transform = IDENTITY
    if "transform" in attributes:
        values = [float(token) for token in attributes["transform"].split()]
        if len(values) != 12:
            raise FormatError(f"3MF: a transform has {counted(len(values), 'number')}, not 12.")
        transform = np.array(values).reshape(4, 3)
    return (path if other is None else _path(other), attributes["objectid"]), transform


def _after(first: Floats, second: Floats) -> Floats:
    """The transform (4, 3) that applies ``first``, then ``second``, to row vectors."""
    return np.vstack([first[:3] @ second[:3], first[3] @ second[:3] + second[3]])


def _assemble(model: _Model, limits: Limits) -> Mesh:
    vertices: list[Floats] = []
    faces: list[npt.NDArray[np.int64]] = []
    vertex_count = face_count = placed = 0
    waiting = [(key, transform, 0) for key, transform in reversed(model.items)]
    while waiting:
        key, transform, depth = waiting.pop()
        if key not in model.objects:
            raise FormatError(f"3MF: object {key[1][:40]!r} is used, but {key[0][:80]!r} does not define it.")
        if depth > MOST_NESTED:
            raise FormatError("3MF: components are nested too deeply, or contain themselves.")
        placed += 1
        _check_parts(placed)
        one = model.objects[key]
        vertices.append(one.vertices @ transform[:3] + transform[3])
        turned = np.linalg.det(transform[:3]) < 0
        below = [(k, _after(t, transform)) for k, t in one.components]
        if len(one.faces) and ((one.faces < 0) | (one.faces >= len(one.vertices))).any():
            worst = int(np.flatnonzero((one.faces < 0) | (one.faces >= len(one.vertices)))[0])
            raise FaceIndexOutOfRange(
                f"3MF: a triangle of object {key[1][:40]!r} refers to vertex {int(one.faces.flat[worst])}, "
                f"but the object has {counted(len(one.vertices), 'vertex')}.",
                vertex=int(one.faces.flat[worst]), vertices=len(one.vertices),
            )  # fmt: skip
        faces.append((one.faces[:, ::-1] if turned else one.faces) + vertex_count)
        vertex_count += len(one.vertices)
        face_count += len(one.faces)
        limits.check_vertices(vertex_count)
        limits.check_faces(face_count)
        waiting += [(k, t, depth + 1) for k, t in reversed(below)]
    if not face_count:
        raise NoFaces("The build of the 3MF file lists no object with triangles.")
    return build(np.concatenate(vertices), np.concatenate(faces).ravel(), np.full(face_count, 3), limits)
