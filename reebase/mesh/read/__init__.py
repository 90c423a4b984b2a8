"""Reads mesh files: OBJ, OFF, PLY, STL, GLB, glTF and 3MF, from a path or from bytes.

Files come from strangers. So every reader works on bytes alone and opens nothing that a file refers to;
announced counts are held against the file's size before anything is allocated; archives are judged while
they are inflated; XML entities are refused. What comes out is a Mesh, or one of ReebaseError's children.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import numpy.typing as npt

from reebase.errors import EmptyFile, FormatError, LimitError, NoFaces, TruncatedFile, UnknownFormat
from reebase.mesh.mesh import Mesh
from reebase.mesh.read.foreign import in_words
from reebase.mesh.read.gltf import read_gltf
from reebase.mesh.read.limits import DEFAULT, Limits
from reebase.mesh.read.obj import read_obj
from reebase.mesh.read.off import read_off
from reebase.mesh.read.ply import read_ply, read_ply_scalars
from reebase.mesh.read.sniff import FORMATS, canonical, sniff
from reebase.mesh.read.stl import read_stl
from reebase.mesh.read.threemf import read_3mf

__all__ = ["FORMATS", "Limits", "read", "read_scalars", "sniff"]

_READERS = {
    "obj": read_obj,
    "off": read_off,
    "ply": read_ply,
    "stl": read_stl,
    "glb": read_gltf,
    "gltf": read_gltf,
    "3mf": read_3mf,
}


def read(
    source: str | os.PathLike[str] | bytes, format: str | None = None, *, limits: Limits = DEFAULT
) -> Mesh:
    """The mesh in a file: its vertices and faces in their order, in its units, nothing merged or removed.

    source: a path, or the bytes of a file. format: a name of FORMATS, a suffix or a media type; when it is
    not given it comes from the content and the path's suffix (see ``sniff``).
    Polygons are triangulated, transforms of scenes are applied, lines and points are passed over.

    Raises OSError when a path cannot be read; FormatError when the bytes are not well formed, MeshError
    when they hold no usable surface, LimitError when they are over the limits.
    """
    name = None
    if isinstance(source, bytes | bytearray | memoryview):
        data = bytes(source)
        limits.check_bytes(len(data))
    else:
        path = Path(source)
        name = path.name
        with path.open("rb") as stream:
            limits.check_bytes(os.fstat(stream.fileno()).st_size)
            data = stream.read(limits.bytes + 1)
        limits.check_bytes(len(data))
    if not data:
        raise EmptyFile()
    chosen = canonical(format) if format else sniff(data, name)
    try:
        # Numbers beyond float32 or float64 become infinite and are refused as such.
        with np.errstate(all="ignore"):
            return _READERS[chosen](data, limits)
    except (FormatError, NoFaces) as refusal:
        # A format that was given is obeyed; that the file is something else altogether says more than its faults.
        told = in_words(data) if refusal.code in (FormatError.code, TruncatedFile.code, NoFaces.code) else None
        if told is None:
            raise
        raise UnknownFormat(f"{told} It was read as {chosen.upper()}.", formats=list(FORMATS)) from refusal
    except MemoryError:
        raise LimitError(f"Reading these {len(data):,} bytes takes more memory than there is.") from None


def read_scalars(data: bytes, *, limits: Limits = DEFAULT) -> tuple[Mesh, dict[str, npt.NDArray[np.float64]]]:
    """The mesh of a PLY file and every further scalar property of its vertices, float64, shape (m,).

    The inverse of ``to_bytes(mesh, "ply", scalars=...)``. Raises as ``read`` does.
    """
    limits.check_bytes(len(data))
    if not data:
        raise EmptyFile()
    if sniff(data) != "ply":
        raise FormatError("Scalars are read from PLY files only.")
    with np.errstate(all="ignore"):
        return read_ply_scalars(data, limits)
