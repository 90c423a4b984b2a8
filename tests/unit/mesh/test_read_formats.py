"""What all readers share: paths and bytes, which format it is, limits, and what is imported."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from reebase.errors import EmptyFile, FormatError, LimitError, ReebaseError, TooManyBytes, UnknownFormat
from reebase.mesh.read import FORMATS, Limits, read, read_scalars, sniff
from reebase.mesh.read.sniff import START, canonical
from reebase.mesh.write import WRITTEN, to_bytes
from tests.shapes import icosphere, tetrahedron
from tests.unit.mesh.test_read_3mf import ONE, simple
from tests.unit.mesh.test_read_gltf import document, embedded
from tests.unit.mesh.test_read_stl import text

SAMPLES = {
    **{name: to_bytes(icosphere(1), name) for name in WRITTEN},
    "gltf": embedded(document()),
    "3mf": simple(ONE),
}
TEXTS = {
    "obj": b"# a comment first\n\ng thing\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/2 3/3\n",
    "off": b"# OFF by hand\nCOFF 3 1 0\n0 0 0 1 1 1 1\n1 0 0 1 1 1 1\n0 1 0 1 1 1 1\n3 0 1 2\n",
    "ply": to_bytes(tetrahedron(), "ply"),
    "stl": text().encode(),
    "gltf": b'\n { "nodes": [], "asset": {"version": "2.0"} }',
}


def test_every_format_has_a_sample_here() -> None:
    assert set(SAMPLES) == set(FORMATS)


@pytest.mark.parametrize("name", FORMATS)
def test_sniff_tells_the_formats_apart_without_a_name(name: str) -> None:
    assert sniff(SAMPLES[name], None) == name
    assert len(read(SAMPLES[name]).faces) > 0


@pytest.mark.parametrize("name", TEXTS)
def test_sniff_tells_texts_apart(name: str) -> None:
    assert sniff(TEXTS[name], None) == name


def test_an_off_file_without_its_keyword() -> None:
    assert sniff(b"3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n") == "off"


def test_sniff_works_on_the_start_of_a_file_when_it_is_told_the_size() -> None:
    for name, data in {name: to_bytes(icosphere(5), name) for name in WRITTEN}.items():
        assert len(data) > START
        assert sniff(data[:START], size=len(data)) == name


@pytest.mark.parametrize("name", ["ply", "glb", "3mf", "off"])
def test_a_signature_is_believed_before_a_name(name: str) -> None:
    assert sniff(SAMPLES[name], "thing.stl") == name


def test_a_name_is_believed_where_the_content_has_no_signature() -> None:
    assert sniff(b"anything", "Some.Thing.OBJ") == "obj"
    assert sniff(SAMPLES["stl"][:90], "a.stl") == "stl"
    assert sniff(SAMPLES["obj"], "model.txt") == "obj"


@pytest.mark.parametrize(
    "data", [b"\x89PNG\r\n\x1a\n", b"hello", b"<html></html>", b'{"a": 1}', b"\0" * 200, b"1 2\n3"]
)
def test_what_is_no_mesh_is_refused_with_what_would_be(data: bytes) -> None:
    with pytest.raises(UnknownFormat, match="OBJ, OFF, PLY, STL, GLB, glTF, 3MF") as caught:
        sniff(data, "thing.png")
    assert caught.value.details["formats"] == list(FORMATS)


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("OBJ", "obj"), (".Stl", "stl"), ("model/gltf-binary", "glb"), ("model/obj; charset=utf-8", "obj"),
        ("application/sla", "stl"),
    ],
)  # fmt: skip
def test_formats_by_name_suffix_and_media_type(given: str, name: str) -> None:
    assert canonical(given) == name


@pytest.mark.parametrize("given", ["step", "", "dae", "x" * 10_000])
def test_unknown_names(given: str) -> None:
    with pytest.raises(UnknownFormat, match="it reads OBJ") as caught:
        canonical(given)
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize("name", FORMATS)
def test_paths_and_bytes_of_any_kind(name: str, tmp_path: Path) -> None:
    path = tmp_path / f"thing.{name.upper()}"
    path.write_bytes(SAMPLES[name])
    first = read(path)
    for other in (read(str(path)), read(SAMPLES[name]), read(memoryview(SAMPLES[name])), read(path, name)):  # type: ignore[arg-type]
        assert np.array_equal(first.vertices, other.vertices)
        assert np.array_equal(first.faces, other.faces)


def test_a_given_format_is_obeyed() -> None:
    with pytest.raises(FormatError):
        read(SAMPLES["ply"], "obj")
    with pytest.raises(UnknownFormat):
        read(SAMPLES["ply"], "png")


@pytest.mark.parametrize("form", [None, *FORMATS])
def test_empty_files(form: str | None, tmp_path: Path) -> None:
    with pytest.raises(EmptyFile):
        read(b"", form)
    (tmp_path / "a.ply").write_bytes(b"")
    with pytest.raises(EmptyFile):
        read(tmp_path / "a.ply", form)


def test_a_path_that_is_not_there_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read(tmp_path / "a.ply")


def test_files_over_the_limit_are_refused_unread(tmp_path: Path) -> None:
    with pytest.raises(TooManyBytes, match="limit is 100"):
        read(SAMPLES["ply"], limits=Limits(bytes=100))
    path = tmp_path / "huge.ply"
    with path.open("wb") as stream:
        stream.truncate(1 << 40)  # takes no room on the disk
    with pytest.raises(TooManyBytes, match="1,099,511,627,776"):
        read(path)
    with pytest.raises(TooManyBytes):
        read_scalars(SAMPLES["ply"], limits=Limits(bytes=100))


def test_running_out_of_memory_is_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    def exhausted(data: bytes, limits: Limits) -> None:
        raise MemoryError

    monkeypatch.setitem(sys.modules["reebase.mesh.read"]._READERS, "ply", exhausted)
    with pytest.raises(LimitError, match="memory"):
        read(SAMPLES["ply"])


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("form", [None, "own"])
def test_damaged_files_give_a_mesh_or_a_refusal_and_nothing_else(name: str, form: str | None) -> None:
    rng = np.random.default_rng(list(name.encode()))
    texts = [TEXTS[name]] if name in TEXTS else []
    likely = np.frombuffer(b'0123456789 -e.\n\r#/{}[]",:<>', dtype=np.uint8)
    for whole in (SAMPLES[name], *texts):
        for _ in range(150):
            data = np.frombuffer(whole, dtype=np.uint8)[: int(rng.integers(1, 2 * len(whole)))].copy()
            places = rng.integers(0, min(len(data), int(rng.choice([40, 400, len(data)]))), int(rng.integers(0, 5)))
            any_byte, likely_byte = rng.integers(0, 256, len(places)), rng.choice(likely, len(places))
            data[places] = np.where(rng.random(len(places)) < 0.5, any_byte, likely_byte)
            try:
                read(data.tobytes(), form and name)
            except ReebaseError as error:
                assert 10 < len(error.message) < 500, error.message
                assert error.message[-1] in ".)", error.message


def test_reading_imports_nothing_heavy() -> None:
    heavy = "{'trimesh', 'numba', 'scipy', 'lxml', 'networkx'}"
    code = f"import sys, reebase.mesh.read, reebase.mesh.write; print(*{heavy} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
