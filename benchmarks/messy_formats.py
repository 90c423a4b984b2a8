"""Files from the wild through the readers: what reads, what is refused, with which code and words.

    ./run python benchmarks/messy_formats.py [--data DIR] [--only WORD]

DIR is the folder that holds messy-a and its neighbours (default: REEBASE_DATA, or ../shared/data). For each
file of messy-a the table says what came of it beside what trimesh made of it when the file was picked (with its
neighbours in reach, which we never open). All meshes of the other folders must equal trimesh's arrays to the
bit. Warnings are errors. Exits 1 for any exception that is not ours, any file slower than a second, any
mesh that differs.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import textwrap
import time
import warnings
from pathlib import Path

import numpy as np

from reebase.errors import ReebaseError
from reebase.mesh.read import read

SLOW = 1.0
"""Seconds; the largest file here has 43k vertices."""
FOLDERS = ("articulated-a", "rigid-a", "hires-a", "denoise-a")


def outcome(path: Path) -> tuple[str, str, float]:
    """(what came of it, code or empty, seconds)."""
    began = time.perf_counter()
    try:
        mesh = read(path)
    except ReebaseError as error:
        return error.message, error.code, time.perf_counter() - began
    except Exception as error:
        return f"{type(error).__name__}: {error}", "NOT OURS", time.perf_counter() - began
    return f"{len(mesh.vertices)} / {len(mesh.faces)}", "", time.perf_counter() - began


def messy(folder: Path, only: str) -> int:
    """Prints the table; returns the number of failures."""
    counts: dict[str, int] = {}
    failures = 0
    with (folder / "files.csv").open(newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if only in row["file"]]
    for row in rows:
        found, code, seconds = outcome(folder / row["file"])
        counts[code or "reads"] = counts.get(code or "reads", 0) + 1
        failures += code == "NOT OURS" or seconds > SLOW
        theirs = row["what_trimesh_says"].removeprefix("ERROR ")
        if row["vertices"]:
            theirs = f"{row['vertices']} / {row['faces']}"
        mark = "=" if found == theirs else " "
        print(f"{row['file'][:52]:52} {code or 'reads':22} {'' if code else found:>16} {mark} {theirs[:40]}")
        if code:
            print(textwrap.indent(textwrap.fill(found, 110), "      "))
        if seconds > SLOW:
            print(f"      SLOW: {seconds:.2f} s")
    print(f"\n{len(rows)} files: " + ", ".join(f"{count} {code}" for code, count in sorted(counts.items())))
    return failures


def clean_folders(data: Path) -> int:
    """Compares every PLY of the other folders with trimesh; returns the number that differ."""
    import trimesh

    files = [path for name in FOLDERS for path in sorted((data / name).rglob("*.ply"))]
    ours_seconds = theirs_seconds = 0.0
    different = 0
    for path in files:
        began = time.perf_counter()
        ours = read(path)
        ours_seconds += time.perf_counter() - began
        began = time.perf_counter()
        theirs = trimesh.load(path, process=False, force="mesh")
        theirs_seconds += time.perf_counter() - began
        same = np.array_equal(ours.vertices, theirs.vertices) and np.array_equal(ours.faces, theirs.faces)
        if not same:
            different += 1
            print(f"{path.name}: differs from trimesh")
    print(
        f"{len(files)} meshes of {', '.join(FOLDERS)}: {different} differ from trimesh {trimesh.__version__}; "
        f"read in {ours_seconds:.2f} s, trimesh {theirs_seconds:.2f} s"
    )
    return different


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    here = Path(__file__).resolve().parent
    parser.add_argument("--data", type=Path, default=os.environ.get("REEBASE_DATA", here / "../../shared/data"))
    parser.add_argument("--only", default="", help="files of messy-a whose name holds this")
    options = parser.parse_args()
    data = Path(options.data)
    if not (data / "messy-a/files.csv").exists():
        print(f"There is no messy-a/files.csv in {data}; name the folder with --data or REEBASE_DATA.")
        return 2
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        failures = messy(data / "messy-a", options.only)
    return 1 if failures + clean_folders(data) else 0


if __name__ == "__main__":
    sys.exit(main())
