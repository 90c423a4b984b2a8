"""glTF and GLB: scenes, transforms, strips and fans, and no step outside the file."""

from __future__ import annotations

import base64
import copy
import json
import tracemalloc
from typing import Any

import numpy as np
import pytest

from reebase.errors import (
    ExternalReference,
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

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 2, 2]], dtype="<f4")
INDICES = np.array([0, 1, 2, 0, 2, 3], dtype="<u2")
RAW = POINTS.tobytes() + INDICES.tobytes()
INSTANCED = {"extensions": {"EXT_mesh_gpu_instancing": {}}}


def document(**changes: Any) -> dict[str, Any]:
    """A square of two triangles, and a fifth vertex; buffer 0 without uri."""
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 5, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 60},
            {"buffer": 0, "byteOffset": 60, "byteLength": 12},
        ],
        "buffers": [{"byteLength": 72}],
        **changes,
    }


def glb(record: dict[str, Any], binary: bytes = RAW) -> bytes:
    text = json.dumps(record).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = b"".join(
        len(part).to_bytes(4, "little") + kind + part for kind, part in ((b"JSON", text), (b"BIN\0", binary)) if part
    )
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks


def embedded(record: dict[str, Any], raw: bytes = RAW) -> bytes:
    uri = "data:application/octet-stream;base64," + base64.b64encode(raw).decode()
    return json.dumps({**record, "buffers": [{"byteLength": len(raw), "uri": uri}]}).encode()


def changed(path: str, value: Any) -> dict[str, Any]:
    """The document with one entry replaced: "accessors.0.count"."""
    record = document()
    *parents, last = path.split(".")
    place: Any = record
    for step in parents:
        place = place[int(step) if isinstance(place, list) else step]
    place[int(last) if isinstance(place, list) else last] = value
    return record


def primitives(*listed: dict[str, Any]) -> dict[str, Any]:
    return document(meshes=[{"primitives": [{"attributes": {"POSITION": 0}, **one} for one in listed]}])


@pytest.mark.parametrize("data", [glb(document()), embedded(document()), b"\xef\xbb\xbf" + embedded(document())])
def test_containers(data: bytes) -> None:
    for form in ("glb", "gltf", None):
        mesh = read(data, form)
        assert np.array_equal(mesh.vertices, POINTS)
        assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_a_percent_encoded_buffer() -> None:
    uri = "data:application/gltf-buffer," + "".join(f"%{byte:02x}" for byte in RAW)
    assert len(read(json.dumps(document(buffers=[{"byteLength": 72, "uri": uri}])).encode()).faces) == 2


def test_primitives_share_vertices_when_they_share_positions() -> None:
    mesh = read(glb(primitives({"indices": 1}, {"indices": 1})))
    assert len(mesh.vertices) == 5
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]] * 2


@pytest.mark.parametrize(
    ("mode", "indices", "faces"),
    [
        (4, [0, 1, 2, 0, 2, 3], [[0, 1, 2], [0, 2, 3]]),
        (4, [0, 1, 2, 0, 2], [[0, 1, 2]]),
        (5, [0, 1, 3, 2], [[0, 1, 3], [2, 3, 1]]),
        (6, [0, 1, 2, 3], [[1, 2, 0], [2, 3, 0]]),
        (6, [0, 1], None),
        (5, [0, 1], None),
    ],
)
def test_modes(mode: int, indices: list[int], faces: list[list[int]] | None) -> None:
    record = primitives({"indices": 1, "mode": mode})
    record["accessors"][1]["count"] = len(indices)
    data = glb(record, POINTS.tobytes() + np.array([*indices, 0, 0, 0, 0], dtype="<u2")[:6].tobytes())
    if faces is None:
        with pytest.raises(NoFaces):
            read(data)
    else:
        assert read(data).faces.tolist() == faces


@pytest.mark.parametrize("mode", [0, 1, 2, 3])
def test_points_and_lines_are_no_surface_and_need_no_buffer(mode: int) -> None:
    away = {"buffers": [{"byteLength": 72, "uri": "away.bin"}]}
    with pytest.raises(NoFaces):
        read(json.dumps({**primitives({"mode": mode}), **away}).encode(), "gltf")
    both = read(glb(primitives({"mode": mode}, {"indices": 1})))
    assert len(both.faces) == 2


def test_without_indices_every_three_vertices_are_a_triangle() -> None:
    mesh = read(glb(primitives({})))
    assert mesh.faces.tolist() == [[0, 1, 2]]
    assert len(mesh.vertices) == 5


def test_images_and_textures_that_are_missing_do_not_matter() -> None:
    record = document(
        images=[{"uri": "../../etc/passwd"}, {"bufferView": 99}], textures=[{"source": 7}], materials=[{"bogus": 1}],
        buffers=[{"byteLength": 72}, {"byteLength": 9, "uri": "http://example.org/skin.bin"}],
    )  # fmt: skip
    record["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = 99
    assert len(read(glb(record)).faces) == 2


@pytest.mark.parametrize(
    "uri", ["box.bin", "../../etc/passwd", "file:///etc/passwd", "http://example.org/a.bin", "/dev/zero"]
)
def test_geometry_elsewhere_is_refused(uri: str) -> None:
    with pytest.raises(ExternalReference, match="GLB") as caught:
        read(json.dumps(document(buffers=[{"byteLength": 72, "uri": uri}])).encode(), "gltf")
    assert caught.value.details["uri"] == uri


def transformed(*nodes: dict[str, Any]) -> np.ndarray:
    return read(glb(document(nodes=list(nodes)))).vertices


def test_transforms_of_nodes_are_applied_from_the_leaf_up() -> None:
    half = float(np.sqrt(0.5))
    found = transformed(
        {"children": [1], "translation": [10, 0, 0], "rotation": [0, 0, half, half]},
        {"mesh": 0, "scale": [2, 3, 4]},
    )
    scaled = POINTS.astype(float) * [2, 3, 4]
    turned = np.stack([-scaled[:, 1], scaled[:, 0], scaled[:, 2]], axis=1)  # a quarter turn about z
    assert found == pytest.approx(turned + np.array([10, 0, 0]))
    columns = np.array([[1, 2, 0, 5], [0, 1, 0, 6], [0, 0, 3, 7], [0, 0, 0, 1]], dtype=float)
    found = transformed({"mesh": 0, "matrix": columns.T.ravel().tolist()})
    assert found == pytest.approx(POINTS @ columns[:3, :3].T + columns[:3, 3])


def test_mirrors_turn_the_faces_so_that_they_keep_facing_out() -> None:
    mesh = read(glb(document(nodes=[{"mesh": 0, "scale": [-1, 1, 1]}])))
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()


def test_instances_and_scenes_in_their_order() -> None:
    nodes = [
        {"mesh": 0, "translation": [100, 0, 0]}, {"children": [2, 3]}, {"mesh": 0, "translation": [200, 0, 0]},
        {"mesh": 0, "translation": [300, 0, 0]}, {"mesh": 0, "translation": [999, 0, 0]},
    ]  # fmt: skip
    mesh = read(glb(document(nodes=nodes, scene=1, scenes=[{"nodes": [4]}, {"nodes": [1, 0]}])))
    assert mesh.vertices[::5, 0].tolist() == [200, 300, 100]
    assert mesh.faces[::2].tolist() == [[0, 1, 2], [5, 6, 7], [10, 11, 12]]
    record = document(nodes=nodes)
    del record["scene"], record["scenes"]
    assert read(glb(record)).vertices[::5, 0].tolist() == [100, 200, 300, 999]


def test_strides_offsets_and_quantised_positions() -> None:
    raw = np.zeros(4, dtype=[("pad", "<i2"), ("p", "<i2", 3), ("q", "<i2")])
    raw["p"] = [[0, 0, 0], [32767, 0, 0], [32767, -32768, 0], [0, 16384, 0]]
    record = document(
        accessors=[
            {"bufferView": 0, "byteOffset": 2, "componentType": 5122, "count": 4, "type": "VEC3", "normalized": True},
            {"bufferView": 1, "componentType": 5121, "count": 3, "type": "SCALAR"},
        ],
        bufferViews=[
            {"buffer": 0, "byteLength": 40, "byteStride": 10},
            {"buffer": 0, "byteOffset": 40, "byteLength": 3},
        ],
    )
    mesh = read(glb(record, raw.tobytes() + bytes([0, 1, 3]) + b"\0" * 29))
    assert mesh.vertices == pytest.approx(np.array([[0, 0, 0], [1, 0, 0], [1, -1, 0], [0, 16384 / 32767, 0]]))
    assert mesh.faces.tolist() == [[0, 1, 3]]


def test_sparse_accessors() -> None:
    sparse = {
        "count": 2,
        "indices": {"bufferView": 2, "componentType": 5121},
        "values": {"bufferView": 3},
    }
    raw = RAW + bytes([1, 3, 0, 0]) + np.array([[7, 8, 9], [4, 5, 6]], dtype="<f4").tobytes()
    record = changed("accessors.0.sparse", sparse)
    record["bufferViews"] += [
        {"buffer": 0, "byteOffset": 72, "byteLength": 2}, {"buffer": 0, "byteOffset": 76, "byteLength": 24},
    ]  # fmt: skip
    expected = POINTS.copy()
    expected[[1, 3]] = [[7, 8, 9], [4, 5, 6]]
    assert np.array_equal(read(glb(record, raw)).vertices, expected)
    del record["accessors"][0]["bufferView"]
    expected[[0, 2, 4]] = 0
    assert np.array_equal(read(glb(record, raw)).vertices, expected)
    with pytest.raises(FormatError, match="beyond the accessor's 5 items"):
        read(glb(record, raw[:73] + b"\x05" + raw[74:]))
    with pytest.raises(TruncatedFile):
        indices = {"bufferView": 1, "componentType": 5123}
        read(glb(changed("accessors.0.sparse", {"count": 2, "indices": indices, "values": {"bufferView": 1}})))


def test_draco_is_refused_unless_the_values_are_there_as_well() -> None:
    record = changed("meshes.0.primitives.0.extensions", {"KHR_draco_mesh_compression": {"bufferView": 0}})
    assert np.array_equal(read(glb(record)).vertices, POINTS)
    del record["accessors"][0]["bufferView"]
    with pytest.raises(UnsupportedFeature, match=r"Draco.*without compression"):
        read(glb(record))


def test_meshes_that_no_file_places_are_read_where_they_are() -> None:
    record = document()
    for name in ("scene", "scenes", "nodes"):
        del record[name]
    mesh = read(glb(record))
    assert np.array_equal(mesh.vertices, POINTS) and len(mesh.faces) == 2


@pytest.mark.parametrize(
    ("record", "error", "message"),
    [
        (changed("asset.version", "1.0"), UnsupportedFeature, "glTF 1.0"),
        (changed("asset", {}), FormatError, "asset.version"),
        (changed("scene", "hello"), FormatError, "scene is 'hello'"),
        (changed("scene", 3), FormatError, "scene"),
        (changed("scenes", {}), FormatError, "scenes is not a list"),
        (changed("nodes", [{"mesh": 0}, 7]), FormatError, "nodes is not a list of objects"),
        (changed("nodes", [{"mesh": 1}]), FormatError, "mesh is '1'"),
        (changed("nodes", [{"mesh": True}]), FormatError, "mesh"),
        (changed("nodes", [{"mesh": 0, "children": [0]}]), FormatError, "tree"),
        (changed("nodes", [{"children": [1, 1]}, {"mesh": 0}]), FormatError, "tree"),
        (changed("nodes", [{"children": {}}]), FormatError, "children"),
        (changed("nodes", [{"mesh": 0, "matrix": [1]}]), FormatError, "16 numbers"),
        (changed("nodes", [{"mesh": 0, "scale": [1, 2, "x"]}]), FormatError, "3 finite numbers"),
        (changed("nodes", [{"mesh": 0, "scale": [1e308, 1e308, 1e308]}]), FormatError, "3 finite numbers"),
        (changed("nodes", [{"mesh": 0, **INSTANCED}]), UnsupportedFeature, "instancing"),
        (changed("nodes", []), FormatError, "nodes is '0'"),
        (changed("meshes.0.primitives.0.mode", 7), FormatError, "mode is 7"),
        (changed("meshes.0.primitives.0.mode", "4"), FormatError, "mode is 4"),
        (changed("meshes.0.primitives.0.attributes", {}), NoFaces, "no triangles"),
        (changed("meshes.0.primitives.0.attributes", {"POSITION": 9}), FormatError, "POSITION"),
        (changed("meshes.0.primitives.0.attributes", {"POSITION": 1}), FormatError, "VEC3"),
        (changed("meshes.0.primitives.0.indices", 0), FormatError, "unsigned"),
        (changed("bufferViews.0.extensions", {"EXT_meshopt_compression": {}}), UnsupportedFeature, "meshopt"),
        (changed("accessors.0.count", 6), TruncatedFile, "announces 6 items"),
        (changed("accessors.0.count", 10**7), TooManyVertices, "."),
        (changed("accessors.0.count", -1), FormatError, "count"),
        (changed("accessors.0.count", 5.0), FormatError, "count"),
        (changed("accessors.1.count", 10**30), TooManyFaces, "."),
        (changed("accessors.0.componentType", 1), FormatError, "componentType"),
        (changed("accessors.0.bufferView", 5), FormatError, "bufferView"),
        (changed("accessors.0.byteOffset", 4), TruncatedFile, "announces"),
        (changed("bufferViews.0.byteOffset", 10**40), TruncatedFile, "ends at byte"),
        (changed("bufferViews.0.byteStride", 10**40), TruncatedFile, "announces"),
        (changed("bufferViews.0.byteStride", 4), FormatError, "byteStride"),
        (changed("bufferViews.0.buffer", 1), FormatError, "buffer"),
        (changed("buffers.0.byteLength", 10**9), TruncatedFile, "announces 1,000,000,000 bytes"),
        (changed("buffers.0.uri", 5), FormatError, "not text"),
        (changed("buffers.0.uri", "data:;base64,A"), FormatError, "base64"),
        (changed("nodes", [{}] * 100_001), LimitError, "100,001 nodes"),
    ],
    ids=lambda value: None if isinstance(value, dict) else str(getattr(value, "code", "")),
)
def test_refusals(record: dict[str, Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        read(glb(record), "glb")


@pytest.mark.parametrize(
    ("data", "error", "message"),
    [
        (b"glTF", TruncatedFile, "header of 20 bytes"),
        (glb(document())[:100], TruncatedFile, "announces"),
        (b"glTF" + (1).to_bytes(4, "little") + bytes(20), UnsupportedFeature, "glTF 1.0; Reebase reads glTF 2.0"),
        (glb(document()).replace(b"JSON", b"BIN\0"), FormatError, "first chunk"),
        (glb(document(), b""), TruncatedFile, "no binary chunk"),
        (b"\x12\xd3\xff" * 100, FormatError, "not a GLB file: it does not begin with the four bytes glTF"),
        (b'{"asset": {"version": "2.0"}, "x": "\xca"}', FormatError, "byte 36 is not UTF-8"),
        (b"{", TruncatedFile, "ends early"),
        (b"[]", FormatError, "not an object"),
        (b'{"asset" 1}', FormatError, "not well formed"),
        (b'{"asset": ' + b"[" * 100_000 + b"]" * 100_000 + b"}", FormatError, "too deeply"),
        (b'{"nodes": [' + b"9" * 5000 + b"]}", FormatError, "too many digits"),
    ],
    ids=lambda value: None if isinstance(value, bytes) else str(getattr(value, "code", "")),
)
def test_broken_containers(data: bytes, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        read(data, "gltf")


def test_indices_out_of_range_and_vertices_that_are_not_numbers() -> None:
    wrong = INDICES.copy()
    wrong[4] = 255
    with pytest.raises(FaceIndexOutOfRange, match="vertex 255, but it has 5 vertices"):
        read(glb(document(), POINTS.tobytes() + wrong.tobytes()))
    points = POINTS.copy()
    points[3, 1] = np.inf
    with pytest.raises(NonFiniteVertices, match="vertex 3"):
        read(glb(document(), points.tobytes() + INDICES.tobytes()))
    with pytest.raises(NonFiniteVertices):  # each number is finite, their product is not
        read(glb(document(nodes=[{"scale": [1e200] * 3, "children": [1]}, {"mesh": 0, "scale": [1e200] * 3}])))


def test_small_files_cannot_multiply() -> None:
    one = {"attributes": {"POSITION": 0}, "indices": 1, "mode": 5}
    many = document(meshes=[{"primitives": [copy.copy(one) for _ in range(2000)]}])
    with pytest.raises(TooManyFaces):
        read(glb(many), limits=Limits(faces=1000))
    with pytest.raises(TooManyVertices):
        read(glb(document(nodes=[{"mesh": 0}] * 20, scenes=[{"nodes": list(range(20))}])), limits=Limits(vertices=99))


def test_vertices_are_counted_before_they_are_gathered() -> None:
    """Accessors without a view are all zeros: a few bytes of JSON for each 24 MB."""
    zeros = {"componentType": 5126, "count": 10**6, "type": "VEC3"}
    none = {"componentType": 5125, "count": 0, "type": "SCALAR"}
    primitives = [{"attributes": {"POSITION": at}, "indices": 20} for at in range(20)]
    bomb = document(meshes=[{"primitives": primitives}], accessors=[zeros] * 20 + [none])
    tracemalloc.start()
    try:
        with pytest.raises(TooManyVertices):
            read(glb(bomb))
        assert tracemalloc.get_traced_memory()[1] < 200 * 2**20
    finally:
        tracemalloc.stop()
