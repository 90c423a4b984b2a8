"""The arrays of a glTF file: every count and offset is checked before it is used."""

from __future__ import annotations

import base64
import binascii
import re
from typing import Any
from urllib.parse import unquote_to_bytes

import numpy as np
import numpy.typing as npt

from reebase.errors import (
    ExternalReference,
    FaceIndexOutOfRange,
    FormatError,
    LimitError,
    TruncatedFile,
    UnsupportedFeature,
)
from reebase.mesh.read.limits import Limits
from reebase.words import counted

__all__ = ["Accessors", "field", "table"]

COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
MOST_RECORDS = 100_000
"""Of each kind: nodes, meshes, primitives of a mesh, ..."""
_DATA_URI = re.compile(r"data:[^,]{0,256}?(;base64)?,", re.ASCII)


def table(record: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """A list of objects, empty when it is missing. Raises FormatError, LimitError."""
    found = record.get(name, [])
    if not isinstance(found, list) or not all(isinstance(one, dict) for one in found):
        raise FormatError(f"glTF: {name} is not a list of objects.")
    if len(found) > MOST_RECORDS:
        raise LimitError(f"The glTF file has {len(found):,} {name}; the limit is {MOST_RECORDS:,}.")
    return found


def field(record: dict[str, Any], name: str, count: int, where: str) -> int | None:
    """A reference to one of ``count`` things, or None when it is missing. Raises FormatError."""
    found = record.get(name)
    if found is None:
        return None
    if not isinstance(found, int) or isinstance(found, bool) or not 0 <= found < count:
        raise FormatError(f"glTF: {where}.{name} is {str(found)[:40]!r}, not a number from 0 to {count - 1}.")
    return found


def _size(record: dict[str, Any], name: str, where: str, default: int | None = 0) -> int:
    found = record.get(name, default)
    if not isinstance(found, int) or isinstance(found, bool) or found < 0:
        raise FormatError(f"glTF: {where}.{name} is {str(found)[:40]!r}, not a number of bytes or items.")
    return found


class Accessors:
    """Reads accessors of a document; buffers are decoded when an accessor first needs them."""

    def __init__(self, document: dict[str, Any], binary: bytes | None, limits: Limits) -> None:
        self._accessors = table(document, "accessors")
        self._views = table(document, "bufferViews")
        self._buffers = table(document, "buffers")
        self._binary, self._limits = binary, limits
        self._decoded: dict[int, bytes] = {}
        self._vectors: dict[int, npt.NDArray[np.float64]] = {}

    def index(self, record: dict[str, Any], name: str, where: str) -> int:
        """A reference to an accessor that must be there."""
        found = field(record, name, len(self._accessors), where)
        if found is None:
            raise FormatError(f"glTF: {where}.{name} is missing.")
        return found

    def is_empty(self, at: int) -> bool:
        """Whether the accessor has no values of its own, as where an extension holds them compressed."""
        return self._accessors[at].get("bufferView") is None and "sparse" not in self._accessors[at]

    def vectors(self, at: int) -> npt.NDArray[np.float64]:
        """Positions, shape (count, 3)."""
        if at not in self._vectors:
            accessor = self._accessors[at]
            if accessor.get("type") != "VEC3":
                raise FormatError(f"glTF: accessors[{at}] holds positions but its type is not VEC3.")
            self._limits.check_vertices(_size(accessor, "count", f"accessors[{at}]", None))
            values = self._read(at, 3)
            found = values.astype(np.float64)
            if accessor.get("normalized") is True and values.dtype.kind in "iu":
                found = np.maximum(found / np.iinfo(values.dtype).max, -1.0)
            self._vectors[at] = found
        return self._vectors[at]

    def scalars(self, at: int) -> npt.NDArray[np.int64]:
        """Vertex numbers, shape (count,)."""
        accessor = self._accessors[at]
        if accessor.get("type") != "SCALAR" or accessor.get("componentType") not in (5121, 5123, 5125):
            raise FormatError(f"glTF: accessors[{at}] holds vertex numbers but is not of unsigned integers.")
        # A strip has about one index a triangle, a list has three.
        self._limits.check_faces(_size(accessor, "count", f"accessors[{at}]", None) // 3)
        return self._read(at, 1)[:, 0].astype(np.int64)

    @staticmethod
    def check_range(indices: npt.NDArray[np.int64], count: int, where: str) -> None:
        """Raises FaceIndexOutOfRange when a primitive refers to a vertex it does not have."""
        if len(indices) and int(indices.max()) >= count:
            raise FaceIndexOutOfRange(
                f"glTF: {where} refers to vertex {int(indices.max())}, but it has {counted(count, 'vertex')}.",
                vertex=int(indices.max()), vertices=count,
            )  # fmt: skip

    def _read(self, at: int, width: int) -> npt.NDArray[Any]:
        """The values of an accessor of ``width`` components, shape (count, width)."""
        accessor, where = self._accessors[at], f"accessors[{at}]"
        code = self._component(accessor, where)
        count = _size(accessor, "count", where, None)
        if accessor.get("bufferView") is None:
            values = np.zeros((count, width), dtype=code)
        else:
            values = self._view(accessor, code, count, width, where)
        sparse = accessor.get("sparse")
        if isinstance(sparse, dict):
            changed = _size(sparse, "count", f"{where}.sparse", None)
            parts = {name: sparse.get(name) for name in ("indices", "values")}
            if not all(isinstance(part, dict) for part in parts.values()):
                raise FormatError(f"glTF: {where}.sparse lacks indices or values.")
            rows_code = self._component(parts["indices"] or {}, f"{where}.sparse.indices")
            if rows_code[1] == "f":
                raise FormatError(f"glTF: {where}.sparse.indices are not integers.")
            rows = self._view(parts["indices"] or {}, rows_code, changed, 1, f"{where}.sparse.indices")[:, 0]
            if len(rows) and (int(rows.max()) >= count or int(rows.min()) < 0):
                raise FormatError(f"glTF: {where}.sparse.indices go beyond the accessor's {counted(count, 'item')}.")
            values = values.copy()
            values[rows] = self._view(parts["values"] or {}, code, changed, width, f"{where}.sparse.values")
        return values

    @staticmethod
    def _component(record: dict[str, Any], where: str) -> str:
        found = record.get("componentType")
        if not isinstance(found, int) or found not in COMPONENTS:
            raise FormatError(f"glTF: {where}.componentType is {str(found)[:40]!r}.")
        return COMPONENTS[found]

    def _view(
        self, record: dict[str, Any], code: str, count: int, width: int, where: str
    ) -> npt.NDArray[Any]:
        at = field(record, "bufferView", len(self._views), where)
        if at is None:
            raise FormatError(f"glTF: {where}.bufferView is missing.")
        view = self._views[at]
        buffer = field(view, "buffer", len(self._buffers), f"bufferViews[{at}]")
        if buffer is None:
            raise FormatError(f"glTF: bufferViews[{at}].buffer is missing.")
        extensions = view.get("extensions")
        if isinstance(extensions, dict) and any("meshopt" in str(name) for name in extensions):
            raise UnsupportedFeature("glTF: the mesh is compressed with meshopt, which is not read. Export it "
                "without compression.")
        data = self._buffer(buffer)
        start = _size(view, "byteOffset", f"bufferViews[{at}]")
        length = _size(view, "byteLength", f"bufferViews[{at}]", None)
        if start + length > len(data):
            raise TruncatedFile(
                f"glTF: bufferViews[{at}] ends at byte {start + length:,}, but its buffer has {len(data):,}."
            )
        offset = _size(record, "byteOffset", where)
        item = np.dtype(code).itemsize
        stride = _size(view, "byteStride", f"bufferViews[{at}]") or width * item
        if stride < width * item:
            raise FormatError(f"glTF: bufferViews[{at}].byteStride is {stride}, less than one item.")
        if count and offset + stride * (count - 1) + width * item > length:
            raise TruncatedFile(
                f"glTF: {where} announces {counted(count, 'item')}, ending at byte "
                f"{offset + stride * (count - 1) + width * item:,} of a view of {length:,}.",
                announced=count,
            )  # fmt: skip
        if not count:
            return np.zeros((0, width), dtype=code)
        # The stride of a single item says nothing, and may be any number.
        return np.ndarray((count, width), code, data, start + offset, (stride if count > 1 else item, item))

    def _buffer(self, at: int) -> bytes:
        if at not in self._decoded:
            buffer = self._buffers[at]
            data = self._source(buffer, at)
            announced = _size(buffer, "byteLength", f"buffers[{at}]", None)
            if announced > len(data):
                raise TruncatedFile(f"glTF: buffers[{at}] announces {announced:,} bytes, has {len(data):,}.")
            self._decoded[at] = data
        return self._decoded[at]

    def _source(self, buffer: dict[str, Any], at: int) -> bytes:
        uri = buffer.get("uri")
        if uri is None:
            if at == 0 and self._binary is not None:
                return self._binary
            raise TruncatedFile(f"glTF: buffers[{at}] has no uri, and the file has no binary chunk for it.")
        if not isinstance(uri, str):
            raise FormatError(f"glTF: buffers[{at}].uri is not text.")
        head = _DATA_URI.match(uri)
        if head is None:
            raise ExternalReference(
                f"The geometry is in another file ({uri[:80]!r}), which does not come with this one. "
                "Send one file that holds everything: export as GLB, or as glTF with embedded buffers.",
                uri=uri[:200],
            )
        if head.group(1) is None:
            return unquote_to_bytes(uri[head.end() :])
        try:
            return base64.b64decode(uri[head.end() :])
        except (binascii.Error, ValueError):
            raise FormatError(f"glTF: buffers[{at}] is not valid base64.") from None
