"""Folders of mesh files and their labels."""

from __future__ import annotations

import csv
from pathlib import Path

from reebase.errors import ParameterError
from reebase.mesh.read import FORMATS

__all__ = ["labels_of", "mesh_files"]


def mesh_files(folder: Path) -> list[Path]:
    """Every file under ``folder`` whose suffix names a format that Reebase reads, sorted by path."""
    if not folder.is_dir():
        raise ParameterError(f"{folder} is not a folder.")
    found = sorted(
        path for path in folder.rglob("*") if path.is_file() and path.suffix[1:].lower() in FORMATS
    )
    if not found:
        raise ParameterError(f"{folder} holds no mesh files ({', '.join(sorted(FORMATS))}).")
    return found


def labels_of(folder: Path, labels: Path | None) -> dict[Path, str]:
    """The label of each file that has one: from the CSV (columns ``file``, ``label``), by default ``labels.csv``
    in the folder when there is one, else the name of the sub-folder that holds the file.

    Raises ParameterError for a CSV without these columns or that names a file which is not there.
    """
    table = labels or folder / "labels.csv"
    if labels is None and not table.exists():
        return {path: path.parent.name for path in mesh_files(folder) if path.parent != folder}
    try:
        with table.open(newline="", encoding="utf-8-sig") as lines:
            reader = csv.DictReader(lines)
            if not {"file", "label"} <= set(reader.fieldnames or ()):
                raise ParameterError(
                    f"{table} must begin with a line that names the columns file and label; "
                    f"found {', '.join(reader.fieldnames or ['nothing'])}."
                )
            found = {folder / row["file"]: row["label"].strip() for row in reader if row["label"]}
    except (OSError, UnicodeDecodeError, csv.Error) as failure:
        raise ParameterError(f"{table} could not be read: {failure}.") from failure
    absent = [path for path in found if not path.is_file()]
    if absent:
        raise ParameterError(
            f"{table} names {len(absent)} files that are not in {folder}, the first is {absent[0].name}."
        )
    return found
