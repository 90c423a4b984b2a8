"""Which format a file has: by what it holds first, by its name where that does not tell."""

from __future__ import annotations

import re
from pathlib import PurePath

from reebase.errors import UnknownFormat
from reebase.mesh.read import archive, gltf
from reebase.mesh.read.foreign import in_words
from reebase.mesh.read.off import HEADER as OFF_HEADER
from reebase.mesh.read.stl import is_text, looks_like_text_stl
from reebase.mesh.read.text import plain_text, without_comments

__all__ = ["FORMATS", "canonical", "sniff"]

FORMATS: dict[str, str] = {
    "obj": "model/obj",
    "off": "model/off",
    "ply": "model/ply",
    "stl": "model/stl",
    "glb": "model/gltf-binary",
    "gltf": "model/gltf+json",
    "3mf": "model/3mf",
}
"""Every format that is read: name -> media type."""

_OTHER_NAMES = {
    "application/sla": "stl", "application/vnd.ms-pki.stl": "stl",
    "model/x.stl-binary": "stl", "model/x.stl-ascii": "stl",
    "text/prs.wavefront-obj": "obj", "application/x-ply": "ply", "stla": "stl", "stlb": "stl", "coff": "off",
    "application/vnd.ms-package.3dmanufacturing-3dmodel+xml": "3mf",
}  # fmt: skip
_OBJ_LINE = re.compile(
    rb"(?m)^[ \t]*(v[ \t]+[-+.\d]+[ \t]+[-+.\d]|f[ \t]+-?\d+(/|[ \t]+-?\d)|(mtllib|usemtl)[ \t]+\S)"
)
_COUNTS = re.compile(rb"\s*\d+[ \t]+\d+([ \t]+\d+)?[ \t]*\r?\n\s*[-+.\deE]+[ \t]+[-+.\deE]+[ \t]+[-+.\deE]+")
_GLTF_KEY = re.compile(rb'"(asset|accessors|bufferViews|buffers|meshes|nodes|scenes?)"\s*:')
START = 65536
"""Bytes that are looked at (a text STL that has no facet among them, nor later, is empty)."""


def canonical(name: str) -> str:
    """The format for a name, suffix or media type: "OBJ", ".obj", "model/obj". Raises UnknownFormat."""
    asked = name.partition(";")[0].strip().lower().removeprefix(".")
    for known, media_type in FORMATS.items():
        if asked in (known, media_type):
            return known
    if asked in _OTHER_NAMES:
        return _OTHER_NAMES[asked]
    raise UnknownFormat(
        f"Reebase does not read {name[:40]!r}; it reads {_listed()}.", found=name[:40], formats=list(FORMATS)
    )


def sniff(data: bytes, name: str | None = None, *, size: int | None = None) -> str:
    """The format of a file, one of FORMATS, from its first bytes and its name (a path or file name).

    What starts with a signature (PLY, GLB, zip, OFF, solid ... facet) or else cannot be anything else is that format
    under any name; then the name's suffix decides; else the content is looked at more closely.

    data: the file, or its first START bytes when ``size``, the whole file's, is given: a binary STL has no
    signature and is known by its size. Raises UnknownFormat, which says what the file is where that can be told.
    """
    if signed := _signed(data):
        return signed
    whole = len(data) if size is None else size
    if _is_binary_stl(data, whole):
        return "stl"
    suffix = PurePath(name).suffix if name else ""
    try:
        named = canonical(suffix)
    except UnknownFormat:
        named = None
    told = in_words(data, None if named else name)
    if told is None:
        if found := _guessed_text(data) or named or _guessed_binary(data, whole):
            return found
        ending = f"the name ends in {suffix[:20]!r} and " if suffix else ""
        told = f"The format is not one that Reebase reads: {ending}the content is none of {_listed()}."
    elif named:
        told = f"{told} Its name says {_shown(named)}."
    else:
        told = f"{told} Reebase reads {_listed()}."
    raise UnknownFormat(told, found=suffix[:20], formats=list(FORMATS))


def _shown(name: str) -> str:
    return name.upper() if name != "gltf" else "glTF"


def _listed() -> str:
    return ", ".join(map(_shown, FORMATS))


def _signed(data: bytes) -> str | None:
    """The format that the file's first bytes announce."""
    if data.startswith(gltf.MAGIC):
        return "glb"
    if data.startswith(archive.MAGIC):
        return "3mf"
    if re.match(rb"(?:\xef\xbb\xbf)?(?i:ply)[ \t]*[\r\n]", data):
        return "ply"
    start = data[:START]
    if OFF_HEADER.match(start) or (is_text(start) and OFF_HEADER.match(without_comments(plain_text(start)))):
        return "off"
    if looks_like_text_stl(data):
        return "stl"
    return None


def _announced(data: bytes) -> int:
    """The triangles of a binary STL by its header, 0 when it is too short for one."""
    return int.from_bytes(data[80:84], "little") if len(data) >= 84 else 0


def _is_binary_stl(data: bytes, size: int) -> bool:
    """Whether the file is exactly as long as a binary STL of so many triangles; its header may say anything."""
    announced = _announced(data)
    return announced > 0 and announced * 50 + 84 == size


def _guessed_text(data: bytes) -> str | None:
    """The format that a text looks like."""
    start = plain_text(data[:START])
    if not is_text(start):
        return None
    if start.lstrip().startswith(b"{"):
        return "gltf" if _GLTF_KEY.search(start) else None
    text = without_comments(start)
    if _OBJ_LINE.search(text):
        return "obj"
    return "off" if _COUNTS.match(text) else None


def _guessed_binary(data: bytes, size: int) -> str | None:
    """A binary STL with something behind its triangles, perhaps."""
    announced = _announced(data)
    fits = announced > 0 and announced * 50 + 84 <= size
    return "stl" if fits and not is_text(plain_text(data[:START])) else None
