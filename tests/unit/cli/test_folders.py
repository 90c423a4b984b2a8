"""Folders of meshes and their labels, as people make them."""

import os
import unicodedata
from pathlib import Path

import pytest

from reebase.cli.folders import Labels, labels_of, mesh_files
from reebase.errors import ParameterError

NAMES = ("b.off", "a.PLY", "notes.txt", "sub/c.stl")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in NAMES:
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.touch()
    return tmp_path


def read(folder: Path, table: Path | None = None) -> Labels:
    return labels_of(folder, mesh_files(folder), table)


def named(folder: Path, content: str | bytes) -> dict[str, str]:
    """The labels that ``labels.csv`` with this content gives, by name."""
    data = content if isinstance(content, bytes) else content.encode()
    (folder / "labels.csv").write_bytes(data)
    return {path.relative_to(folder).as_posix(): label for path, label in read(folder).of.items()}


def test_mesh_files_are_found_by_suffix_in_every_folder(folder: Path) -> None:
    assert [path.relative_to(folder).as_posix() for path in mesh_files(folder)] == ["a.PLY", "b.off", "sub/c.stl"]


def test_hidden_files_and_pipes_are_passed_over_and_dead_links_are_not(folder: Path) -> None:
    (folder / "._a.PLY").touch()
    (folder / ".git").mkdir()
    (folder / ".git" / "x.off").touch()
    os.mkfifo(folder / "pipe.off")
    (folder / "dead.off").symlink_to("nowhere")
    (folder / "round").symlink_to(folder)
    names = [path.relative_to(folder).as_posix() for path in mesh_files(folder)]
    assert names == ["a.PLY", "b.off", "dead.off", "sub/c.stl"]


def test_labels_come_from_the_table_in_the_folder(folder: Path) -> None:
    assert named(folder, "file,label\na.PLY,ants\nsub/c.stl,cats\n") == {"a.PLY": "ants", "sub/c.stl": "cats"}


def test_without_a_table_the_sub_folder_is_the_label(folder: Path) -> None:
    assert read(folder) == Labels({folder / "sub/c.stl": "sub"})


@pytest.mark.parametrize(
    "content",
    [
        b"\xef\xbb\xbffile,label\na.PLY,ants\n",
        b"file,label\r\na.PLY,ants\r\n\r\n",
        b" File , LABEL \n  a.PLY ,  ants  \n",
        b"file;label\na.PLY;ants\n",
        b"file\tlabel\na.PLY\tants\n",
        b'"file","label"\n"a.PLY","ants"',
        b"label,notes,file\nants,,a.PLY\n",
        b"file,label\n./a.PLY,ants\na.PLY,ants\nb.off,\n,bees\n",
        b"file,label\na.PLY,ants\nb.off\n",
    ],
)
def test_tables_as_they_come_from_spreadsheets_are_read(folder: Path, content: bytes) -> None:
    assert named(folder, content) == {"a.PLY": "ants"}


def test_a_path_with_the_other_slash_is_found(folder: Path) -> None:
    assert named(folder, "file,label\nsub\\c.stl,cats\n") == {"sub/c.stl": "cats"}


def test_an_accent_may_be_composed_or_not(folder: Path) -> None:
    (folder / unicodedata.normalize("NFD", "é.off")).touch()
    found = named(folder, unicodedata.normalize("NFC", "file,label\né.off,x\n"))
    assert list(found.values()) == ["x"]


def test_rows_without_a_mesh_file_are_told(folder: Path) -> None:
    (folder / "labels.csv").write_text("file,label\na.PLY,ants\nz.ply,zebras\nz.ply,zebras\nnotes.txt,text\n")
    assert read(folder) == Labels({folder / "a.PLY": "ants"}, ("z.ply", "notes.txt"))


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("name;class\na.PLY;ants\n", "columns file and label; found name, class"),
        ("", "found nothing"),
        ("file,label\nz.ply,zebras\n", r"names 1 file, and none is .*z\.ply"),
        ("file,label\na.PLY,ants\nb.off,x\na.PLY,bees\n", r"line 4: a\.PLY has the label 'bees' here and 'ants'"),
        (b"file,label\na.PLY,\xff\xfe\n", "could not be read"),
    ],
)
def test_tables_that_cannot_be_meant_are_refused(folder: Path, content: str | bytes, complaint: str) -> None:
    with pytest.raises(ParameterError, match=complaint):
        named(folder, content)


def test_a_table_that_is_not_there_is_refused(folder: Path) -> None:
    with pytest.raises(ParameterError, match="could not be read"):
        read(folder, folder / "absent.csv")


def test_a_folder_without_meshes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="no mesh files"):
        mesh_files(tmp_path)


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="not a folder"):
        mesh_files(tmp_path / "absent")
