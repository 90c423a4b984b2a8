"""Folders of meshes and their labels."""

from pathlib import Path

import pytest

from reebase.cli.folders import labels_of, mesh_files
from reebase.errors import ParameterError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("b.off", "a.PLY", "notes.txt", "labels.csv", "sub/c.stl"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("file,label\na.PLY,ants\nb.off,bees\n" if name == "labels.csv" else "")
    return tmp_path


def test_mesh_files_are_found_by_suffix_in_every_folder(folder: Path) -> None:
    assert [path.relative_to(folder).as_posix() for path in mesh_files(folder)] == ["a.PLY", "b.off", "sub/c.stl"]


def test_labels_come_from_the_table_in_the_folder(folder: Path) -> None:
    assert labels_of(folder, None) == {folder / "a.PLY": "ants", folder / "b.off": "bees"}


def test_without_a_table_the_sub_folder_is_the_label(folder: Path) -> None:
    (folder / "labels.csv").unlink()
    assert labels_of(folder, None) == {folder / "sub/c.stl": "sub"}


def test_a_table_with_other_columns_is_refused(folder: Path) -> None:
    table = folder / "other.csv"
    table.write_text("name;class\na.PLY;ants\n")
    with pytest.raises(ParameterError, match="columns file and label"):
        labels_of(folder, table)


def test_a_table_that_names_absent_files_is_refused(folder: Path) -> None:
    table = folder / "other.csv"
    table.write_text("file,label\nz.ply,zebras\n")
    with pytest.raises(ParameterError, match=r"z\.ply"):
        labels_of(folder, table)


def test_a_folder_without_meshes_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="no mesh files"):
        mesh_files(tmp_path)


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="not a folder"):
        mesh_files(tmp_path / "absent")
