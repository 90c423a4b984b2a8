"""Folders of mesh files and their labels."""

from __future__ import annotations

import csv
import os
import unicodedata
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from reebase.errors import ParameterError
from reebase.mesh.read import FORMATS
from reebase.words import counted

__all__ = ["ABSENT", "Labels", "labels_of", "mesh_files"]

ABSENT = "The table of labels names it, but there is no such mesh file."
"""Why a row of the table led to nothing."""


@dataclass(frozen=True)
class Labels:
    """The label of each file that has one.

    absent: rows of the table, as they name their file, for which there is no mesh file in the folder.
    """

    of: dict[Path, str]
    absent: tuple[str, ...] = field(default=())


def mesh_files(folder: Path) -> list[Path]:
    """Every file under ``folder`` whose suffix names a format that Reebase reads, sorted by path.

    Hidden files and folders are passed over, and links to folders are not followed.
    Raises ParameterError when there is none, OSError for a folder that cannot be listed.
    """
    if not folder.is_dir():
        raise ParameterError(f"{folder} is not a folder.")
    found = []
    for place, folders, names in os.walk(folder, onerror=_refuse):
        folders[:] = [name for name in folders if not name.startswith(".")]
        found += [Path(place, name) for name in names if not name.startswith(".")]
    found = sorted(path for path in found if path.suffix[1:].lower() in FORMATS and _may_be_read(path))
    if not found:
        raise ParameterError(f"{folder} holds no mesh files ({', '.join(sorted(FORMATS))}).")
    return found


def _refuse(failure: OSError) -> NoReturn:
    # Part of a folder taken for the whole would be worse.
    raise failure


def _may_be_read(path: Path) -> bool:
    # A link to nowhere is kept, so that it is reported; a pipe would be waited for.
    return path.is_file() or not path.exists()


def labels_of(folder: Path, files: Sequence[Path], table: Path | None) -> Labels:
    """The labels of ``files``, from a CSV file with the columns ``file`` (within the folder) and ``label``.

    By default it is ``labels.csv`` in the folder; where there is none, the folder that holds a file is its label, and a
    file directly in ``folder`` has none.
    Commas, semicolons or tabs separate; a byte order mark, spaces at the ends and empty lines are passed over.
    Raises ParameterError for a table without these columns, with two labels for one file, or that names none of
    the files.
    """
    chosen = table or folder / "labels.csv"
    if table is None and not chosen.exists():
        return Labels({path: path.parent.name for path in files if path.parent != folder})
    by_name = {_plain(path.relative_to(folder).as_posix()): path for path in files}
    found: dict[Path, str] = {}
    absent = []
    for line, name, label in _rows(chosen):
        path = by_name.get(_plain(name)) or by_name.get(_plain(name.replace("\\", "/")))
        if path is None:
            absent.append(name)
        elif found.setdefault(path, label) != label:
            raise ParameterError(
                f"{chosen}, line {line}: {name} has the label {label!r} here and {found[path]!r} before."
            )
    if absent and not found:
        raise ParameterError(
            f"{chosen} names {counted(len(absent), 'file')}, and none is a mesh file in {folder}; "
            f"the first is {absent[0]}."
        )
    return Labels(found, tuple(dict.fromkeys(absent)))


def _plain(name: str) -> str:
    """A path within the folder as it is compared: some systems decompose accents, some tables begin with ./"""
    return unicodedata.normalize("NFC", os.path.normpath(name))


def _rows(table: Path) -> Iterable[tuple[int, str, str]]:
    """(line, file, label) of each row that has both."""
    try:
        with table.open(newline="", encoding="utf-8-sig") as lines:
            first = lines.readline()
            separator = next((mark for mark in ",;\t" if mark in first), ",")
            header = [name.strip().lower() for name in next(csv.reader([first], delimiter=separator), [])]
            if not {"file", "label"} <= set(header):
                raise ParameterError(
                    f"{table} must begin with a line that names the columns file and label; "
                    f"found {', '.join(header) or 'nothing'}."
                )
            reader = csv.DictReader(lines, header, delimiter=separator)
            for row in reader:
                name, label = (row["file"] or "").strip(), (row["label"] or "").strip()
                if name and label:
                    yield reader.line_num + 1, name, label
    except (OSError, UnicodeDecodeError, csv.Error) as failure:
        raise ParameterError(f"{table} could not be read: {failure}.") from failure
