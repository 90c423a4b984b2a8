"""3MF: build items, components across files, and archives that mean harm."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest

from reebase.errors import (
    ExpandsTooMuch,
    FaceIndexOutOfRange,
    FormatError,
    LimitError,
    NoFaces,
    NonFiniteVertices,
    TooManyFaces,
    TooManyVertices,
    TruncatedFile,
    UnsupportedFeature,
)
from reebase.mesh.read import Limits, read
from tests.shapes import tetrahedron

CORE = 'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"'
PRODUCTION = 'xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06"'
RELATIONS = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="r" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" Target="/{}"/></Relationships>'
)
TETRAHEDRON = tetrahedron()


def mesh_xml() -> str:
    vertices = "".join(f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>' for x, y, z in TETRAHEDRON.vertices.tolist())
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in TETRAHEDRON.faces.tolist())
    return f"<mesh><vertices>{vertices}</vertices><triangles>{faces}</triangles></mesh>"


def model(resources: str, build: str) -> str:
    inside = f"<resources>{resources}</resources><build>{build}</build>"
    return f'<?xml version="1.0"?><model {CORE} {PRODUCTION}>{inside}</model>'


def package(files: dict[str, str | bytes], compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", compression) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return stream.getvalue()


def simple(content: str | bytes, path: str = "3D/3dmodel.model") -> bytes:
    return package({"_rels/.rels": RELATIONS.format(path), path: content})


ONE = model(f'<object id="1">{mesh_xml()}</object>', '<item objectid="1"/>')


@pytest.mark.parametrize(
    "data",
    [
        simple(ONE),
        simple(ONE, "other/place.model"),
        package({"3d/3DModel.MODEL": ONE}),
        package({"_rels/.rels": RELATIONS.format("missing.model"), "x/y.model": ONE}),
        package({"3D/3dmodel.model": ONE, "Metadata/thumbnail.png": b"\x89PNG"}, zipfile.ZIP_STORED),
        simple(ONE.replace("<vert", "<c:vert").replace("</vert", "</c:vert").replace(CORE, CORE + " xmlns:c='x'")),
        simple(ONE.encode("utf-16")),
    ],
)
def test_packages(data: bytes) -> None:
    for form in ("3mf", None):
        mesh = read(data, form)
        assert np.array_equal(mesh.vertices, TETRAHEDRON.vertices)
        assert np.array_equal(mesh.faces, TETRAHEDRON.faces)


def test_items_components_and_their_transforms() -> None:
    resources = (
        f'<object id="7">{mesh_xml()}</object><object id="8"><components>'
        '<component objectid="7" transform="1 0 0 0 1 0 0 0 1 10 0 0"/><component objectid="7"/></components></object>'
    )
    build = '<item objectid="8" transform="0 1 0 -1 0 0 0 0 2 0 0 5"/><item objectid="7"/>'
    mesh = read(simple(model(resources, build)))
    turn = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 2]], dtype=float)  # row vectors, as 3MF writes them
    points = TETRAHEDRON.vertices
    expected = [(points + np.array([10, 0, 0])) @ turn + [0, 0, 5], points @ turn + [0, 0, 5], points]
    assert mesh.vertices == pytest.approx(np.concatenate(expected))
    assert mesh.faces.tolist() == np.concatenate([TETRAHEDRON.faces + 4 * i for i in range(3)]).tolist()


def test_objects_in_other_files_with_the_same_number() -> None:
    shift = 'transform="1 0 0 0 1 0 0 0 1 {} 0 0"'
    part = model(f'<object id="1">{mesh_xml()}</object>', "")
    inner = model('<object id="1"><components><component p:path="/3D/B.model" objectid="1"/></components></object>', "")
    build = "".join(
        f'<item p:path="/3D/{name}.model" objectid="1" {shift.format(10 * i)}/>' for i, name in enumerate("ABC")
    )
    files = {"3D/3dmodel.model": model("", build), "3D/A.model": part, "3D/B.model": part, "3D/C.model": inner}
    mesh = read(package(files))
    expected = [TETRAHEDRON.vertices + np.array([10 * i, 0, 0]) for i in range(3)]
    assert mesh.vertices == pytest.approx(np.concatenate(expected))


def test_a_mirrored_item_keeps_facing_out() -> None:
    mesh = read(simple(ONE.replace('objectid="1"', 'objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 0"')))
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    assert np.einsum("ij,ij->", np.cross(a, b), c) / 6 == pytest.approx(8 / 3)


ENTITY = '<?xml version="1.0"?><!DOCTYPE m [<!ENTITY a "aaaa">]>' + ONE.partition("?>")[2].replace("1.0", "&a;")
OUTSIDE = '<?xml version="1.0"?><!DOCTYPE m SYSTEM "file:///etc/passwd">' + ONE.partition("?>")[2]


@pytest.mark.parametrize(
    ("data", "error", "message"),
    [
        (simple(ENTITY), FormatError, "entities, which are refused"),
        (simple(OUTSIDE), FormatError, "refused"),
        (simple(ONE[:-20]), FormatError, "not well-formed"),
        (simple(b""), FormatError, "not well-formed"),
        (simple(ONE.replace('<?xml version="1.0"?>', '<?xml version="1.0" encoding="odd"?>')), FormatError, "encoding"),
        (simple(ONE.replace('v2="', 'w2="', 1)), FormatError, "lacks its attribute 'v2'"),
        (simple(ONE.replace('x="1.0"', 'x="one"', 1)), FormatError, "not a number: 'one'"),
        (simple(ONE.replace('x="1.0"', 'x="nan"', 1)), NonFiniteVertices, "vertex 0"),
        (simple(ONE.replace('v1="0"', 'v1="9"', 1)), FaceIndexOutOfRange, "vertex 9"),
        (simple(ONE.replace('v1="0"', 'v1="-1"', 1)), FaceIndexOutOfRange, "vertex -1"),
        (simple(ONE.replace('v1="0"', f'v1="{10**30}"', 1)), FormatError, "."),
        (simple(ONE.replace('<item objectid="1"/>', "")), NoFaces, "build"),
        (simple(ONE.replace('<item objectid="1"/>', '<item objectid="2"/>')), FormatError, "does not define"),
        (simple(ONE.replace('<item objectid="1"', '<item objectid="1" transform="1 0"')), FormatError, "2 numbers"),
        (simple(ONE.replace("<item ", '<item p:path="/3D/away.model" ')), FormatError, "'3d/away.model' is missing"),
        (package({"a.txt": "hello"}), FormatError, "is it a 3MF"),
        (simple(ONE)[:-30], TruncatedFile, "directory"),
        (package({"3D/3dmodel.model": ONE}, zipfile.ZIP_LZMA), UnsupportedFeature, "method 14"),
        (simple(model('<object id="1"/>' * 100_001, "")), LimitError, "100,000"),
    ],
    ids=lambda value: None if isinstance(value, bytes) else str(getattr(value, "code", "")),
)
def test_refusals(data: bytes, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        read(data, "3mf")


def test_encrypted_parts_are_named_as_such() -> None:
    data = bytearray(package({"3D/3dmodel.model": ONE}))
    data[6] |= 1
    data[data.rindex(b"PK\x01\x02") + 8] |= 1
    with pytest.raises(UnsupportedFeature, match="encrypted"):
        read(bytes(data), "3mf")


def test_a_damaged_part_is_noticed() -> None:
    data = bytearray(simple(ONE))
    at = data.index(b"3D/3dmodel.model") + 40
    data[at] ^= 0xFF
    with pytest.raises(FormatError, match="damaged"):
        read(bytes(data), "3mf")


def test_a_bomb_is_refused_by_its_directory() -> None:
    data = package({"3D/3dmodel.model": ONE, "3D/zeros.model": bytes(3 << 20)})
    assert len(data) < 5000
    with pytest.raises(ExpandsTooMuch, match="limit is 2,097,152"):
        read(data, "3mf", limits=Limits(expanded_bytes=2 << 20))


def test_a_bomb_whose_directory_lies_is_refused_while_inflating() -> None:
    # Many files that are small by the directory, and inflate to the same large part again and again.
    parts = {f"3D/{i}.model": model("", "") + " " * (1 << 20) for i in range(6)}
    build = "".join(f'<item p:path="/3D/{i}.model" objectid="1"/>' for i in range(6))
    data = package({"3D/3dmodel.model": model("", build), **parts})
    honest = (len(parts["3D/0.model"])).to_bytes(4, "little")
    assert data.count(honest) == 12
    lying = data.replace(honest, (1000).to_bytes(4, "little"))
    with pytest.raises((ExpandsTooMuch, FormatError)):
        read(lying, "3mf", limits=Limits(expanded_bytes=4 << 20))


def test_parts_that_overlap_are_counted_each_time() -> None:
    # One compressed part under many names, as in bombs without nesting: the directory's sum tells.
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", ONE)
        archive.writestr("3D/0.model", bytes(1 << 20))
        first = archive.getinfo("3D/0.model")
        for i in range(1, 64):
            clone = zipfile.ZipInfo(f"3D/{i}.model")
            for name in ("compress_type", "CRC", "compress_size", "file_size", "header_offset"):
                setattr(clone, name, getattr(first, name))
            archive.filelist.append(clone)
            archive.NameToInfo[clone.filename] = clone
    with pytest.raises(ExpandsTooMuch):
        read(stream.getvalue(), "3mf", limits=Limits(expanded_bytes=32 << 20))


def test_components_cannot_multiply_or_contain_themselves() -> None:
    twice = '<components><component objectid="{0}"/><component objectid="{0}"/></components>'
    doubling = f'<object id="0">{mesh_xml()}</object>' + "".join(
        f'<object id="{i}">{twice.format(i - 1)}</object>' for i in range(1, 40)
    )
    with pytest.raises(TooManyVertices):
        read(simple(model(doubling, '<item objectid="39"/>')), limits=Limits(vertices=1000))
    with pytest.raises(TooManyFaces):
        read(simple(model(doubling, '<item objectid="39"/>')), limits=Limits(faces=1000))
    empty = doubling.replace(mesh_xml(), "")
    with pytest.raises(LimitError):
        read(simple(model(empty, '<item objectid="39"/>')))
    ring = (
        '<object id="1"><components><component objectid="2"/></components></object>'
        '<object id="2"><components><component objectid="1"/></components></object>'
    )
    with pytest.raises(FormatError, match="contain themselves"):
        read(simple(model(ring, '<item objectid="1"/>')))


def test_limits_hold_while_the_model_is_parsed() -> None:
    with pytest.raises(TooManyVertices):
        read(simple(ONE), limits=Limits(vertices=3))
    with pytest.raises(TooManyFaces):
        read(simple(ONE), limits=Limits(faces=3))
