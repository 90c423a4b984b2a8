"""Files that are no mesh of ours: named for what they are, with what to do."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import struct
import time
import zipfile

import numpy as np
import pytest

from reebase.errors import UnknownFormat, UnsupportedFeature
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import FORMATS, read, sniff
from reebase.mesh.write import to_bytes
from tests.shapes import icosphere, tetrahedron

OBJ = to_bytes(tetrahedron(), "obj")
LFS = b"version https://git-lfs.github.com/spec/v1\noid sha256:" + 64 * b"0" + b"\nsize 1234\n"
COLLADA = (
    b'<?xml version="1.0"?>\n<!-- made by hand -->\n'
    b'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"/>'
)


def zipped(*names: str) -> bytes:
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w") as archive:
        for name in names:
            archive.writestr(name, b"")
    return held.getvalue()


FOREIGN = {
    "lfs": (LFS, "git lfs pull"),
    "gzip": (gzip.compress(OBJ), "gzip. Unpack it"),
    "bzip2": (bz2.compress(OBJ), "bzip2. Unpack it"),
    "xz": (lzma.compress(OBJ), "xz. Unpack it"),
    "collada": (COLLADA, r"Collada \(DAE\).*export it as GLB"),
    "x3d": (b"<?xml version='1.0'?><!DOCTYPE X3D PUBLIC 'x' 'y'><X3D></X3D>", "X3D file.*export it as GLB"),
    "vrml": (b"#VRML V2.0 utf8\nShape { geometry Box {} }", "VRML.*export"),
    "fbx": (b"Kaydara FBX Binary  \x00\x1a\x00" + bytes(90), "FBX.*[Ee]xport"),
    "3ds": (b"MM" + struct.pack("<I", 99) + b"\x02\x00" + bytes(90), "3DS.*export"),
    "step": (b"ISO-10303-21;\nHEADER;\n", "STEP.*solids.*STL"),
    "blend": (b"BLENDER-v300" + bytes(90), "Blender.*[Ee]xport"),
    "usd": (b"PXR-USDC" + bytes(90), "USD.*[Ee]xport"),
    "points": (b"# .PCD v0.7 - Point Cloud Data file format\n", "points without a surface"),
    "picture": (b"\x89PNG\r\n\x1a\n" + bytes(90), "picture"),
    "page": (b"\n<!DOCTYPE html>\n<html></html>", "web page"),
}


@pytest.mark.parametrize("name", ["thing", "thing.bin", *(f"thing.{suffix}" for suffix in FORMATS)])
@pytest.mark.parametrize("data, words", FOREIGN.values(), ids=FOREIGN)
def test_content_is_named_under_any_name(data: bytes, words: str, name: str) -> None:
    with pytest.raises(UnknownFormat, match=words) as caught:
        sniff(data, name)
    assert caught.value.code == "unknown_format"
    assert caught.value.details["formats"] == list(FORMATS)


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("data, words", FOREIGN.values(), ids=FOREIGN)
def test_content_is_named_when_a_format_was_given(data: bytes, words: str, format: str) -> None:
    with pytest.raises(UnknownFormat, match=words):
        read(data, format)


@pytest.mark.parametrize("suffix, words", [("xyz", "points"), ("igs", "IGES"), ("max", "3ds Max"), ("mtl", "OBJ")])
def test_a_name_tells_where_the_content_does_not(suffix: str, words: str) -> None:
    with pytest.raises(UnknownFormat, match=words):
        sniff(b"1.0 2.0 3.0\n4.0 5.0 6.0\n", f"thing.{suffix}")


@pytest.mark.parametrize(
    "names, words",
    [
        (["deep/inside/Model.OBJ", "deep/inside/model.mtl"], "holds the mesh 'model.obj'. Unpack it"),
        (["one.stl", "two.stl"], "holds 2 meshes"),
        (["scene.usdc", "picture.png"], "USD"),
        (["word/document.xml"], "is it a 3MF file"),
    ],
)
def test_archives_say_what_they_hold(names: list[str], words: str) -> None:
    with pytest.raises(UnknownFormat, match=words):
        read(zipped(*names), "3mf")


@pytest.mark.parametrize("named", [name for name in FORMATS if name != "obj"])
def test_a_text_under_a_wrong_name_is_read_as_what_it_is(named: str) -> None:
    assert sniff(OBJ, f"thing.{named}") == "obj"


def test_a_binary_stl_is_known_by_its_length_whatever_its_name_and_header_say() -> None:
    data = to_bytes(icosphere(1), "stl")
    for header in (b"", b"solid", b"FORM    LWO2", b"\x1f\x8b", b"{}"):
        disguised = header + bytes(80 - len(header)) + data[80:]
        for name in ("thing.obj", "thing.ply", None):
            assert sniff(disguised, name) == "stl"


@pytest.mark.parametrize("data", [b"glTF" + struct.pack("<4I", 1, 20, 0, 0), b'{"asset": {"version": "1.0"}}'])
def test_gltf_1_is_refused_with_a_way_out(data: bytes) -> None:
    with pytest.raises(UnsupportedFeature, match="gltf-pipeline") as caught:
        read(data)
    assert caught.value.details["version"] == "1.0"


def test_a_line_continued_with_blanks_behind_the_backslash() -> None:
    data = b"v 0 0 0\r\nv 1 0 0\r\nv 0 1 0\r\nf 1 \\ \r\n 2 3\r\n"
    mesh = read(data, "obj")
    assert isinstance(mesh, Mesh)
    assert np.array_equal(mesh.faces, [[0, 1, 2]])


@pytest.mark.parametrize("start", [b"<!-- -->" * 24, b" \n" * 2000], ids=["comments", "blanks"])
def test_what_cannot_be_told_costs_no_time(start: bytes) -> None:
    begin = time.process_time()
    with pytest.raises(UnknownFormat):
        sniff(start + b"?")
    assert time.process_time() - begin < 0.1
