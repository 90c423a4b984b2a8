"""What is written reads back: by us to the bit, and by another implementation."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from reebase.errors import FormatError, MeshError, NoFaces, ParameterError, UnknownName
from reebase.mesh.mesh import Mesh
from reebase.mesh.read import read, read_scalars
from reebase.mesh.write import WRITTEN, to_bytes, write
from tests.shapes import icosphere, tetrahedron

SINGLE = st.floats(width=32, allow_nan=False, allow_infinity=False)
DOUBLE = st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def meshes(draw: st.DrawFn, numbers: st.SearchStrategy[float]) -> Mesh:
    count = draw(st.integers(1, 8))
    vertices = draw(arrays(np.float64, (count, 3), elements=numbers))
    faces = draw(arrays(np.int32, (draw(st.integers(1, 6)), 3), elements=st.integers(0, count - 1)))
    return Mesh(vertices, faces)


@pytest.mark.parametrize("name", ["ply", "obj", "off"])
@given(mesh=meshes(DOUBLE))
def test_doubles_come_back_to_the_bit(name: str, mesh: Mesh) -> None:
    back = read(to_bytes(mesh, name))
    assert back.vertices.tobytes() == mesh.vertices.tobytes()
    assert np.array_equal(back.faces, mesh.faces)


@given(mesh=meshes(SINGLE))
def test_glb_comes_back_to_the_bit_of_float32(mesh: Mesh) -> None:
    back = read(to_bytes(mesh, "glb"))
    assert np.array_equal(back.vertices, mesh.vertices)
    assert np.array_equal(back.faces, mesh.faces)


@given(mesh=meshes(SINGLE))
def test_stl_comes_back_as_its_triangles(mesh: Mesh) -> None:
    back = read(to_bytes(mesh, "stl"))
    assert np.array_equal(back.vertices[back.faces], mesh.vertices[mesh.faces])


@given(mesh=meshes(DOUBLE), data=st.data())
def test_scalars_come_back_to_the_bit(mesh: Mesh, data: st.DataObject) -> None:
    names = data.draw(st.lists(st.sampled_from(["phi2", "_a", "Quality", "nx", "s_1"]), unique=True))
    scalars = {name: data.draw(arrays(np.float64, len(mesh.vertices), elements=st.floats())) for name in names}
    back, found = read_scalars(to_bytes(mesh, "ply", scalars=scalars))
    assert np.array_equal(back.vertices, mesh.vertices)
    assert list(found) == names
    for name in names:
        assert np.array_equal(found[name], scalars[name], equal_nan=True)


@pytest.mark.parametrize("name", WRITTEN)
def test_another_implementation_reads_the_same(name: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = icosphere(2)
    other = trimesh.load(io.BytesIO(to_bytes(mesh, name)), file_type=name, process=False, force="mesh")
    exact = name in ("ply", "obj", "off")
    triangles = mesh.vertices[mesh.faces] if exact else mesh.vertices.astype(np.float32)[mesh.faces]
    assert np.array_equal(other.vertices[other.faces], triangles)


def test_stl_has_unit_normals_and_does_not_start_like_text() -> None:
    mesh = tetrahedron()
    data = to_bytes(mesh, "stl")
    assert not data.lower().startswith(b"solid")
    record = np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")])
    normals = np.frombuffer(data, record, offset=84)["n"]
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    assert normals == pytest.approx(centres / np.linalg.norm(centres, axis=1, keepdims=True), abs=1e-6)
    flat = to_bytes(Mesh(np.zeros((3, 3)), np.array([[0, 1, 2]])), "stl")
    assert not np.frombuffer(flat, record, offset=84)["n"].any()


def test_glb_is_laid_out_as_the_specification_asks() -> None:
    mesh = icosphere(1)
    values = np.linspace(-1, 1, len(mesh.vertices))
    data = to_bytes(mesh, "glb", scalars={"phi2": values, "part": np.where(values > 0, values, np.nan)})
    assert int.from_bytes(data[8:12], "little") == len(data)
    assert len(data) % 4 == 0
    size = int.from_bytes(data[12:16], "little")
    record, binary = json.loads(data[20 : 20 + size]), data[28 + size :]
    attributes = record["meshes"][0]["primitives"][0]["attributes"]
    assert list(attributes) == ["POSITION", "_PHI2", "_PART", "_PART_MISSING"]
    assert record["buffers"][0]["byteLength"] == len(binary)

    def values_of(name: str) -> np.ndarray:
        view = record["bufferViews"][record["accessors"][attributes[name]]["bufferView"]]
        return np.frombuffer(binary, "<f4", view["byteLength"] // 4, view["byteOffset"])

    assert np.array_equal(values_of("_PHI2"), values.astype("<f4"))
    assert np.array_equal(values_of("_PART_MISSING"), (values <= 0).astype("<f4"))
    assert np.array_equal(values_of("_PART"), np.where(values > 0, values, 0).astype("<f4"))
    bounds = record["accessors"][attributes["POSITION"]]
    assert bounds["min"] == mesh.vertices.astype("<f4").min(axis=0).tolist()
    assert bounds["max"] == mesh.vertices.astype("<f4").max(axis=0).tolist()
    assert all(view["byteOffset"] % 4 == 0 for view in record["bufferViews"])


@pytest.mark.parametrize("name", ["thing.ply", "thing.OBJ", "other.bin"])
def test_write_takes_the_format_from_the_name_or_from_its_caller(name: str, tmp_path: Path) -> None:
    write(tetrahedron(), tmp_path / name, "off" if name.endswith("bin") else None)
    assert np.array_equal(read(tmp_path / name).vertices, tetrahedron().vertices)


@pytest.mark.parametrize("name", ["ply", "obj", "off", "stl"])
def test_a_mesh_without_faces_can_be_written(name: str) -> None:
    with pytest.raises(NoFaces):
        read(to_bytes(Mesh(np.zeros((2, 3)), np.zeros((0, 3), int)), name), name)


SCALAR = np.zeros(4)


@pytest.mark.parametrize(
    ("name", "scalars", "error", "message"),
    [
        ("png", {}, UnknownName, "format to write 'png'; the choices are glb, obj, off, ply, stl"),
        ("obj", {"phi2": SCALAR}, ParameterError, "OBJ has no place for scalars"),
        ("ply", {"phi2": SCALAR[:3]}, ParameterError, re.escape("must have shape (4,)")),
        ("ply", {"phi2": np.zeros((4, 1))}, ParameterError, "found"),
        ("ply", {"a b": SCALAR}, ParameterError, "'a b'"),
        ("ply", {"x": SCALAR}, ParameterError, "not x, y or z"),
        ("ply", {"a\nproperty": SCALAR}, ParameterError, "letters"),
        ("ply", {"": SCALAR}, ParameterError, "letters"),
        ("glb", {"a": SCALAR + np.inf}, ParameterError, "beyond float32"),
        ("glb", {"a": SCALAR, "A": SCALAR}, ParameterError, "_A"),
    ],
)
def test_refusals(name: str, scalars: dict[str, np.ndarray], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        to_bytes(tetrahedron(), name, scalars=scalars)


@pytest.mark.parametrize("name", ["stl", "glb"])
def test_coordinates_beyond_float32_are_not_made_infinite(name: str) -> None:
    mesh = Mesh(tetrahedron().vertices * 1e300, tetrahedron().faces)
    with pytest.raises(MeshError, match="float32"):
        to_bytes(mesh, name)


def test_a_vertex_that_no_face_uses_may_be_nan_where_the_format_allows_it() -> None:
    vertices = np.vstack([tetrahedron().vertices, [np.nan, 0, 0]])
    mesh = Mesh(vertices, tetrahedron().faces)
    for name in ("ply", "obj", "off"):
        assert np.array_equal(read(to_bytes(mesh, name)).vertices, vertices, equal_nan=True)
    assert len(read(to_bytes(mesh, "stl")).faces) == 4
    with pytest.raises(MeshError, match="NaN"):
        to_bytes(mesh, "glb")


def test_glb_knows_no_empty_mesh() -> None:
    with pytest.raises(NoFaces):
        to_bytes(Mesh(np.zeros((2, 3)), np.zeros((0, 3), int)), "glb")


def test_scalars_are_read_from_ply_only() -> None:
    with pytest.raises(FormatError, match="PLY"):
        read_scalars(to_bytes(tetrahedron(), "obj"))
